"""Every command and snippet of the documentation runs, here or in a test that is named here."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from argparse import ArgumentParser
from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import Mission
from pdpatrol.missions.site_map_files.name_mapping import read_mapping
from pdpatrol.missions.sweep.plan import make_plan, parse_grid
from tests.docs.site import ROOT
from tests.envs.helpers import write_yard
from tests.test_readme import blocks, commands, run_snippet, served_on_loopback

DOCS = ROOT / "docs"
BIN = Path(sys.executable).parent
LEAVES_MISSION, MISSION = "1. Run a mission", "runs/two_sources-7"

ELSEWHERE = {
    "gallery.md": "tests/browser/test_gallery.py",
    "how-to/estimator.md": "tests/examples/test_own.py",
    "how-to/policy.md": "tests/examples/test_own.py",
    "how-to/robot.md": "tests/examples/test_own.py",
    "how-to/training.md": "tests/examples/test_learning.py",
    "how-to/learning_libraries.md": "tests/examples/test_learning_libraries.py",
    "how-to/trend.md": "tests/examples/test_campaign.py",
    "how-to/equipment.md": "tests/robot_models/test_equipment.py",
}
"""Pages whose commands are all run by other tests."""

DATA_PAGES = ("how-to/locate.md", "how-to/antenna.md", "answers.md", "sweeps.md", "suite.md")
"""Pages whose commands `test_commands_on_data` runs, except for sweeps, which take hours: their plans are made below,
and tests/missions/sweep runs small ones."""

EXAMPLES = {
    "antenna": "tests/examples/test_antenna.py",
    "measured": "tests/examples/test_measured.py",
    "site_map": "tests/missions/site_map_files",
}
"""Examples that no page includes, with the tests that run their commands."""

NOT_RUN = {
    "pip install": "changes the installation",
    "ray ": "needs a cluster of machines; tests/missions/sweep runs the same sweep on a local Ray",
    "#!/bin/sh": "needs SLURM; tests/missions/sweep runs shards",
    "#SBATCH": "needs SLURM",
    "shard=": "needs SLURM",
    "uv run python -m mujoco.viewer": "opens a window; tests/examples loads the same file",
}
"""Beginnings of lines that no test runs, with the reason."""


def text_of(file: Path) -> str:
    """Return the text of a page with the Markdown files that it includes."""
    included = r'^--8<-- "([^":]+\.md)"$'
    text = file.read_text(encoding="utf-8")
    return re.sub(included, lambda found: (ROOT / found[1]).read_text(encoding="utf-8"), text, flags=re.MULTILINE)


PAGES = {file.relative_to(DOCS).as_posix(): text_of(file) for file in sorted(DOCS.rglob("*.md"))}


def lines(text: str) -> list[str]:
    """Return the lines of all shell blocks without comments; lines that are continued are joined."""
    joined = [block.replace("\\\n", " ") for block in blocks("sh", text)]
    shell = [re.sub(r"'[^']*'", lambda quoted: quoted[0].replace("\n", ""), block) for block in joined]
    shown = [line.split("  #")[0].strip() for block in shell for line in block.splitlines()]
    return [line for line in shown if line not in ("", "pip install uv") and not line.startswith(tuple(NOT_RUN))]


def sections(text: str) -> dict[str, str]:
    """Return the sections of a page by their headings."""
    parts = re.split(r"^## (.*)$", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


TUTORIAL = {title: steps for title, text in sections(PAGES["tutorial.md"]).items() if (steps := lines(text))}
FOLLOWING = [title for title, steps in TUTORIAL.items() if MISSION in " ".join(steps)]
ALONE = [title for title in TUTORIAL if title not in (LEAVES_MISSION, *FOLLOWING)]


def run(steps: list[str], folder: Path) -> str:
    """Run the lines in a shell, in a folder that represents the top of the repository; return what they print."""
    printed = ""
    environment = os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    for line in steps:
        command = line.replace("uv run ", "")
        if "replay" in command and "--web" in command:
            served_on_loopback(command.split(), folder, environment)
            continue
        if command.startswith("pdpatrol edit"):
            served_on_loopback([*command.split(), "--no-open"], folder, environment)
            continue
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, f"{line}: {done.stderr}"
        printed += done.stdout
    return printed


@pytest.fixture
def top(tmp_path: Path) -> Path:
    for name in ("envs", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


@pytest.mark.whole
def test_tutorial_runs_from_mission_to_export(top: Path) -> None:
    for title in (LEAVES_MISSION, *FOLLOWING):
        run(TUTORIAL[title], top)
    shown = re.findall(r"^\| `([\w.]+)` \|", sections(PAGES["tutorial.md"])[LEAVES_MISSION], flags=re.MULTILINE)
    assert {path.name for path in (top / MISSION).iterdir()} == set(shown)
    for snippet in blocks("python", PAGES["schemas/report.md"]):
        run_snippet(snippet, top)


@pytest.mark.whole
@pytest.mark.parametrize("steps", [*(TUTORIAL[title] for title in ALONE), lines(PAGES["how-to/yard.md"])])
def test_other_steps_of_the_docs_run(steps: list[str], top: Path) -> None:
    printed = run(steps, top)
    shown = [
        block
        for text in sections(PAGES["tutorial.md"]).values()
        if lines(text) == steps
        for block in blocks("text", text)
    ]
    numbers = re.findall(r"\d+(?:\.\d+)?", " ".join(shown))
    assert [number for number in numbers if number not in printed] == []


def test_every_command_of_the_docs_is_run_by_a_test() -> None:
    known = {*commands(), *lines(PAGES["tutorial.md"]), *lines(PAGES["how-to/yard.md"])}
    others = {name: text for name, text in PAGES.items() if name not in (*ELSEWHERE, *DATA_PAGES)}
    assert [(name, line) for name, text in others.items() for line in lines(text) if line not in known] == []
    assert [place for place in (*ELSEWHERE.values(), *EXAMPLES.values()) if not (ROOT / place).exists()] == []
    of_rows = [line for name in DATA_PAGES[2:] for line in lines(PAGES[name])]
    assert {line.split()[1] for line in of_rows} == {"results", "run", "sweep"}
    included = {
        found for page in DOCS.rglob("*.md") for found in re.findall(r"examples/(\w+)/README", page.read_text())
    }
    assert {file.parent.name for file in (ROOT / "examples").glob("*/README.md")} == included | set(EXAMPLES)
    assert [name for name in ELSEWHERE if not lines(PAGES[name])] == []
    everything = "\n".join(block for text in PAGES.values() for block in blocks("sh", text))
    assert [start for start in NOT_RUN if f"\n{start}" not in f"\n{everything}"] == []


HELP = sections(PAGES["reference/commands.md"])


@pytest.mark.parametrize("name", [name for name, text in PAGES.items() if "pdpatrol " in "".join(blocks("sh", text))])
def test_commands_on_pages_exist_with_their_options(name: str) -> None:
    for command, rest in re.findall(r"pdpatrol (\w+)(.*)", "\n".join(blocks("sh", PAGES[name])).replace("\\\n", " ")):
        unknown = [option for option in re.findall(r" (--[\w-]+)", rest) if f" {option} " not in f"{HELP[command]} "]
        assert unknown == [], f"{command}{rest}"


def sweeps() -> list[str]:
    """Return the arguments of all sweeps of the documentation; a quoted setting may continue on the next line."""
    shell = "\n".join(block.replace("\\\n", " ") for text in PAGES.values() for block in blocks("sh", text))
    return sorted(
        {
            found.partition("  #")[0].strip()
            for found in re.findall(r"pdpatrol sweep ((?:--set '[^']*'|[^'\n])*)", shell)
        }
    )


@pytest.mark.whole
@pytest.mark.parametrize("arguments", sweeps())
def test_sweeps_of_the_docs_are_valid_plans(arguments: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenarios, settings and policies exist and are valid; the missions themselves take hours."""
    if "trained.py" in arguments:
        pytest.importorskip("stable_baselines3", reason="the extra `rl` is not installed")
    parser = ArgumentParser()
    parser.add_argument("scenario", nargs="*")
    parser.add_argument("--policy", nargs="+", default=["seek"])
    parser.add_argument("--set", action="append", default=[])
    given, _ = parser.parse_known_args(shlex.split(arguments))
    monkeypatch.chdir(ROOT)
    assert make_plan(given.scenario, given.policy, parse_grid(given.set), range(2)).jobs


