"""The learned baseline: its adapter tells the truth about resets, and its command refuses what it must."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import Scenario
from pdpatrol.envs.random_yard import open_yard
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.envs.wrappers import Flattener, bearings_only, bearings_only_space
from pdpatrol.missions.learning.evaluation import evaluate
from pdpatrol.missions.learning.figure import draw_curve
from pdpatrol.missions.learning.steering import RandomSteering, towards_last_bearing

HIDE = "sys.modules['stable_baselines3'] = None; "
"""As if the extra were not installed."""
COMMAND = "import runpy; runpy.run_module('pdpatrol.missions.learning', run_name='__main__', alter_sys=True)"


def learning(*arguments: str, cwd: Path, first: str = "") -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", f"import sys; sys.argv[1:] = {list(arguments)!r}; {first}{COMMAND}"]
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=600)


def brief() -> Scenario:
    """An open yard in which some episodes end by time and some by approach."""
    scenario = open_yard()
    return scenario.model_copy(
        update={"task": scenario.task.model_copy(update={"time_limit_s": 3.0, "standoff_m": 13.0})}
    )


def adapter(num_envs: int) -> Any:  # noqa: ANN401
    pytest.importorskip("stable_baselines3", reason="uv run --extra rl")
    from pdpatrol.missions.learning.learner_envs import LearnerEnvs

    return LearnerEnvs(PatrolVectorEnv(num_envs, brief(), num_threads=1, autoreset_mode="SameStep"))


def test_the_adapter_tells_the_last_of_the_old_episode_and_the_first_of_the_new_one() -> None:
    learner, bare = adapter(6), PatrolVectorEnv(6, brief(), num_threads=1)
    flatten = Flattener(bearings_only_space(bare.single_observation_space))
    learner.seed(30)
    assert learner.reset().tolist() == flatten(bearings_only(bare.reset(seed=30)[0])).tolist()
    actions, ends = np.full((6, 2), 0.4, dtype=np.float32), {True: 0, False: 0}
    over = np.zeros(6, dtype=np.bool_)
    for _ in range(31):  # all rows end once; what ended first lags a step in the environment that resets a step later
        seen, reward, done, infos = learner.step(actions)
        whole, bare_reward, terminated, truncated, _ = bare.step(actions)
        for row in np.flatnonzero((terminated | truncated) & ~over).tolist():
            over[row] = True
            ends[bool(terminated[row])] += 1
            last = flatten(bearings_only(whole))[row]
            np.testing.assert_array_equal(infos[row]["terminal_observation"], last)
            assert infos[row]["TimeLimit.truncated"] == (not terminated[row])
            assert infos[row]["is_success"] == terminated[row]
            assert done[row]
            assert reward[row] == np.float32(bare_reward[row])
            assert seen[row, flatten.names.index("time[0]")] == -1.0
            assert last[flatten.names.index("time[0]")] > -1.0
    assert over.all()
    assert min(ends.values()) > 0


def test_the_adapter_wants_the_reset_in_the_same_step() -> None:
    pytest.importorskip("stable_baselines3", reason="uv run --extra rl")
    from pdpatrol.missions.learning.learner_envs import LearnerEnvs

    with pytest.raises(ValueError, match="autoreset_mode is NextStep; allowed is SameStep"):
        LearnerEnvs(PatrolVectorEnv(1, brief(), num_threads=1))


def test_no_seed_of_training_meets_a_yard_of_the_learning_curve_or_of_the_evaluation() -> None:
    pytest.importorskip("stable_baselines3", reason="uv run --extra rl")
    from pdpatrol.missions.learning.__main__ import MAX_SEED
    from pdpatrol.missions.learning.evaluation import UNSEEN_FROM
    from pdpatrol.missions.learning.training import CURVE_FROM, CURVE_YARDS, N_ROBOTS

    assert MAX_SEED + N_ROBOTS <= CURVE_FROM
    assert CURVE_FROM + CURVE_YARDS <= UNSEEN_FROM


def test_who_follows_the_bearing_gets_there_in_every_yard_and_who_drives_at_random_does_not() -> None:
    followed = evaluate(towards_last_bearing, 12)
    drifted = evaluate(RandomSteering(np.random.default_rng(0)), 12)
    assert followed.success == 1.0
    assert followed.n_touched == 0
    assert drifted.success < 0.3
    assert evaluate(towards_last_bearing, 3, num_threads=2).reached_s.tolist() == followed.reached_s[:3].tolist()


def test_a_bearing_to_the_left_is_turned_to_and_none_is_waited_for() -> None:
    bearing = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1e-3], [0.0, 0.0]], dtype=np.float32)
    actions = towards_last_bearing({"bearing": bearing})
    np.testing.assert_allclose(actions, [[1, 0], [0, 1], [0, -1], [0, 0]], atol=1e-6)


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    summary = {"yards": 4, "success": 0.5}
    policies = {name: summary for name in ("ppo", "towards_last_bearing", "random")}
    curve = [{"steps": steps, "success": steps / 16384, "yards": 50} for steps in (0, 8192)]
    draw_curve(curve, policies, tmp_path / "learning.png")
    assert (tmp_path / "learning.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_has_help_and_says_how_to_get_what_it_lacks(tmp_path: Path) -> None:
    told = learning("--help", cwd=tmp_path, first=HIDE)
    assert told.returncode == 0, told.stderr
    assert "usage: python -m pdpatrol.missions.learning" in told.stdout
    refused = learning(cwd=tmp_path, first=HIDE)
    assert refused.returncode == 2
    assert (
        refused.stderr
        == "stable-baselines3 is not installed; run it with: uv run --extra rl python -m pdpatrol.missions.learning\n"
    )
    assert not list(tmp_path.iterdir())


def test_wrong_arguments_and_a_folder_that_is_not_empty_are_refused(tmp_path: Path) -> None:
    wrong = learning("--steps", "1", "--seed", "900000", cwd=tmp_path)
    assert wrong.returncode == 2
    assert wrong.stderr.splitlines()[:2] == [
        "--steps: got 1; allowed is 8192 to 100000000",
        "--seed: got 900000; allowed is 0 to 899000",
    ]
    (tmp_path / "kept.txt").touch()
    full = learning("--out", ".", cwd=tmp_path)
    assert full.returncode == 2
    assert "--out: . is not empty; allowed is a new or an empty folder" in full.stderr


@pytest.mark.slow
def test_a_short_training_already_gets_better_and_leaves_its_files(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="uv run --extra rl")
    done = learning("--steps", "65536", "--yards", "20", "--seek-yards", "1", "--out", "run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "run").iterdir()} == {"model.zip", "learning_curve.json", "learning.png"}
    told = json.loads((tmp_path / "run" / "learning_curve.json").read_text(encoding="utf-8"))
    assert told["policies"]["ppo"]["success"] > told["policies"]["random"]["success"] + 0.3
