"""Which sites of the map a mission has listened to: in sight, near enough, and over a wide enough angle to locate."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from dirmusic import InputFileError
from dirmusic.angles import aperture
from pdpatrol.envs.scenario.locating import LocatingConfig
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.driving.site_map import MIN_TRANSMISSION
from pdpatrol.missions.planning.hearing import AMPLITUDE_V, MARGIN_DB, StraightPaths
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.yard_of_log import known_yard
from pdpatrol.missions.report.records import Inspection
from pdpatrol.sensing import ArrayConfig, ReceiverConfig
from pdpatrol.sensing.radio.sight import Sight

State = Literal["inspected", "heard_narrowly", "not_inspected"]

ASKED_DB = float(20 * np.log10(AMPLITUDE_V))
"""Of the discharge that is asked for, decibels over one volt at 1 m: the one that tours are planned for."""

PLACE_M = 0.25
"""Poses this near to each other are one place (assumed)."""


class SiteInspection(NamedTuple):
    """How one site was listened to.

    Attributes:
        name: `equipment/site`.
        position_m: x, y, z, world frame.
        state: `inspected` where a discharge of `ASKED_DB` would have been heard from within the useful range over the
            aperture that confirmation wants; `heard_narrowly` where only from fewer sides.
        nearest_m: Least distance on plan from which it was in sight; None if never within the useful range.
        aperture_rad: Angle over which the places spread from which that discharge would have been heard.
        least_level_db: Weakest discharge that would have been heard, decibels over one volt at 1 m; None if it was
            never in sight within the useful range.
    """

    name: str
    position_m: tuple[float, float, float]
    state: State
    nearest_m: float | None
    aperture_rad: float
    least_level_db: float | None


class Inspected(NamedTuple):
    """All sites of the map.

    Attributes:
        useful_range_m: Distance on plan from within which findings are confirmed.
        needed_rad: Aperture over which they are.
        sites: Each of them, in the order of the map.
    """

    useful_range_m: float
    needed_rad: float
    sites: tuple[SiteInspection, ...]

    def names(self, state: State) -> tuple[str, ...]:
        """Of the sites in a state."""
        return tuple(site.name for site in self.sites if site.state == state)

    def record(self) -> Inspection:
        """For the report."""
        return Inspection(
            useful_range_m=self.useful_range_m,
            level_db=ASKED_DB,
            inspected=self.names("inspected"),
            heard_narrowly=self.names("heard_narrowly"),
            not_inspected=self.names("not_inspected"),
        )


def inspected_sites(log: MissionLog) -> Inspected | None:
    """What the poses driven, as the robot believed them, showed of the sites of the map.

    Returns:
        None without a map, without sites on it, or where a file that the array's pattern was read from is gone.
    """
    yard = known_yard(log)
    if yard is None or not yard.site_names():
        return None
    scenario = log.meta["scenario"]
    own_rules = {key: value for key, value in scenario["locating"].items() if key not in ("locator", "calibration")}
    rules = LocatingConfig.model_validate(own_rules, strict=False).rules()
    array = ArrayConfig.model_validate(scenario["array"], strict=False)
    receiver = ReceiverConfig.model_validate(scenario["receiver"], strict=False)
    try:
        straight = StraightPaths(array, receiver, Sight(surroundings_of(yard)))
    except (InputFileError, OSError):
        return None
    pose = log.column("step", "pose")[:, :2]
    places_m = np.unique(np.round(pose / PLACE_M), axis=0) * PLACE_M
    sites: list[SiteInspection] = []
    for name in yard.site_names():
        site_m = yard.site_position(name)
        away_m = places_m - site_m[:2]
        range_m = np.linalg.norm(away_m, axis=-1)
        near = range_m <= rules.confirm_range_m
        share, level_db = straight.heard(places_m[near], site_m)
        in_sight = share >= MIN_TRANSMISSION
        heard = in_sight & (level_db >= MARGIN_DB)
        aspect_rad = np.arctan2(away_m[near, 1], away_m[near, 0])
        seen_rad = aperture(aspect_rad[heard])
        is_wide = heard.any() and seen_rad >= rules.confirm_aperture_rad
        best_db = float(level_db[in_sight].max()) if in_sight.any() else None
        sites.append(
            SiteInspection(
                name=name,
                position_m=(float(site_m[0]), float(site_m[1]), float(site_m[2])),
                state="inspected" if is_wide else "heard_narrowly" if heard.any() else "not_inspected",
                nearest_m=float(range_m[near][in_sight].min()) if in_sight.any() else None,
                aperture_rad=seen_rad,
                least_level_db=None if best_db is None else ASKED_DB + MARGIN_DB - best_db,
            )
        )
    return Inspected(rules.confirm_range_m, rules.confirm_aperture_rad, tuple(sites))
