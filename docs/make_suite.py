"""Make the yards of the levels that versions 2 and 3 of the suite added.

Those of version 2 are made from yards of version 1. Those of version 3 are substations as `pdpatrol generate` draws
them, and have the other tables of `suite/open_01`.

uv run python docs/make_suite.py            # all of these levels
uv run python docs/make_suite.py mismatch   # one of them

A new yard differs from its base only in the tables that its level is about.
Yards of the public part are made from those of the public part, yards of the test part from those of the test part.
The script ends with an error if a source could not be found; see `Finder`.
"""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations, count
from typing import Any

import numpy as np
import tomlkit

from dirmusic.angles import aperture
from dirmusic.arrays import FloatArray
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.random_yard import pushed_out
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.envs.scenario.suite import SUITE, choose_yards, load_suite
from pdpatrol.envs.substation.schemes import Scheme
from pdpatrol.envs.substation.substation import Substation, SubstationParameters, draw_substation
from pdpatrol.envs.substation.substation_file import substation_text
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION, SiteMap
from pdpatrol.missions.planning.cover import candidates, cover, coverage
from pdpatrol.missions.planning.detectability import MARGIN_DB, DirectPaths, compute_detectability
from pdpatrol.missions.planning.plan import make_plan
from pdpatrol.missions.planning.tour import ShortestTours
from pdpatrol.robot_models.equipment.voltages import Kv
from pdpatrol.robot_models.yard.pieces import SITE_STANDOFF_M

PARTS = {"public": 1, "test": 51}
"""Number of the first yard of each level, by part."""

SEEN_FROM_M = (2.0, 8.0)
"""Range of distances from which a source must be detectable."""

SEEN_OVER_RAD = np.radians(40.0)
"""Angle, seen from the source, over which the places that detect it must spread."""

FEW_HZ, STOPS_OVER_RAD = 1.0, np.radians(60.0)
"""Largest pulse rate of sources that must be detectable from the waypoints, and the angle over which these spread."""

Change = tuple[str, dict[str, Any]]
"""Name of a yard of version 1, and the tables to replace or add."""

Bases = Sequence[tuple[str, Sequence[int]]]
"""Levels of version 1 and numbers of the yards in each, from 0."""


def tables_of(base: str) -> dict[str, Any]:
    """Return the tables of a yard as its file states them."""
    return tomllib.loads(choose_yards(base)[0].path.read_text(encoding="utf-8"))


def bases(part: str, levels: Bases) -> list[str]:
    """Return the names of some yards of version 1."""
    return [f"suite/{level}_{PARTS[part] + k:02}" for level, numbers in levels for k in numbers]


