"""Suite: a frozen set of yards on which versions of the code are compared.

`envs/scenarios/suite` holds a public part for development and a test part that should be used rarely. Each part has a
folder per level, with one file per yard. A file sets the yard, map, sources, errors, receiver, robot and task. The
estimator and the Locator are under test: they use the defaults of the code or the settings of a sweep.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from pdpatrol.envs.scenario.base import ScenarioError, meant

SUITE = Path(__file__).parents[1] / "scenarios" / "suite"


class Suite(NamedTuple):
    """Index of the suite.

    Attributes:
        version: Version number, which changes whenever the yards, sources, errors or seeds do.
        checksum: SHA-256 of the names and contents of all files, in hexadecimal digits.
        levels: Description of each level by name, in order.
        sites: Names of the levels of substations. Only their own names choose them, as their missions take minutes.
        seeds: Seeds of the missions in each yard, by part.
        yards: All yards, level by level, with the public part of each level first.
    """

    version: int
    checksum: str
    levels: Mapping[str, str]
    sites: tuple[str, ...]
    seeds: Mapping[str, range]
    yards: tuple[SuiteYard, ...]

    @property
    def label(self) -> str:
        """Version and the first digits of the checksum, as recorded in results."""
        return f"{self.version}:{self.checksum[:12]}"


class SuiteYard(NamedTuple):
    """Yard of the suite.

    Attributes:
        level: Level of the yard.
        part: Part of the suite, `public` or `test`.
        path: Scenario file of the yard.
        seeds: Seeds of the missions in it.
    """

    level: str
    part: str
    path: Path
    seeds: range

    @property
    def name(self) -> str:
        """Name on the command line, such as `suite/weak_03`."""
        return f"suite/{self.path.stem}"


@cache
def load_suite() -> Suite:
    """Load the index of the suite."""
    index: dict[str, Any] = tomllib.loads((SUITE / "suite.toml").read_text(encoding="utf-8"))
    seeds = {part: range(first, last + 1) for part, (first, last) in index["seeds"].items()}
    levels: dict[str, str] = index["levels"] | index["sites"]
    n_seeds = dict.fromkeys(index["sites"], index["seeds_of_sites"])
    yards = tuple(
        SuiteYard(level, part, path, seeds[part][: n_seeds.get(level)])
        for level in levels
        for part in seeds
        for path in sorted((SUITE / part / level).glob("*.toml"))
    )
    digest = hashlib.sha256()
    for yard in yards:
        digest.update(f"{yard.part}/{yard.path.name}\n".encode() + yard.path.read_bytes())
    return Suite(index["version"], digest.hexdigest(), levels, tuple(index["sites"]), seeds, yards)


def choose_yards(name: str) -> tuple[SuiteYard, ...]:
    """List the yards that a name on the command line refers to.

    Args:
        name: `suite` for the public part without the substations, `suite/LEVEL` for one of its levels, `suite/test` and
            `suite/test/LEVEL` for the same of the test part, `suite/LEVEL_NUMBER` for one yard of either part.

    Raises:
        ScenarioError: If the name matches no yard.
    """
    suite, (_, *rest) = load_suite(), name.split("/")
    part, levels = ("test", rest[1:]) if rest[:1] == ["test"] else ("public", rest)
    chosen = tuple(
        yard
        for yard in suite.yards
        if yard.name == name
        or (yard.part == part and levels == [yard.level])
        or (yard.part == part and not levels and yard.level not in suite.sites)
    )
    if not chosen:
        known = [f"suite/{level}" for level in suite.levels]
        hint = meant([*known, *(yard.name for yard in suite.yards)], name)
        hint = hint or f"; available: suite, suite/test, {', '.join(known)}, suite/open_01 and so on"
        raise ScenarioError([f"{name}: no such part of the suite{hint}"])
    return chosen


def is_of_suite(name: str) -> bool:
    """Return whether a name on the command line refers to the suite or a part of it."""
    return name.split("/")[0] == "suite" and not name.endswith(".toml")