@pytest.mark.whole
def test_snippets_of_the_yard_page_run(tmp_path: Path) -> None:
    text = PAGES["how-to/yard.md"]
    (snippet,), (scenario, fence, mapping) = blocks("python", text), blocks("toml", text)
    run_snippet(snippet, tmp_path)
    (tmp_path / "fence.toml").write_text(f"{fence}[route]\ndock_m = [2.0, 2.0]\n[array]\n", encoding="utf-8")
    assert len(load_scenario(tmp_path / "fence.toml").yard.fence.corners_m) == 6
    (tmp_path / "mapping.toml").write_text(mapping, encoding="utf-8")
    row = read_mapping(tmp_path / "mapping.toml").row("qa12")
    assert row is not None
    assert (row.kind, row.kv) == ("circuit_breaker", 220)
    (tmp_path / "yard.toml").write_text(scenario, encoding="utf-8")
    assert len(load_scenario(tmp_path / "yard.toml").yard.equipment) == 2


@pytest.mark.whole
def test_locator_on_its_page_runs_a_mission(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = PAGES["how-to/locator.md"]
    (code,), (table,) = blocks("python", text), blocks("toml", text)
    (tmp_path / "watched.py").write_text(code, encoding="utf-8")

    def end_early(mission: Mission) -> None:
        if mission.time_s > 15.0:
            mission.end("interrupted")

    Mission(load_scenario(write_yard(tmp_path, table)), "patrol", 1).run(end_early)
    assert "s: now 1 candidates and findings" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["how-to/long_missions.md", "how-to/plan.md", "radio.md"])
def test_tables_of_a_page_are_valid_settings(name: str) -> None:
    tables = [tomllib.loads(block) for block in blocks("toml", PAGES[name])]
    assert tables
    for each in tables:
        load_scenario(
            "one_source", {f"{table}.{key}": value for table, keys in each.items() for key, value in keys.items()}
        )


def test_pages_with_snippets_are_listed_here() -> None:
    code = {name for name, text in PAGES.items() if blocks("python", text)}
    assert code == {"how-to/yard.md", "how-to/locator.md", "schemas/report.md"}
    settings = {name for name, text in PAGES.items() if any("=" in block for block in blocks("toml", text))}
    here = {"how-to/locator.md", "how-to/long_missions.md", "how-to/plan.md", "how-to/yard.md", "radio.md"}
    assert settings - set(ELSEWHERE) == {"scenarios.md", *here}
