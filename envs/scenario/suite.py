"""The suite: yards that are frozen, so that what two versions of the code make of them can be compared.

`envs/scenarios/suite` holds a public part, for development, and a test part, to be looked at seldom, each with a folder
for every level and in it a file for every yard. A file holds all that a mission meets: yard, map, sources, errors,
receiver, robot and task. What is tested is not in them: estimator and locating are as the code has them, or as a sweep
sets them.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from pdpatrol.envs.scenario.base import ScenarioError

SUITE = Path(__file__).parents[1] / "scenarios" / "suite"
PREFIX = "suite"
PARTS = ("public", "test")


class Suite(NamedTuple):
    """What the suite consists of.

    Attributes:
        version: Changes when yards, sources, errors or seeds do.
        checksum: SHA-256 of the names and contents of all its files, in hexadecimal digits.
        levels: What each level is about, by name, in order.
        seeds: Of the missions in each yard of a part, by the name of the part.
    """

    version: int
    checksum: str
    levels: Mapping[str, str]
    seeds: Mapping[str, range]

    @property
    def label(self) -> str:
        """Version and the beginning of the checksum: what a result says that it was measured on."""
        return f"{self.version}:{self.checksum[:12]}"


class SuiteYard(NamedTuple):
    """A yard of the suite.

    Attributes:
        level: The level that it belongs to.
        part: `public` or `test`.
        path: Its file.
    """

    level: str
    part: str
    path: Path

    @property
    def name(self) -> str:
        """As a command takes it: `suite/weak_03`."""
        return f"{PREFIX}/{self.path.stem}"


@cache
def load_suite() -> Suite:
    """The suite as it is shipped."""
    index: dict[str, Any] = tomllib.loads((SUITE / "suite.toml").read_text(encoding="utf-8"))
    seeds = {part: range(first, last + 1) for part, (first, last) in index["seeds"].items()}
    return Suite(index["version"], checksum(), index["levels"], seeds)


def checksum() -> str:
    """SHA-256 of the names and contents of all yards, in hexadecimal digits."""
    whole = hashlib.sha256()
    for yard in suite_yards():
        whole.update(f"{yard.part}/{yard.path.name}\n".encode() + yard.path.read_bytes())
    return whole.hexdigest()


@cache
def suite_yards() -> tuple[SuiteYard, ...]:
    """All yards, level by level in the order of the index, the public part of each first."""
    levels = tomllib.loads((SUITE / "suite.toml").read_text(encoding="utf-8"))["levels"]
    return tuple(
        SuiteYard(level, part, path)
        for level in levels
        for part in PARTS
        for path in sorted((SUITE / part / level).glob("*.toml"))
    )


def choose_yards(name: str) -> tuple[SuiteYard, ...]:
    """The yards that a name stands for.

    Args:
        name: `suite` for the public part, `suite/LEVEL` for a level of it, `suite/test` and `suite/test/LEVEL` for the
            test part, `suite/LEVEL_NUMBER` for one yard of either.

    Raises:
        ScenarioError: If there are none.
    """
    of_name = [yard for yard in suite_yards() if yard.name == name]
    _, *rest = name.split("/")
    part, levels = ("test", rest[1:]) if rest[:1] == ["test"] else ("public", rest)
    of_part = [yard for yard in suite_yards() if yard.part == part and (not levels or levels == [yard.level])]
    if not (of_name or of_part):
        known = ", ".join(f"{PREFIX}/{level}" for level in load_suite().levels)
        raise ScenarioError(
            [f"{name}: no such part of it; known are {PREFIX}, {PREFIX}/test, {known}, or a yard as {PREFIX}/open_01"]
        )
    return tuple(of_name or of_part)


def is_of_suite(name: str) -> bool:
    """Whether a name, as a command takes it, stands for the suite or a part of it."""
    return name.split("/")[0] == PREFIX and not name.endswith(".toml")