class Finder:
    """Check of whether discharges can be found in a yard.

    Args:
        scenario: Scenario with the yard, route, true array and receiver.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        site_map = SiteMap(scenario, scenario.yard)
        stops = [site_map.cell(stop_m) for stop_m in scenario.route.stops_m]
        route = ShortestTours(site_map).in_order(stops).cells
        reachable = np.flatnonzero(np.isfinite(site_map.reach(scenario.route.dock_m).length_m))
        cells = np.union1d(reachable, route)
        self._places_m = site_map.centres_m[cells]
        self._is_route, self._is_stop = np.isin(cells, route), np.isin(cells, stops)
        # The margin also covers the narrowest beam, whose gain is up to 1.6 dB lower 60 degrees above the horizon.
        array = scenario.nature.array.applied_to(scenario.array)
        self._direct = DirectPaths(array, scenario.receiver, site_map.sight)

    def can_find(self, place_m: FloatArray, source: SourceConfig | None = None) -> bool:
        """Return whether a source, by default the first one, can be found at a place (3,) at its lowest amplitude.

        It must be detectable, in direct sight, from reachable ground 2 to 8 m away over an angle of at least 40
        degrees, and from somewhere on the shortest path past the waypoints. A source of few pulses must be detectable
        from waypoints over 60 degrees.
        """
        source = source or self.scenario.sources[0]
        away_m = self._places_m - place_m[:2]
        range_m, aspect_rad = np.hypot(*away_m.T), np.arctan2(*away_m.T[::-1])
        amplitude_v = source.amplitude_v * 10 ** (-source.amplitude_range_db / 40)
        transmission, level_db = self._direct.levels(self._places_m, place_m, amplitude_v)
        detects = (transmission >= MIN_TRANSMISSION) & (level_db >= MARGIN_DB)
        near = detects & (range_m >= SEEN_FROM_M[0]) & (range_m <= SEEN_FROM_M[1])
        seen_rad = aperture(aspect_rad[detects & self._is_stop]) if source.pulse_rate_hz <= FEW_HZ else np.pi
        return bool(
            aperture(aspect_rad[near]) >= SEEN_OVER_RAD
            and (detects & self._is_route).any()
            and seen_rad >= STOPS_OVER_RAD
        )


def spread(part: str, rng: np.random.Generator, low: float, high: float, n: int) -> Iterator[float]:
    """Return n values in random order; those of both parts together are evenly spaced from `low` to `high`."""
    shares = (2.0 * np.arange(n) + (part == "test") + 0.5) / (2.0 * n)
    return iter(rng.permutation(low + (high - low) * shares).tolist())


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


FRAMES = (
    ("offset",),
    ("rotation",),
    ("offset", "rotation"),
    ("offset", "bias"),
    ("rotation", "worse"),
    ("jumps",),
    ("dropouts",),
    ("worse", "jumps"),
    ("bias", "dropouts"),
)
"""Errors of the localisation in each yard."""


def frame(part: str, rng: np.random.Generator) -> Iterator[Change]:
    """Make yards whose localisation is worse than the robot believes, in one or two ways."""
    offsets_m, rotations_deg = spread(part, rng, 0.2, 1.0, 3), spread(part, rng, 0.3, 2.0, 3)
    ratios = spread(part, rng, 1.5, 2.0, 2)
    names = bases(part, [("open", (0, 3, 6)), ("cluttered", (4, 7, 9)), ("several", (1, 4, 7))])
    for name, errors in zip(names, FRAMES, strict=True):
        pose: dict[str, Any] = {}
        for error in errors:
            sign, towards_rad = float(rng.choice([-1.0, 1.0])), rng.uniform(0.0, 2.0 * np.pi)
            if error == "offset":
                offset_m = next(offsets_m) * np.array([np.cos(towards_rad), np.sin(towards_rad)])
                pose["frame_offset_m"] = offset_m.round(3).tolist()
            elif error == "rotation":
                pose["frame_rotation_deg"] = round(sign * next(rotations_deg), 2)
            elif error == "bias":
                pose["heading_bias_deg"] = sign
            elif error == "worse":
                ratio = next(ratios)
                pose |= {"position_std_m": round(0.05 * ratio, 4), "heading_std_deg": round(0.5 * ratio, 3)}
            elif error == "jumps":
                pose |= {"jumps_per_min": 1.0, "jump_std_m": 0.3, "jump_std_deg": 2.0}
            else:
                pose |= {"dropouts_per_min": 1.0, "dropout_s": 10.0}
        yield name, {"nature": {"pose_sensor": pose}}


def wet(part: str, rng: np.random.Generator) -> Iterator[Change]:
    """Make yards with a ground that reflects more than the gravel that the robot assumes; a third of it is less wet."""
    names = bases(part, [("cluttered", (1, 8, 11)), ("several", (2, 5, 8)), ("high", (2, 5, 8))])
    for k, name in enumerate(names):
        yield name, {"radio": {"ground": "moist_soil" if k % 3 == (part == "test") else "wet_soil"}}


CLOSE_M = ((0.3, 0.5), (0.5, 1.0), (1.0, 2.0))
"""Ranges of distances between two discharges, each for a third of the yards."""


def close(part: str, rng: np.random.Generator) -> Iterator[Change]:
    """Make yards with two discharges near each other, of the same kind, phase, rate and mean level in most of them.

    Sites of the catalogue are at least 0.5 m apart. Below that, the second discharge is on the surface next to a site.
    """
    names = bases(part, [("open", range(9)), ("cluttered", range(12)), ("high", range(9))])
    finders = {str(name): Finder(load_scenario(name)) for name in rng.permutation(names)}
    for number, limits_m in enumerate(CLOSE_M):
        for k, distance_m in enumerate(spread(part, rng, *limits_m, 3)):
            pairs = pairs_of_sites(finders, distance_m) if number else sites_with_neighbours(finders, distance_m, rng)
            name, places = next(pairs)
            del finders[name]
            first = {key: value for key, value in tables_of(name)["sources"][0].items() if key not in PLACE_KEYS}
            first["conductor_deg"] = float(rng.choice([0.0, 120.0, 240.0]))
            second = dict(first)
            if k == 2 and number == 1 + (part == "test"):
                second["amplitude_v"] = 0.5 * first["amplitude_v"]
            elif k == 2 and number == 2 - (part == "test"):
                second["kind"] = "void" if first["kind"] == "corona" else "corona"
            both = enumerate(zip(places, (first, second), strict=True), 1)
            yield name, {"sources": [{"name": f"discharge_{n}", **place, **rest} for n, (place, rest) in both]}


PLACE_KEYS = ("name", "sites", "position_m")

Places = tuple[dict[str, Any], dict[str, Any]]
"""Keys of the places of two discharges."""


def pairs_of_sites(finders: Mapping[str, Finder], distance_m: float) -> Iterator[tuple[str, Places]]:
    """Yield yards with two sites at which discharges can be found, by how near their distance is to a given one."""
    pairs: list[tuple[float, str, str, str]] = []
    for name, finder in finders.items():
        yard = finder.scenario.yard
        for one, other in combinations(yard.site_names(), 2):
            apart_m = np.linalg.norm(yard.site_position(one) - yard.site_position(other))
            pairs.append((round(abs(float(apart_m) - distance_m), 3), name, one, other))
    for _, name, *sites in sorted(pairs, key=lambda pair: pair[0]):
        if all(finders[name].can_find(finders[name].scenario.yard.site_position(site)) for site in sites):
            yield name, ({"sites": [sites[0]]}, {"sites": [sites[1]]})


def sites_with_neighbours(
    finders: Mapping[str, Finder], distance_m: float, rng: np.random.Generator
) -> Iterator[tuple[str, Places]]:
    """Yield yards with a site and a place at a distance from it on the same surface; both can be found."""
    for name, finder in finders.items():
        yard = finder.scenario.yard
        for site in rng.permutation(yard.site_names()).tolist():
            site_m, direction = yard.site_position(site), rng.standard_normal((50, 3))
            for unit in direction / np.linalg.norm(direction, axis=1, keepdims=True):
                place_m = pushed_out(yard, site_m + distance_m * unit, SITE_STANDOFF_M).round(3)
                off_m = yard.solids.distance(place_m).min()
                if (
                    abs(np.linalg.norm(place_m - site_m) - distance_m) < 0.02
                    and abs(off_m - SITE_STANDOFF_M) < 0.5 * SITE_STANDOFF_M
                    and place_m[2] >= 0.2
                    and yard.contains(place_m)
                    and finder.can_find(site_m)
                    and finder.can_find(place_m)
                ):
                    yield name, ({"sites": [site]}, {"sites": [], "position_m": place_m.tolist()})
                    break


SLOW_DWELL_S = 10.0
"""Time to stand at each stop. Measured on patrols of the nine public yards: a source of 0.2 pulses per second without
pauses gives 12 pulses in sight over 60 degrees with a probability of 98 % (96 % at 5 s, 99 % at 15 s)."""

SLOW_HZ = (0.05, 1.0)
"""Range of pulse rates, evenly spread in their logarithm."""


def slow(part: str, rng: np.random.Generator) -> Iterator[Change]:
    """Make yards with one to three discharges of few pulses, a third of them with pauses, and a route past stops.

    The robot dwells at each stop; see `SLOW_DWELL_S`.
    """
    log_rates, numbers = spread(part, rng, np.log(SLOW_HZ[0]), np.log(SLOW_HZ[1]), 18), count()
    for n_sources, level in ((1, ("cluttered", (3, 5, 6))), (2, ("several", (0, 1, 4))), (3, ("several", (2, 3, 6)))):
        for name in bases(part, [level]):
            sources = tables_of(name)["sources"][:n_sources]
            for source in sources:
                source["pulse_rate_hz"] = round(float(np.exp(next(log_rates))), 3)
                if next(numbers) % 3 == 1:
                    source["duty_s"] = rng.uniform(20.0, 90.0, 2).round().tolist()
            route = {"waypoints_m": stops_past_all_sites(load_scenario(name)).tolist(), "dwell_s": SLOW_DWELL_S}
            yield name, {"sources": sources, "route": route, "task": {"time_limit_s": 900.0}}


def stops_past_all_sites(scenario: Scenario) -> FloatArray:
    """Return few stops, (n, 2) in order, from which each site of the map is detectable over `STOPS_OVER_RAD`."""
    site_map = SiteMap(scenario)
    where = compute_detectability(scenario, site_map)
    required_rad = np.minimum(coverage(where, where.cells)[:, 0], STOPS_OVER_RAD)
    columns = cover(where, candidates(where, site_map.clearance_m[where.cells], required_rad), required_rad)
    return site_map.centres_m[ShortestTours(site_map).shortest(where.cells[columns].tolist()).stops]


SITE_BAYS: Mapping[Kv, Mapping[Scheme, tuple[int, int]]] = {
    110: {"single_busbar": (4, 10), "double_busbar": (4, 10), "ring": (3, 6), "breaker_and_a_half": (2, 8)},
    220: {"single_busbar": (4, 8), "double_busbar": (4, 8), "ring": (3, 6), "breaker_and_a_half": (4, 10)},
    400: {"single_busbar": (3, 7), "double_busbar": (3, 7), "ring": (3, 6), "breaker_and_a_half": (4, 18)},
}
"""Ranges of the number of bays, by voltage and scheme."""

SITE_YARDS = 10
"""Number of substations in each part of a level."""

SITE_SOURCES = (2, 10)
"""Range of the number of discharges in a substation."""

SITE_AMPLITUDE_V = 0.1
"""Weakest discharge for which the routes of substations are planned; that of the weakest that `generate` draws."""

PEOPLE, WALKING_MPS = 2, 1.2
"""Number of people who walk on the roads of a substation, and their speed (assumed)."""


def site(kv: Kv) -> Callable[[str, np.random.Generator], Iterator[Change]]:
    """Return the function that makes the substations of one part of a level."""
    return partial(substations, kv)


def substations(kv: Kv, part: str, rng: np.random.Generator) -> Iterator[Change]:
    """Make substations with planned routes past all sites, discharges at sites on them, interferers and people."""
    numbers = spread(part, rng, SITE_SOURCES[0] - 0.49, SITE_SOURCES[1] + 0.49, SITE_YARDS)
    for k in range(SITE_YARDS):
        scheme = list(SITE_BAYS[kv])[k % len(SITE_BAYS[kv])]
        n_bays, seed = int(rng.integers(*SITE_BAYS[kv][scheme], endpoint=True)), int(rng.integers(1000000))
        drawn = draw_substation(SubstationParameters(kv, scheme, n_bays, seed))
        tables = tables_of("suite/open_01") | tomllib.loads(substation_text(drawn, 64)) | {"name": f"site_{kv}"}
        scenario = restore_scenario(tables | {"sources": []})
        plan = make_plan(scenario, SITE_AMPLITUDE_V)
        detections = zip(plan.detectability.names, plan.detections(), strict=True)
        detected = {name for name, detection in detections if detection is not None}
        sources = [source for source in tables["sources"] if source["sites"][0] in detected]
        duration_s = plan.driving_s + plan.dwell_s * len(plan.stops_m)
        tables |= {
            "route": tables["route"] | {"waypoints_m": plan.stops_m.round(2).tolist(), "dwell_s": plan.dwell_s},
            "task": {"time_limit_s": 300.0 * math.ceil(1.5 * duration_s / 300.0)},
            "sources": [source | {"amplitude_range_db": 0.0} for source in sources[: round(next(numbers))]],
            "interferers": interferers(drawn, rng) if k % 3 == 0 else [],
            "nature": {"moving": people(drawn, rng)},
        }
        complete = restore_scenario(tables).model_dump(mode="json", include=set(tables) - {"nature"}, exclude_none=True)
        made = ("yard", "route", "task", "sources", "interferers")
        yield "suite/open_01", {name: complete[name] for name in made if complete[name]} | {"nature": tables["nature"]}


def interferers(drawn: Substation, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Draw traffic outside the fence of a substation, and a switch that emits bursts at the control building."""
    length_m, beyond_m = drawn.size_m[0], round(float(rng.uniform(5.0, 15.0)), 2)
    building = next(piece for piece in drawn.yard.equipment if piece.name == "building")
    return [
        {
            "name": "traffic",
            "position_m": [-40.0, -beyond_m, 1.0],
            "path_m": [[length_m + 40.0, -beyond_m, 1.0]],
            "speed_mps": 13.0,
            "amplitude_v": round(float(rng.uniform(0.3, 0.6)), 2),
            "pulse_rate_hz": 15.0,
        },
        {
            "name": "switch",
            "position_m": [*building.position_m, 4.5],
            "amplitude_v": round(float(rng.uniform(0.5, 2.0)), 2),
            "pulse_rate_hz": 5.0,
            "burst_s": 1e-6,
        },
    ]


