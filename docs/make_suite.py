"""Make the yards of the levels that version 2 of the suite added, each from a yard of version 1.

uv run python docs/make_suite.py            # all of these levels
uv run python docs/make_suite.py mismatch   # one of them

A new yard differs from its base in the tables that its level is about; missions in both can be compared in pairs.
Yards of the public part are made from those of the public part, yards of the test part from those of the test part.
The script ends with an error if a source could not be found; see `check_sources`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import tomlkit

from dirmusic.angles import aperture
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.scenario.suite import SUITE, choose_yards, load_suite
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION, SiteMap
from pdpatrol.missions.planning.detectability import MARGIN_DB, DirectPaths
from pdpatrol.missions.planning.tour import ShortestTours

PARTS = {"public": 1, "test": 51}
"""Number of the first yard of each level, by part."""

SEEN_FROM_M = (2.0, 8.0)
"""Range of distances from which a source must be detectable."""

SEEN_OVER_RAD = np.radians(40.0)
"""Angle, seen from the source, over which the places that detect it must spread."""

Change = tuple[str, dict[str, Any]]
"""Name of a yard of version 1, and the tables to replace or add."""

Bases = Sequence[tuple[str, Sequence[int]]]
"""Levels of version 1 and numbers of the yards in each, from 0."""


def bases(part: str, levels: Bases) -> list[str]:
    """Return the names of some yards of version 1."""
    return [f"suite/{level}_{PARTS[part] + k:02}" for level, numbers in levels for k in numbers]


ANTENNAS = (
    {"pattern": "helix"},
    {"beam_width_scale": 0.85},
    {"beam_width_scale": 1.05},
    {"pattern": "helix_in_ring"},
    {"beam_width_scale": 0.95},
    {"beam_width_scale": 1.15},
)


def mismatch(part: str, rng: np.random.Generator) -> Iterator[Change]:
    """Make yards with another antenna than that of the data sheet: every one in all three kinds of base.

    Every third mount is turned or tilted by 1 to 2 degrees.
    """
    names = bases(part, [("cluttered", (2, 6, 10)), ("several", (0, 3, 6)), ("high", (1, 4, 7))])
    is_test = part == "test"
    for k, name in enumerate(names):
        array: dict[str, Any] = dict(ANTENNAS[(k + 3 * is_test) % 6])
        angle_deg = round(float(rng.uniform(1.0, 2.0) * rng.choice([-1.0, 1.0])), 2)
        if k % 8 == 4 * is_test:
            array |= {"mount_yaw_deg": angle_deg}
        elif k % 4 == 0:
            azimuth_deg = float(rng.integers(360))
            array |= {"mount_tilt_deg": abs(angle_deg), "mount_tilt_azimuth_deg": azimuth_deg}
        yield name, {"nature": {"array": array}}


LEVELS: Mapping[str, Callable[[str, np.random.Generator], Iterator[Change]]] = {"mismatch": mismatch}
"""Functions that make the yards of one part of a level."""


def check_sources(scenario: Scenario) -> None:
    """Check that each source can be found at its lowest amplitude, wherever it may be.

    It is detectable, in direct sight, from reachable ground 2 to 8 m away over an angle of at least 40 degrees, and
    from somewhere on the shortest path past the waypoints.

    Raises:
        ValueError: If a source is not.
    """
    site_map = SiteMap(scenario, scenario.yard)
    reachable = np.flatnonzero(np.isfinite(site_map.reach(scenario.route.dock_m).length_m))
    route = ShortestTours(site_map).in_order([site_map.cell(stop_m) for stop_m in scenario.route.stops_m])
    # The margin also covers the narrowest beam, whose gain between two elements is 1.4 dB lower.
    direct = DirectPaths(scenario.nature.array.applied_to(scenario.array), scenario.receiver, site_map.sight)
    for source in scenario.sources:
        amplitude_v = source.amplitude_v * 10 ** (-source.amplitude_range_db / 40)
        sites_m = [scenario.yard.site_position(site) for site in scenario.candidate_sites(source)]
        for place_m in sites_m or [np.array(source.position_m)]:
            cells = np.unique(np.concatenate([reachable, route.cells]))
            away_m = site_map.centres_m[cells] - place_m[:2]
            range_m = np.hypot(*away_m.T)
            transmission, level_db = direct.levels(site_map.centres_m[cells], place_m, amplitude_v)
            detects = (transmission >= MIN_TRANSMISSION) & (level_db >= MARGIN_DB)
            near = detects & (range_m >= SEEN_FROM_M[0]) & (range_m <= SEEN_FROM_M[1])
            seen_rad = aperture(np.arctan2(*away_m[near].T[::-1]))
            if seen_rad < SEEN_OVER_RAD or not np.isin(cells[detects], route.cells).any():
                raise ValueError(f"{scenario.name}: {source.name} at {place_m.round(2)} cannot be found")


def toml_text(level: str, base: str, tables: Mapping[str, Any]) -> str:
    """Return the text of a yard: that of its base, with other tables."""
    (yard,) = choose_yards(base)
    _, _, text = yard.path.read_text(encoding="utf-8").partition("\n")
    document = tomlkit.parse(text)
    for name, table in tables.items():
        document.pop(name, None)
        document.append(name, tomlkit.item(table))
    return f"# {level}: {load_suite().levels[level]}\n# made from {base}\n{tomlkit.dumps(document)}"


def main(levels: Sequence[str]) -> None:
    """Write all yards of some levels."""
    for level in levels:
        for part, first in PARTS.items():
            folder, rng = SUITE / part / level, np.random.default_rng([list(LEVELS).index(level), first])
            folder.mkdir(parents=True, exist_ok=True)
            for k, (base, tables) in enumerate(LEVELS[level](part, rng)):
                path = folder / f"{level}_{first + k:02}.toml"
                path.write_text(toml_text(level, base, tables), encoding="utf-8")
                check_sources(load_scenario(path))


if __name__ == "__main__":
    main(sys.argv[1:] or list(LEVELS))
