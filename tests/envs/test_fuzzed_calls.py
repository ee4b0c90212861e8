"""Calls in any order give equal results in two environments, and refused calls change nothing."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium import error
from gymnasium.vector import AutoresetMode
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv
from tests.envs.helpers import listed

ROOT = Path(__file__).parents[2]
N_ROBOTS = 3
POSE, PLACE = (8.0, 6.0, 0.5), (20.0, 6.0, 1.5)
OPTIONS = ({}, None, {"start_pose": np.array(POSE, np.float32)}, {"sources": {"discharge": list(PLACE)}})
BAD_ACTIONS = (None, "ahead", 1.0, {}, [], b"ab", object(), np.full((N_ROBOTS, 2), np.nan), np.array([np.inf, 0.0]))
BAD_SEEDS = (-1, np.int64(-7), 1.0, "x", b"5", {}, 1j)
BAD_OPTIONS = (
    5, "x", ["start_pose"], {"pose": POSE}, {"start_pose": "here"}, {"start_pose": (8.0, 6.0)},
    {"start_pose": (8.0, 6.0, np.nan)}, {"start_pose": (1e300, 6.0, 0.0)}, {"start_pose": (-3.0, 1.0, 0.0)},
    {"sources": 5}, {"sources": {"other": PLACE}}, {"sources": {"discharge": None}},
    {"sources": {"discharge": "nowhere"}}, {"sources": {"discharge": (20.0, 6.0, -1.0)}},
    {"sources": {"discharge": (20.0, 6.0, 1e300)}},
)  # fmt: skip
BAD_MASKS = (None, 1, "all", [1, 0, 1], np.ones(2, np.bool_), np.zeros(N_ROBOTS, np.bool_))

Call = tuple[str, dict[str, Any]]


def calls(shape: tuple[int, ...]) -> st.SearchStrategy[list[Call]]:
    """Draw lists of valid and invalid calls for an environment with actions of the given shape."""
    dtypes = st.sampled_from([np.float16, np.float32, np.float64])
    actions = dtypes.flatmap(lambda dtype: arrays.arrays(dtype, shape, elements=st.floats(-3, 3, width=16)))
    seeds, options = st.none() | st.integers(0, 2**40), st.sampled_from(OPTIONS)
    bad_options = [{"options": each} for each in BAD_OPTIONS]
    if len(shape) == 2:
        masks = arrays.arrays(np.bool_, N_ROBOTS).filter(np.any)
        options |= st.builds(lambda others, mask: (others or {}) | {"reset_mask": mask}, options, masks)
        bad_options += [{"options": {"reset_mask": each}} for each in BAD_MASKS]
    step, reset = st.fixed_dictionaries({"action": actions}), st.fixed_dictionaries({"seed": seeds, "options": options})
    bad_resets = st.sampled_from([*({"seed": each} for each in BAD_SEEDS), *bad_options])
    return st.lists(
        st.tuples(st.just("step"), step)
        | st.tuples(st.just("reset"), reset)
        | st.tuples(st.just("refused step"), st.sampled_from([{"action": each} for each in BAD_ACTIONS]))
        | st.tuples(st.just("refused reset"), bad_resets),
        max_size=12,
    )


def send(env: Any, name: str, arguments: dict[str, Any]) -> Any:  # noqa: ANN401 - either environment
    return env.step(arguments["action"]) if name == "step" else env.reset(**arguments)


def play(sequence: list[Call], mode: AutoresetMode | None) -> None:
    """Send all calls to one environment and only the valid ones to its twin."""
    short = load_scenario("one_source", {"task.time_limit_s": 0.3})
    env, twin = (
        PatrolEnv(short) if mode is None else PatrolVectorEnv(N_ROBOTS, short, num_threads=1, autoreset_mode=mode)
        for _ in range(2)
    )
    is_over = np.zeros(1, dtype=np.bool_)
    for name, arguments in [("reset", {"seed": 7}), *sequence]:
        if name.startswith("refused"):
            with pytest.raises((ValueError, TypeError, error.Error), match=r".{15}"):
                send(env, name.removeprefix("refused "), arguments)
        elif name == "step" and mode is AutoresetMode.DISABLED and is_over.any():
            with pytest.raises(error.ResetNeeded):
                env.step(arguments["action"])
        else:
            result, expected = (send(each, name, arguments) for each in (env, twin))
            np.testing.assert_equal(listed(result), listed(expected))
            assert result[0] in env.observation_space
            if name == "step":
                is_over = np.asarray(result[2]) | np.asarray(result[3])
            else:
                is_over = is_over & ~np.asarray((arguments.get("options") or {}).get("reset_mask", True))


def fuzz(n: int) -> None:
    often = settings(max_examples=n, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    often(given(calls((2,)))(lambda sequence: play(sequence, None)))()
    often(given(calls((N_ROBOTS, 2)), st.sampled_from(AutoresetMode))(play))()


def test_calls_in_any_order_equal_those_of_a_twin() -> None:
    fuzz(12)


@pytest.mark.slow
def test_calls_in_any_order_keep_array_bounds(tmp_path: Path) -> None:
    """Compiled loops check array bounds, in a process with its own cache of compiled code."""
    environment = os.environ | {
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]),
    }
    words = [sys.executable, "-W", "error", __file__, "300"]
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr[-3000:]


if __name__ == "__main__":
    fuzz(int(sys.argv[1]))
