"""Calls of any kind in any order: the right behaviour or a clear error, and what is refused changes nothing."""

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

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv
from tests.envs.calls.drawn_calls import MASK, N_ROBOTS, Call, listed, sequences

ROOT = Path(__file__).parents[3]
N_QUICK, N_SLOW = 20, 300


def short() -> Scenario:
    """Episodes of three steps."""
    scenario = load_scenario("one_source")
    return scenario.model_copy(update={"task": scenario.task.model_copy(update={"time_limit_s": 0.3})})


def sent(env: Any, name: str, arguments: tuple[Any, ...]) -> Any:  # noqa: ANN401
    if name == "reset":
        seed, options = arguments
        return env.reset(seed=seed, options=options)
    return getattr(env, name)(*arguments)


class State:
    """What the environment must refuse, by what it was told until now."""

    def __init__(self, env: Any, twin: Any, mode: AutoresetMode | None) -> None:  # noqa: ANN401
        self.env, self.twin, self.mode = env, twin, mode
        self.is_closed, self.has_begun, self.is_over = False, False, np.zeros(1, np.bool_)

    def refusal(self, call: Call) -> tuple[type[Exception], ...]:
        """What a call may raise: of several faults any; nothing if it is right."""
        if self.is_closed:
            return (error.ClosedEnvironmentError,)
        found = [] if call.is_good else [ValueError]
        if call.name == "step":
            is_early = not self.has_begun or (self.mode is AutoresetMode.DISABLED and self.is_over.any())
        else:
            options = call.arguments[1].meaning
            mask = np.ones(1) if options is None else options.value.get(MASK, np.ones(1))
            is_early = not (self.has_begun or mask.all())
        return (*found, error.ResetNeeded) if is_early else tuple(found)

    def try_out(self, call: Call) -> None:
        if call.name == "np_random_seed":
            np.testing.assert_equal(np.array(self.env.np_random_seed).size, 1 if self.mode is None else N_ROBOTS)
            return
        if call.name == "close":
            self.env.close()
            self.env.close()
            self.is_closed = True
            return
        wrong = self.refusal(call)
        if wrong:
            with pytest.raises(wrong) as raised:
                sent(self.env, call.name, call.given)
            assert len(str(raised.value)) > 15
            return
        told = sent(self.env, call.name, call.given)
        arguments = call.meaning
        if call.name == "reset" and not self.has_begun:
            drawn = self.env.np_random_seed
            arguments = (drawn if self.mode is None else list(drawn)), arguments[1]
        expected = sent(self.twin, call.name, arguments)
        np.testing.assert_equal(listed(told), listed(expected))
        self.has_begun = True
        assert told[0] in self.env.observation_space
        for key, value in told[-1].items():
            is_plain = key.startswith(("final", "_final")) or isinstance(value, (bool, float, np.ndarray))
            assert is_plain, f"{key}: {value!r}"
        if call.name == "step":
            self.is_over = np.asarray(told[2]) | np.asarray(told[3])
        else:
            self.is_over = np.asarray(self.is_over) & ~np.asarray(arguments[1].get(MASK, True))


def play(sequence: list[Call], mode: AutoresetMode | None) -> None:
    """One environment is called as drawn, its twin with what that means, and only where it is allowed."""
    env, twin = (PatrolEnv(short()) if mode is None else many(mode) for _ in range(2))
    state = State(env, twin, mode)
    for call in sequence:
        state.try_out(call)


def many(mode: AutoresetMode) -> PatrolVectorEnv:
    return PatrolVectorEnv(N_ROBOTS, short(), num_threads=1, autoreset_mode=mode)


def fuzz(n: int) -> None:
    """So many sequences for the single environment, and as many for the vector environment."""
    often = settings(max_examples=n, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    often(given(sequences((2,)))(lambda sequence: play(sequence, None)))()
    often(given(sequences((N_ROBOTS, 2)), st.sampled_from(AutoresetMode))(play))()


def test_any_call_in_any_order_is_understood_or_refused_and_what_is_refused_changes_nothing() -> None:
    fuzz(N_QUICK)


@pytest.mark.slow
def test_so_are_many_more_with_checked_bounds_in_compiled_loops(tmp_path: Path) -> None:
    """In a process of its own: compiled code with checks has a cache of its own."""
    environment = os.environ | {
        "NUMBA_BOUNDSCHECK": "1",
        "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]),
    }
    words = [sys.executable, "-W", "error", __file__, str(N_SLOW)]
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr[-3000:]


if __name__ == "__main__":
    fuzz(int(sys.argv[1]))
