"""`python -m pdpatrol.missions.learning`: train, evaluate, and draw the learning curve."""

from __future__ import annotations

import json
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import tyro

from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.cli.process import command_process, one_line
from pdpatrol.missions.cli.terminal import err, out, output_folder, refuse

MAX_SEED = 899_000
"""Beyond it lie the yards of the learning curve and of the evaluation."""


def learn(
    *,
    steps: int = 300_000,
    yards: int = 200,
    seek_yards: int = 20,
    threads: int = 1,
    seed: int = 0,
    out_dir: Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")] = None,
    json_output: Annotated[bool, tyro.conf.arg(name="json")] = False,
) -> None:
    """Train PPO to reach the source in an open yard, and put it beside the hand-written policies in unseen yards.

    Writes model.zip, learning_curve.json and learning.png.

    Args:
        steps: Of training, of 64 robots together; 8192 to 100000000, rounded up to whole rounds of 8192.
        yards: Unseen yards of the final evaluation; 1 to 100000.
        seek_yards: In how many of them a mission of `seek` runs too; 0 to YARDS.
        threads: Of the physics; 1 to 64. The result does not depend on it.
        seed: Fixes all that is drawn; 0 to 899000.
        out_dir: Folder to write to; new or empty. Default: runs/learning-SEED, then -2, -3 and so on.
        json_output: Print the figures as JSON instead of a table.
    """
    limits = {
        "steps": (steps, 8192, 100_000_000),
        "yards": (yards, 1, 100_000),
        "seek-yards": (seek_yards, 0, yards),
        "threads": (threads, 1, 64),
        "seed": (seed, 0, MAX_SEED),
    }
    faults = [
        f"--{name}: got {got}; allowed is {low} to {high}"
        for name, (got, low, high) in limits.items()
        if not low <= got <= high
    ]
    if faults:
        refuse(*faults)
    with output_folder(out_dir, f"learning-{seed}") as folder:
        if find_spec("stable_baselines3") is None:
            refuse(
                "stable-baselines3 is not installed; "
                "run it with: uv run --extra rl python -m pdpatrol.missions.learning"
            )
        data = _learn(steps, yards, seek_yards, threads, seed, folder)
    if json_output:
        out.print_json(data=data)
        return
    out.print(_table(data["policies"]))
    out.print(
        f"{data['steps']} steps in {data['training_wall_s']:.0f} s. "
        f"Written to {one_line(str(folder))}: model.zip, learning_curve.json, learning.png",
        soft_wrap=True,
    )


def _learn(steps: int, yards: int, seek_yards: int, threads: int, seed: int, folder: Path) -> dict[str, Any]:
    import numpy as np
    from rich.progress import Progress

    from pdpatrol.missions.learning.evaluation import evaluate, evaluate_seek
    from pdpatrol.missions.learning.figure import draw_curve
    from pdpatrol.missions.learning.steering import RandomSteering, towards_last_bearing
    from pdpatrol.missions.learning.training import steering_of, train

    started_s = time.perf_counter()
    with Progress(console=err, transient=True) as progress:
        bar = progress.add_task("training", total=steps)
        model, curve = train(steps, seed, num_threads=threads, advance=lambda n: progress.advance(bar, n))
        training_s = time.perf_counter() - started_s
        with atomic_file(folder / "model.zip") as file:
            model.save(file)
        progress.update(bar, description="evaluation", total=None)
        tried = {
            "ppo": steering_of(model),
            "towards_last_bearing": towards_last_bearing,
            "random": RandomSteering(np.random.default_rng([seed, 1])),
        }
        policies = {name: evaluate(policy, yards, num_threads=threads).summary() for name, policy in tried.items()}
        if seek_yards:
            policies["seek"] = evaluate_seek(seek_yards).summary()
    data = {
        "seed": seed,
        "steps": curve[-1]["steps"],
        "training_wall_s": round(training_s, 1),
        "curve": curve,
        "policies": policies,
    }
    write_text(folder / "learning_curve.json", json.dumps(data, indent=2) + "\n")
    with atomic_file(folder / "learning.png") as picture:
        draw_curve(curve, policies, picture)
    return data


def _table(policies: dict[str, Any]) -> Any:  # noqa: ANN401 - a table of rich
    from rich.table import Table

    table = Table(title="Unseen open yards in which the source was reached within the time limit")
    for heading in ("policy", "reached", "beside it at the start", "touched the fence", "median time"):
        table.add_column(heading, justify="left" if heading == "policy" else "right")
    for name, told in policies.items():
        table.add_row(
            name.replace("_", " "),
            f"{told['reached']} of {told['yards']} ({told['success']:.1%})",
            str(told["beside_at_start"]),
            str(told["yards_with_contact"]),
            "-" if told["median_s"] is None else f"{told['median_s']:.1f} s",
        )
    return table


def main() -> None:
    """Entry point of `python -m pdpatrol.missions.learning`."""
    with command_process():
        tyro.cli(learn, prog="python -m pdpatrol.missions.learning", config=(tyro.conf.FlagCreatePairsOff,))


if __name__ == "__main__":
    main()
