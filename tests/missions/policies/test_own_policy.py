"""Policies from user code: their input, and their errors."""

from pathlib import Path

import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report, report_text
from pdpatrol.missions.runner import Mission, run_mission

POLICIES = """
import sys
import numpy as np
from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.patrol import Patrol

class Still:
    def __init__(self, rng):
        self.n_calls = 0
    def __call__(self, observation, findings, site_map):
        self.n_calls += 1
        return self.answer()
    def answer(self):
        return [0, 0]

class Draws:
    def __init__(self, rng):
        self.rng = rng
    def __call__(self, observation, findings, site_map):
        return self.rng.uniform(-1, 1, 2)

class Fails(Still):
    def answer(self):
        if self.n_calls == 20:
            raise ValueError("out of\\nideas")  # at Fails
        return 0.5, 0.1

class FailsAtOnce(Still):
    def __init__(self, rng):
        raise KeyError("weights")  # at FailsAtOnce

class Leaves(Still):
    def answer(self):
        sys.exit()  # at Leaves

class Three(Still):  # at Three
    def answer(self):
        return [0.1, 0.2, 0.3]

class NotANumber(Still):  # at NotANumber
    def answer(self):
        return np.array([0.1, np.nan])

class TooFast(Still):  # at TooFast
    def answer(self):
        return 1.5, 0.0

class NoPhase(Still):  # at NoPhase
    phase = 3

class NoNumbers(Still):  # at NoNumbers
    unreachable = ["waypoint 2"]

class Silent:  # at Silent
    def __init__(self, rng):
        pass

def guarded(rng):
    return CollisionGuard(Patrol())

def guarded_three(rng):
    return CollisionGuard(Three(rng))

class Ends(Still):
    phase, unreachable = "give up", np.array([2])
    def answer(self):
        return None if self.n_calls > 5 else (0.0, 0.0)

class Spies(Still):
    def reveal(self, truth):
        self.phase = truth["sources"][0]["name"]
        truth["sources"] = None

class SpiesInVain(Still):
    def reveal(self, truth):
        raise RuntimeError("no")  # at SpiesInVain

number = 3
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "my.py"
    path.write_text(POLICIES.lstrip("\n"), encoding="utf-8")
    return path


def short(time_limit_s: float = 3.0) -> Scenario:
    return load_scenario("one_source", {"task.time_limit_s": time_limit_s})


def says(error: UserCodeError | None, message: str, name: str, path: Path) -> bool:
    """Return True if an error is one line that starts with `message`, with the line number of the policy's mark."""
    (line,) = str(error).splitlines()
    marked = [n for n, text in enumerate(path.read_text().splitlines(), start=1) if text.endswith(f"# at {name}")]
    return line.startswith(message.replace("my.py", str(path)).replace(":LINE:", f":{(marked or [0])[0]}:"))


ACTION = "expected an action of 2 finite numbers in [-1, 1], or None to end the mission"


@pytest.mark.parametrize(
    ("name", "message", "n_steps"),
    [
        ("Fails", f"my.py:LINE: ValueError: out of ideas; {ACTION}", 19),
        ("Leaves", f"my.py:LINE: SystemExit; {ACTION}", 0),
        ("NotANumber", f"my.py:LINE: returned array([0.1, nan]); {ACTION}", 0),
        ("TooFast", f"my.py:LINE: returned (1.5, 0.0); {ACTION}", 0),
        ("guarded_three", f"my.py:LINE: returned [0.1, 0.2, 0.3]; {ACTION}", 0),
    ],
)  # fmt: skip
def test_failing_policy_ends_mission_with_complete_log(name: str, message: str, n_steps: int, file: Path) -> None:
    mission = Mission(short(), f"{file}:{name}", 0)
    log = mission.run()
    assert says(mission.error, message, name.replace("guarded_three", "Three"), file), mission.error
    assert log.n_rows("step") == n_steps
    assert log.column("event", "kind")[-2:].tolist() == ["error", "end"]
    assert log.column("event", "text")[-2:].tolist() == [str(mission.error), "mission over: error"]
    Report.model_validate_json(report_text(make_report(log, 0.0)))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("FailsAtOnce", "my.py:LINE: KeyError: 'weights'; expected seek, active"),
        ("Silent", "my.py:LINE: TypeError: makes a Silent, which cannot be called; expected"),
        ("NoPhase", "my.py:LINE: TypeError: its `phase` is 3; expected a `phase` of a word or two"),
        ("NoNumbers", "my.py:LINE: TypeError: 'str' object cannot be interpreted as an integer; expected a `phase`"),
        ("number", "int: TypeError: 'int' object is not callable; expected"),
        ("SpiesInVain", "my.py:LINE: RuntimeError: no; expected"),
        ("Nobody", "my.py: must define `Nobody`, defines Still, Draws, Fails"),
    ],
)
def test_invalid_policy_is_refused_before_the_start(name: str, message: str, file: Path) -> None:
    with pytest.raises(UserCodeError) as refused:
        Mission(short(), f"{file}:{name}", 0)
    assert says(refused.value, message, name, file), refused.value


def test_policy_generator_depends_on_the_seed(file: Path) -> None:
    first, again, other = (
        run_mission(short(1.0), f"{file}:Draws", seed).column("step", "command") for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_policy_can_end_the_mission(file: Path) -> None:
    log = run_mission(short(), f"{file}:Ends")
    assert log.n_rows("step") == 5
    assert set(log.column("step", "phase")) == {"give up"}
    assert log.column("event", "text").tolist() == ["gave up waypoint 2", "mission over: policy done"]


def test_guarded_own_policy_equals_built_in_one(file: Path) -> None:
    own, built_in = (run_mission(short(8.0), name) for name in (f"{file}:guarded", "patrol"))
    for column in ("true_pose", "phase"):
        np.testing.assert_array_equal(own.column("step", column), built_in.column("step", column))


def test_guard_accepts_policy_without_phase() -> None:
    class Bare:
        def __call__(self, observation: object, findings: object, site_map: object) -> None:
            return None

    guard = CollisionGuard(Bare())
    assert (guard.phase, guard.unreachable) == (Phase("Bare"), ())
    assert CollisionGuard(Patrol()).phase == Phase("patrol")


def test_policy_with_reveal_gets_a_copy_of_the_truth(file: Path) -> None:
    mission = Mission(short(), f"{file}:Spies", 0)
    (source,) = mission.log.meta["truth"]["sources"]
    mission.step()
    assert mission.policy.phase.name == source["name"]
