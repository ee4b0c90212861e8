"""Users' estimators are used for bearings, and their errors are one line with file and line number."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs import Scenario, ScenarioError, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.runner import run_mission
from tests.envs.helpers import STAND, write_yard

GOOD = """\
import numpy as np
from dirmusic import bearings_towards


class Mine:
    calls = 0

    def __call__(self, pulses, array):
        Mine.calls += 1
        look = array.manifold.boresights_rad[pulses.strengths_v.argmax(axis=-1)]
        found = bearings_towards(look, pulses, array)
        return found._replace(std_rad=np.hypot(found.std_rad, 0.3))
"""


def scenario_with(folder: Path, code: str, name: str = "Mine", scenario: str = "one_source") -> Path:
    """Write a scenario that names an estimator in the same folder."""
    (folder / "mine.py").write_text(code, encoding="utf-8")
    return write_yard(folder, f'[estimator]\nmethod = "mine.py:{name}"', name=scenario)


def bench_with(folder: Path, code: str) -> Scenario:
    return load_scenario(scenario_with(folder, code, scenario="bench"))


def test_user_estimator_gives_the_bearings(tmp_path: Path) -> None:
    env = PatrolEnv(bench_with(tmp_path, GOOD), full_info=True)
    env.reset(seed=0)
    *_, info = env.step(STAND)
    boresights = env.simulation.array.manifold.boresights_rad
    assert info["pulses"].n_pulses > 0
    assert np.isin(np.round(info["pulses"].azimuth_rad, 9), np.round(boresights, 9)).all()


def test_environment_with_user_estimator_can_be_pickled(tmp_path: Path) -> None:
    env = PatrolEnv(bench_with(tmp_path, GOOD), full_info=True)
    env.reset(seed=0)
    twin = pickle.loads(pickle.dumps(env))
    pulses = [each.step(STAND)[-1]["pulses"] for each in (env, twin)]
    np.testing.assert_array_equal(pulses[0].azimuth_rad, pulses[1].azimuth_rad)


@pytest.mark.parametrize(
    ("broken", "line", "named"),
    [
        ("return found._replace(std_rad=np.hypot(found.std_rad, np.nan))", 8, "std_rad of shape (180,), [nan nan nan]"),
        ("return found._replace(std_rad=-found.std_rad - 1)", 8, "std_rad of shape (180,), [-1. -1. -1.]"),
        ("return type(found)(*(column[1:] for column in found))", 8, "azimuth_rad of shape (179,)"),
        ("return found.azimuth_rad", 8, "expected columns"),
        ("raise RuntimeError('no idea')", 12, "RuntimeError: no idea"),
    ],
)
def test_broken_estimator_is_refused_before_the_start(broken: str, line: int, named: str, tmp_path: Path) -> None:
    code = GOOD.replace("return found._replace(std_rad=np.hypot(found.std_rad, 0.3))", broken)
    with pytest.raises(UserCodeError) as error:
        PatrolEnv(bench_with(tmp_path, code))
    message = str(error.value)
    assert f"mine.py:{line}" in message or "mine.py:5" in message
    assert named in message
    assert "\n" not in message


def test_unknown_estimator_is_refused_with_known_names(tmp_path: Path) -> None:
    with pytest.raises(UserCodeError, match="defines Mine"):
        PatrolEnv(load_scenario(scenario_with(tmp_path, GOOD, "Yours")))
    file = scenario_with(tmp_path, GOOD)
    file.write_text(file.read_text(encoding="utf-8").replace("mine.py:Mine", "mine"), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"estimator\.method: no estimator `mine`; available: maximum_likelihood"):
        load_scenario(file)


LATE = GOOD.replace(
    "        look =", "        if Mine.calls > 40:\n            raise ValueError('tired')\n        look ="
)


def test_late_error_ends_the_mission_with_a_complete_log(tmp_path: Path) -> None:
    log = run_mission(bench_with(tmp_path, LATE), "patrol", seed=0)
    kinds, texts = log.column("event", "kind"), log.column("event", "text")
    assert kinds.tolist()[-2:] == ["error", "end"]
    assert "tired" in texts[-2]
    assert "mine.py:11" in texts[-2]
    assert log.n_rows("step") > 10
