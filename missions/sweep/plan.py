"""Plan of a sweep: scenarios times settings times policies times seeds, one job for each mission."""

import hashlib
import json
import subprocess
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from dirmusic import InputFileError
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.scenario.suite import choose_yards, is_of_suite, load_suite
from pdpatrol.missions.policies.make_policy import load_maker

ROOT = Path(__file__).parents[3]


class MissionJob(NamedTuple):
    """One mission of a sweep.

    Attributes:
        order: Number of the mission in the sweep, from 0.
        key: Identifier of the mission, the same in each run of the sweep.
        level: Level of the suite; empty for any other scenario.
        suite: Version and checksum of the suite; empty for any other scenario.
        scenario: Scenario with its settings.
        scenario_digest: SHA-256 of the scenario as JSON, in hexadecimal digits.
        policy: Name of the policy, as `pdpatrol.missions.policies.make_policy` accepts it.
        settings: Keys of the scenario that the sweep sets, with their values.
        seed: Seed of the mission.
    """

    order: int
    key: str
    level: str
    suite: str
    scenario: Scenario
    scenario_digest: str
    policy: str
    settings: Mapping[str, Any]
    seed: int


class SweepPlan(NamedTuple):
    """All missions of a sweep, in order.

    Attributes:
        jobs: The missions.
        digest: Digest of all missions and of the user's files that they name.
    """

    jobs: tuple[MissionJob, ...]
    digest: str


def make_plan(
    scenarios: Sequence[str],
    policies: Sequence[str],
    grid: Mapping[str, Sequence[Any]],
    seeds: Sequence[int] | None = None,
) -> SweepPlan:
    """Plan a sweep: for each scenario and each combination of settings, each policy with each seed.

    Args:
        scenarios: Names of shipped scenarios, paths of TOML files, or the suite and parts of it, as
            `pdpatrol.envs.scenario.suite.choose_yards` accepts them.
        policies: Names of policies, or the user's own as my_file.py:MyPolicy.
        grid: Values of each key of the scenario, `table.key`, that the sweep sets.
        seeds: Seeds of the missions; None for those of the suite, and for 0 to 19 in any other scenario.

    Raises:
        UserCodeError: If a policy cannot be loaded.
        InputFileError: With all errors, if a scenario cannot be loaded, or a setting is invalid.
    """
    errors: dict[str, str] = {}  # keys omit the file, so that an error in many yards is one line
    for policy in set(policies):
        load_maker(policy)
    suite = load_suite()
    chosen: list[tuple[str, str, str, Sequence[int]]] = []
    for name in scenarios:
        if is_of_suite(name):
            chosen += [(yard.name, yard.level, suite.label, yard.seeds) for yard in choose_yards(name)]
        else:
            chosen.append((name, "", "", range(20)))
    jobs: list[MissionJob] = []
    for (name, level, label, usual_seeds), values in product(chosen, list(product(*grid.values()))):
        settings = dict(zip(grid, values, strict=True))
        try:
            scenario = load_scenario(name, settings)
        except InputFileError as error:
            for fault in error.faults:
                errors.setdefault(fault.partition(": ")[2], fault)
            continue
        scenario_digest = hashlib.sha256(scenario.model_dump_json().encode()).hexdigest()
        for policy in policies:
            named = digest([scenario_digest, policy, *digests_of_files(scenario, policy)])
            for seed in usual_seeds if seeds is None else seeds:
                job = MissionJob(
                    order=len(jobs),
                    key=digest([named, str(seed)])[:16],
                    level=level,
                    suite=label,
                    scenario=scenario,
                    scenario_digest=scenario_digest,
                    policy=policy,
                    settings=settings,
                    seed=seed,
                )
                jobs.append(job)
    if errors:
        raise InputFileError(list(errors.values()))
    return SweepPlan(tuple(jobs), digest([job.key for job in jobs]))


def parse_grid(texts: Iterable[str]) -> dict[str, list[Any]]:
    """Parse settings such as `receiver.noise_v=5e-4,1e-3`; values that are not TOML are strings.

    Raises:
        InputFileError: If a text has another form, or a key is given twice.
    """
    grid: dict[str, list[Any]] = {}
    errors: list[str] = []
    for text in texts:
        key, _, values = text.partition("=")
        if not values or not all(key.split(".")):
            errors.append(f"--set: must be key=value,value,... such as receiver.noise_v=5e-4,1e-3, got {text!r}")
        elif key in grid:
            errors.append(f"--set: {key} must be given once with all its values, got it twice")
        else:
            # Commas within brackets, braces and quotes belong to a value.
            listed = parse_toml(f"[{values}]", None)
            grid[key] = [parse_toml(part, part.strip()) for part in values.split(",")] if listed is None else listed
    if errors:
        raise InputFileError(errors)
    return grid


def parse_toml(text: str, default: object) -> Any:  # noqa: ANN401 - TOML has values of many types
    """Parse one value of TOML, or return the default if it is not valid TOML."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return default


def digest(texts: Iterable[str]) -> str:
    """Return the SHA-256 of some texts, in hexadecimal digits."""
    return hashlib.sha256(json.dumps(list(texts)).encode()).hexdigest()


def digests_of_files(scenario: Scenario, policy: str) -> list[str]:
    """Return the SHA-256 of each of the user's files that a scenario or a policy names."""
    data = scenario.array.pattern, scenario.nature.array.pattern, scenario.robot.model
    code = policy, scenario.estimator.method, scenario.locating.locator
    names = [*filter(None, data), *(name.rpartition(":")[0] for name in code if name and ":" in name)]
    return [hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in names if Path(name).is_file()]


@cache
def digest_of_code() -> str:
    """Return the SHA-256 of names and contents of all files of this project that a mission may depend on."""
    total = hashlib.sha256()
    for package in ("dirmusic", *(f"pdpatrol/{room}" for room in ("sensing", "robot_models", "envs", "missions"))):
        for path in sorted(path for path in (ROOT / package).rglob("*") if path.suffix in (".py", ".toml", ".xml")):
            total.update(f"{path.relative_to(ROOT).as_posix()}\0{path.stat().st_size}\0".encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def commit() -> str:
    """Return the commit that is checked out, with `+` if files differ from it; empty outside a repository."""
    command = ["git", "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+"]
    try:
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