def people(drawn: Substation, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Draw people who walk to and fro on the roads of a substation, except on that along the dock."""
    roads_m = [road_m for road_m in drawn.roads_m if any(end_m[0] != drawn.dock_m[0] for end_m in road_m)]
    return [
        {
            "name": f"person_{k}",
            "kind": "person",
            "path_m": [list(end_m) for end_m in roads_m[road]],
            "speed_mps": WALKING_MPS,
            "pause_s": [5.0, 30.0],
            "loop": False,
        }
        for k, road in enumerate(rng.choice(len(roads_m), PEOPLE, replace=False).tolist(), 1)
    ]


LEVELS: Mapping[str, Callable[[str, np.random.Generator], Iterator[Change]]] = {
    "mismatch": mismatch,
    "frame": frame,
    "close": close,
    "slow": slow,
    "wet": wet,
    "site_110": site(110),
    "site_220": site(220),
    "site_400": site(400),
}
"""Functions that make the yards of one part of a level."""


def check_sources(scenario: Scenario) -> None:
    """Check that each source can be found wherever it may be.

    Raises:
        ValueError: If a source cannot be found.
    """
    finder = Finder(scenario)
    for source in scenario.sources:
        sites_m = [scenario.yard.site_position(site) for site in scenario.candidate_sites(source)]
        for place_m in sites_m or [np.array(source.position_m)]:
            if not finder.can_find(place_m, source):
                raise ValueError(f"{scenario.name}: {source.name} at {place_m.round(2)} cannot be found")


def toml_text(level: str, base: str, tables: Mapping[str, Any]) -> str:
    """Return the text of a yard: that of its base, with other tables."""
    _, _, text = choose_yards(base)[0].path.read_text(encoding="utf-8").partition("\n")
    document = tomlkit.parse(text)
    for name, table in tables.items():
        if name in document and isinstance(table, dict):
            table = {**document[name].unwrap(), **table}
        document[name] = table
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
                scenario = load_scenario(path)
                if not level.startswith("site"):  # their sources are where the planned route detects them
                    check_sources(scenario)


if __name__ == "__main__":
    main(sys.argv[1:] or list(LEVELS))
