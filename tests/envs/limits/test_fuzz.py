"""Whatever a file says, it is refused in clear lines, or it runs: no traceback, no warning, no number that is none."""

import dataclasses
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario import Scenario, ScenarioError, load_scenario
from tests.envs.limits.drawn_scenarios import SHIPPED_TABLES, SMALL, as_toml, mutated, sensible

N_STEPS = 20
CODE = ("tuple[", "literal[", "_shape_of", "instance of", "constrained", "Config", "Equipment", "Traceback", "pydantic")
SHIPPED_ONES = st.sampled_from(SHIPPED_TABLES)
ANY = st.one_of(
    sensible(), sensible(), sensible(SHIPPED_ONES), mutated(st.just(SMALL)), mutated(sensible()), mutated(SHIPPED_ONES)
)
CHECKS = [
    HealthCheck.too_slow,
    HealthCheck.data_too_large,
    HealthCheck.function_scoped_fixture,
    HealthCheck.large_base_example,
]


def numbers(value: Any) -> Iterator[Any]:  # noqa: ANN401 - whatever an environment returns
    """All numbers in what an environment returns."""
    if isinstance(value, dict):
        for inner in value.values():
            yield from numbers(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from numbers(inner)
    elif dataclasses.is_dataclass(value):
        yield from numbers(vars(value))
    elif isinstance(value, int | float | np.ndarray | np.generic) and np.asarray(value).dtype.kind in "fiub":
        yield value


def run(scenario: Scenario) -> None:
    env = PatrolEnv(scenario)
    rng = np.random.default_rng(0)
    observation, info = env.reset(seed=0)
    for _ in range(N_STEPS):
        assert all(np.isfinite(number).all() for number in numbers([observation, info]))
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1.0, 1.0, 2).astype(np.float32))
        assert np.isfinite(reward)
        if terminated or truncated:
            break
    env.close()


def refused_or_run(table: dict[str, Any], folder: Path) -> None:
    file = folder / "drawn.toml"
    file.write_text(as_toml(table), encoding="utf-8")
    try:
        scenario = load_scenario(file)
    except ScenarioError as error:
        for fault in error.faults:
            assert fault.startswith(f"{file}: ")
            assert fault.isprintable()
            assert len(fault) < 1000
            assert not any(word in fault.removeprefix(str(file)) for word in CODE), fault
        return
    if scenario.route.waypoints_m == "planned":
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(scenario)


@settings(max_examples=200, deadline=None, derandomize=True, suppress_health_check=CHECKS)
@given(table=ANY)
def test_a_scenario_is_refused_in_clear_lines_or_runs(table: dict[str, Any], tmp_path: Path) -> None:
    refused_or_run(table, tmp_path)


@pytest.mark.slow
@settings(max_examples=5000, deadline=None, suppress_health_check=CHECKS)
@given(table=ANY)
def test_five_thousand_scenarios_are_refused_in_clear_lines_or_run(table: dict[str, Any], tmp_path: Path) -> None:
    refused_or_run(table, tmp_path)
