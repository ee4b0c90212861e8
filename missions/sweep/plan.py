"""What a sweep consists of: scenarios times settings times policies times seeds, each mission with a key of its own."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from dirmusic import InputFileError
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.scenario.suite import choose_yards, is_of_suite, load_suite
from pdpatrol.missions.sweep.code_version import digest_of_code

Settings = Mapping[str, Any]

USUAL_SEEDS = range(20)
"""Of a scenario that is not of the suite."""


class MissionJob(NamedTuple):
    """One mission of a sweep.

    Attributes:
        order: Its number in the sweep, from 0.
        key: Tells it apart from every other mission of the sweep; the same in each run of it.
        level: Of the suite; empty for any other scenario.
        suite: Version and checksum of the suite; empty for any other scenario.
        scenario: What to run, settings included.
        scenario_digest: SHA-256 of the scenario as JSON, in hexadecimal digits.
        policy: Who drives, as `pdpatrol.missions.policies.make_policy` takes it.
        settings: Keys of the scenario that the sweep sets, with their values.
        seed: Of the mission.
    """

    order: int
    key: str
    level: str
    suite: str
    scenario: Scenario
    scenario_digest: str
    policy: str
    settings: Settings
    seed: int


class SweepPlan(NamedTuple):
    """All missions of a sweep, in order.

    Attributes:
        jobs: The missions.
        digest: Changes with any of them, and with any file of the user's that they name.
        code: Changes with any file of this project.
    """

    jobs: tuple[MissionJob, ...]
    digest: str
    code: str

    def shard(self, number: int, n_shards: int) -> tuple[MissionJob, ...]:
        """Part `number`, from 1, of `n_shards` parts; each mission is in exactly one."""
        return self.jobs[number - 1 :: n_shards]


class Choice(NamedTuple):
    """A scenario that a sweep runs.

    Attributes:
        name: As `pdpatrol.envs.load_scenario` takes it.
        level: As of `MissionJob`.
        suite: As of `MissionJob`.
        seeds: Of its missions.
    """

    name: str
    level: str
    suite: str
    seeds: Sequence[int]


def make_plan(
    scenarios: Sequence[str],
    policies: Sequence[str],
    grid: Mapping[str, Sequence[Any]],
    seeds: Sequence[int] | None = None,
) -> SweepPlan:
    """The missions of a sweep: for each scenario and each combination of settings, each policy on each seed.

    Args:
        scenarios: Names of shipped scenarios, paths of TOML files, or the suite and parts of it, as
            `pdpatrol.envs.scenario.suite.choose_yards` takes them.
        policies: Names of policies.
        grid: For each key of the scenario that is set, `table.key`, the values that it takes.
        seeds: Of the missions; None for those of the suite, and for 0 to 19 in any other scenario.

    Raises:
        InputFileError: With all faults, if a scenario cannot be loaded or does not take a setting.
    """
    faults: list[str] = []
    refused: dict[str, list[str]] = {}
    variants: list[tuple[Choice, Scenario, Settings]] = []
    for choice, values in product(_choose(scenarios, seeds, faults), list(product(*grid.values()))):
        settings = dict(zip(grid, values, strict=True))
        try:
            variants.append((choice, load_scenario(choice.name, settings), settings))
        except InputFileError as error:
            for file, _, fault in (line.partition(": ") for line in error.faults):
                refused.setdefault(fault, []).append(file)
    faults += [f"{_files(files)}: {fault}" for fault, files in refused.items()]
    if faults:
        raise InputFileError(faults)
    jobs: list[MissionJob] = []
    for choice, scenario, settings in variants:
        of_scenario = hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()
        for policy in policies:
            named = digest([of_scenario, policy, *digests_of_files(scenario, policy)])
            for seed in choice.seeds:
                key = digest([named, str(seed)])[:16]
                job = MissionJob(
                    order=len(jobs),
                    key=key,
                    level=choice.level,
                    suite=choice.suite,
                    scenario=scenario,
                    scenario_digest=of_scenario,
                    policy=policy,
                    settings=settings,
                    seed=seed,
                )
                jobs.append(job)
    return SweepPlan(tuple(jobs), digest([job.key for job in jobs]), digest_of_code())


def _files(files: Sequence[str]) -> str:
    """The first of some files, and how many there are besides."""
    others = len(set(files)) - 1
    return f"{files[0]}, and {others} more" if others else files[0]


def _choose(scenarios: Sequence[str], seeds: Sequence[int] | None, faults: list[str]) -> Iterator[Choice]:
    """The scenarios that some names stand for; what is wrong with a name joins the faults."""
    for name in scenarios:
        if not is_of_suite(name):
            yield Choice(name, "", "", USUAL_SEEDS if seeds is None else seeds)
            continue
        try:
            yards = choose_yards(name)
        except InputFileError as error:
            faults += error.faults
            continue
        suite = load_suite()
        for yard in yards:
            yield Choice(yard.name, yard.level, suite.label, suite.seeds[yard.part] if seeds is None else seeds)


def parse_grid(texts: Iterable[str]) -> dict[str, list[Any]]:
    """A grid from texts like `receiver.noise_v=5e-4,1e-3`; values are TOML, and what is none is taken as a text.

    Raises:
        InputFileError: If a text is of another form, or a key comes twice.
    """
    grid: dict[str, list[Any]] = {}
    faults: list[str] = []
    for text in texts:
        key, equals, values = text.partition("=")
        if not equals or not values or not all(key.split(".")):
            faults.append(f"--set: got {text!r}; allowed is key=value,value,... like receiver.noise_v=5e-4,1e-3")
        elif key in grid:
            faults.append(f"--set: {key} comes twice; allowed is once, with all its values")
        else:
            grid[key] = _values(values)
    if faults:
        raise InputFileError(faults)
    return grid


def _values(text: str) -> list[Any]:
    """Values between commas; commas within brackets, braces or quotes are part of a value."""
    try:
        return list(tomllib.loads(f"values = [{text}]")["values"])
    except tomllib.TOMLDecodeError:
        return [_value(part.strip()) for part in text.split(",")]


def _value(text: str) -> Any:  # noqa: ANN401 - TOML holds values of many types
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def digest(texts: Iterable[str]) -> str:
    """SHA-256 of some texts, in hexadecimal digits."""
    return hashlib.sha256(json.dumps(list(texts)).encode()).hexdigest()


def digests_of_files(scenario: Scenario, policy: str) -> list[str]:
    """SHA-256 of the contents of all files of the user's that a scenario and a policy name."""
    own = scenario.array.pattern, scenario.array.true_pattern, scenario.robot.model
    code = policy, scenario.estimator.method, scenario.locating.locator
    names = [name for name in own if name] + [name.rpartition(":")[0] for name in code if name and ":" in name]
    return [hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in names if Path(name).is_file()]
