"""Hostile scenario files are refused with clear errors, or run without warnings and with finite numbers."""

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
from tests.envs.scenario.drawn_scenarios import SHIPPED_TABLES, SMALL, as_toml, mutated

NAMES_OF_CODE = ("tuple[", "literal[", "_shape_of", "instance of", "constrained", "Equipment", "Traceback", "pydantic")
CHECKS = [
    HealthCheck.too_slow,
    HealthCheck.data_too_large,
    HealthCheck.function_scoped_fixture,
    HealthCheck.large_base_example,
]
SCENARIOS = mutated(st.just(SMALL)) | mutated(st.sampled_from(SHIPPED_TABLES))


def numbers(value: object) -> Iterator[Any]:
    """Yield all numbers in a result of an environment."""
    if isinstance(value, dict):
        value = list(value.values())
    if dataclasses.is_dataclass(value):
        value = list(vars(value).values())
    if isinstance(value, list | tuple):
        for inner in value:
            yield from numbers(inner)
    elif isinstance(value, int | float | np.ndarray | np.generic) and np.asarray(value).dtype.kind in "fiub":
        yield value


def run(scenario: Scenario) -> None:
    env, rng = PatrolEnv(scenario), np.random.default_rng(0)
    observation, info = env.reset(seed=0)
    for _ in range(20):
        assert all(np.isfinite(number).all() for number in numbers([observation, info]))
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1.0, 1.0, 2).astype(np.float32))
        assert np.isfinite(reward)
        if terminated or truncated:
            break
    env.close()


def refused_or_run(file: Path) -> None:
    try:
        scenario = load_scenario(file)
    except ScenarioError as error:
        for line in error.faults:
            assert line.startswith(f"{file}: ")
            assert line.isprintable()
            assert len(line) < 1000
            assert not any(word in line.removeprefix(str(file)) for word in NAMES_OF_CODE), line
        return
    if scenario.route.waypoints_m != "planned":
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run(scenario)


@pytest.mark.parametrize("n", [pytest.param(150, marks=pytest.mark.whole), pytest.param(5000, marks=pytest.mark.slow)])
def test_scenario_is_refused_or_runs(n: int, tmp_path: Path) -> None:
    @settings(max_examples=n, deadline=None, derandomize=n < 1000, suppress_health_check=CHECKS)
    @given(table=SCENARIOS)
    def check(table: dict[str, Any]) -> None:
        file = tmp_path / "drawn.toml"
        file.write_text(as_toml(table), encoding="utf-8")
        refused_or_run(file)

    check()


@settings(max_examples=60, deadline=None)
@given(noise=st.binary(max_size=60))
def test_random_bytes_are_refused_or_run(noise: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    text = as_toml(SMALL).encode()
    file = tmp_path_factory.mktemp("noise") / "yard.toml"
    file.write_bytes(text[:400] + noise + text[400:])
    refused_or_run(file)
