"""Confirmation: what the pulses of a finding say of it, and the state that follows."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture
from dirmusic.array.element_errors import ElementErrors
from dirmusic.locating.association.agreement import disagreement
from dirmusic.locating.association.assignment import Assignment
from dirmusic.locating.association.pulse_record import PulseRecord, Rows
from dirmusic.locating.association.sight_lines import LIKELIEST_HEIGHT
from dirmusic.locating.ellipse import reaches95
from dirmusic.locating.finding import Finding, State
from dirmusic.locating.rules import AssignmentRules, LocatingRules

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LEVEL_QUANTILE = 0.75
"""The level of a finding is this quantile of the levels of its pulses (assumed): those on the direct path are the
louder ones."""

NEARLY_AS_NEAR = 1.25
"""A finding that has not been detected from within `detection_range_m` should be from within so many times the range
from which it has been (assumed)."""


def updated_state(
    finding: Finding,
    number: int,
    assignment: Assignment,
    record: PulseRecord,
    errors: ElementErrors,
    rules: LocatingRules,
    fence_m: tuple[float, float] | None,
    time_s: float,
) -> Finding:
    """A finding with its state in the light of its pulses.

    Args:
        finding: Position and covariance are of the last fit.
        number: Its position among the findings that pulses were assigned to.
        assignment: Of all pulses.
        record: All pulses.
        errors: Errors of the array's elements as known by now.
        rules: What confirms a finding, and what makes it a ghost.
        fence_m: Length of the yard along x and y, origin at the corner; None without a fence.
        time_s: Now.
    """
    own = np.flatnonzero(assignment.owner == number)
    rows = own[assignment.in_sight[own]]
    present = presence(finding, assignment.may_be[number], assignment.is_too_weak[number], record, rules.assignment)
    if own.size:
        finding = _measured(finding, number, own, rows, assignment, record)
    if _lies_outside(finding, fence_m):
        return _in_state(finding, "outside")
    if _is_where_the_array_was(finding, record, rules):
        return _in_state(finding, "ghost")
    if finding.state != "confirmed" and _is_ghost(finding, present, rules):
        return _in_state(finding, "ghost")
    n_own = rows.size - int(assignment.is_echo[rows].sum())
    is_found = _stays_confirmed(finding, n_own, present.rate, rules) or _meets(finding, n_own, present, rules)
    if not is_found or disagreement(record, rows, finding, errors) > rules.confirm_disagreement:
        return _in_state(finding, "candidate")
    if finding.confirmed_s is None:
        finding = replace(finding, confirmed_s=time_s)
    return _in_state(finding, "confirmed")


def _in_state(finding: Finding, state: State) -> Finding:
    """The finding in a state."""
    return finding if finding.state == state else replace(finding, state=state)


MANY_TIMES, LONGER = 40, 1.5
"""A finding with so many times the pulses that confirm, over the aperture that plans ask for, was seen for long: it may
have an ellipse longer by this, and need not be in sight for certain (assumed). More makes neither much better."""


class Presence(NamedTuple):
    """How often a finding is detected where it should be: near it and in sight of it.

    Attributes:
        rate: Of the seconds in which anything was detected there, the share with pulses that may be its own; 1 where
            there are none, for nothing speaks against it.
        observed_s: How many seconds these are.
        silent_s: Seconds there since its last pulse, whether anything was detected or not.
        is_sure: Whether it is in sight there for certain, or at the likeliest height; else it was in no such place.
    """

    rate: float
    observed_s: int
    silent_s: int
    is_sure: bool = True


def presence(
    finding: Finding, may_be: BoolArray, is_too_weak: BoolArray, record: PulseRecord, rules: AssignmentRules
) -> Presence:
    """How often a finding is detected where it should be; without a map, which could tell what is in sight, always.

    In sight is what is so at every height at which the finding may be; where the array has been in no such place, at
    the likeliest; and where it has not been there either, at any. Seconds in which pulses point to it that are all too
    weak for its level say nothing, whatever the map says: a position that is a little off beside an edge is in sight
    where the source is not. Nor are they silent.

    Args:
        finding: The finding.
        may_be: Which pulses may have come from it, shape (n,).
        is_too_weak: Which point to it, too weak for its level, shape (n,).
        record: All pulses.
        rules: How near it should be detected.
    """
    if not record.sight.has_map:
        return Presence(1.0, 1, 0)
    nearest_m = finding.nearest_m if np.isfinite(finding.nearest_m) else 0.0
    near_m = max(rules.detection_range_m, NEARLY_AS_NEAR * nearest_m)
    is_near = np.linalg.norm(record.places_m[:, :2] - finding.position_m[:2], axis=-1) < near_m
    left = record.sight.at_heights(record.places_m, finding, rules.surface_depth_m)
    is_clear = is_near & (left >= 10 ** (-rules.sight_loss_db / 20))
    surest_first = (is_clear.all(axis=0), is_clear[LIKELIEST_HEIGHT], is_clear.any(axis=0))
    is_near = next((seen for seen in surest_first if seen.any()), surest_first[-1])
    time_s, elapsed_s = record.pulses.time_s, record.elapsed_s
    second = np.floor(elapsed_s - np.floor(elapsed_s.min())).astype(np.intp)
    is_present = _marked(second[may_be], second)
    is_hidden = _marked(second[is_too_weak], second) & ~is_present
    is_observed = _marked(second[is_near[record.place]], second) & ~is_hidden
    n_observed, n_present = int(is_observed.sum()), int((is_observed & is_present).sum())
    last_s = time_s[may_be | is_too_weak].max(initial=finding.first_detected_s)
    silent = is_near[record.listened] & (record.listened_s > last_s)
    is_sure = bool(surest_first[0].any() or surest_first[1].any())
    return Presence(n_present / n_observed if n_observed else 1.0, n_observed, int(silent.sum()), is_sure)


def _marked(some: Rows, of: Rows) -> BoolArray:
    """Which numbers up to the largest of all are among some of them."""
    is_there = np.zeros(of.max(initial=-1) + 1, dtype=np.bool_)
    is_there[some] = True
    return is_there


def _measured(
    finding: Finding, number: int, own: Rows, rows: Rows, assignment: Assignment, record: PulseRecord
) -> Finding:
    """The finding with the time of its last pulse, and number, aperture, nearest range and level of those in sight."""
    last_s = float(record.pulses.time_s[own[-1]])
    if not rows.size:
        return replace(finding, last_detected_s=last_s)
    sight = record.pose[rows, :2] - finding.position_m[:2]
    from_places = (
        record.places_m[np.flatnonzero(_marked(record.place[rows], record.place)), :2] - finding.position_m[:2]
    )
    return replace(
        finding,
        last_detected_s=last_s,
        n_bearings=rows.size,
        aperture_rad=aperture(np.arctan2(from_places[:, 1], from_places[:, 0])),
        nearest_m=float(np.hypot(sight[:, 0], sight[:, 1]).min()),
        level_db=_level(finding, number, rows, assignment),
    )


def _level(finding: Finding, number: int, rows: Rows, assignment: Assignment) -> float:
    """The level of a finding by its pulses in sight.

    Where more of those that point to a candidate are too weak for its level, that is off, by what the map takes from
    another place than the source's: they count as well, or they would be left out, and the candidate stay as it is.
    """
    weak = np.flatnonzero(assignment.is_too_weak[number])
    if finding.state != "confirmed" and weak.size > rows.size:
        rows = np.union1d(rows, weak)
    return float(np.quantile(assignment.level_db[number, rows], LEVEL_QUANTILE))


def _is_ghost(finding: Finding, present: Presence, rules: LocatingRules) -> bool:
    """Whether a candidate is known well enough to be missed where it should be detected, and is."""
    if not present.is_sure:
        return False
    is_missed = present.observed_s >= rules.ghost_observed_s and present.rate < rules.ghost_detection_rate
    return (is_missed and finding.semi_major_m < rules.ghost_semi_major_m) or present.silent_s >= rules.ghost_silent_s


def _is_where_the_array_was(finding: Finding, record: PulseRecord, rules: LocatingRules) -> bool:
    """Whether the finding is known to lie where nothing can discharge, for the robot stood there."""
    apart_m = float(np.linalg.norm(record.places_m - finding.position_m, axis=-1).min())
    return apart_m < rules.least_range_m and finding.semi_major_m <= rules.confirm_semi_major_m


def _stays_confirmed(finding: Finding, n_own: int, rate: float, rules: LocatingRules) -> bool:
    """Whether half of what confirmed it is left, without what may be echoes of findings confirmed since.

    Where most of its pulses may be echoes, as many have to be left as confirm it.
    """
    most_are_own = 2 * n_own >= finding.n_bearings
    least = rules.confirm_pulses // 2 if most_are_own else rules.confirm_pulses
    return finding.state == "confirmed" and n_own >= least and rate >= 0.5 * rules.confirm_detection_rate


def _meets(finding: Finding, n_own: int, present: Presence, rules: LocatingRules) -> bool:
    """Whether a candidate meets every rule of confirmation, by pulses that are no echoes of another finding.

    One that was observed nowhere where it is in sight for certain has to be seen for long as well.
    """
    was_seen_long = n_own >= MANY_TIMES * rules.confirm_pulses and finding.aperture_rad >= rules.planned_aperture_rad
    is_observed = present.is_sure and present.observed_s > 0
    return (
        (is_observed or was_seen_long)
        and finding.aperture_rad >= rules.confirm_aperture_rad
        and finding.semi_major_m <= rules.confirm_semi_major_m * (LONGER if was_seen_long else 1.0)
        and finding.nearest_m <= rules.confirm_range_m
        and n_own >= rules.confirm_pulses
        and present.rate >= rules.confirm_detection_rate
    )


def _lies_outside(finding: Finding, fence_m: tuple[float, float] | None) -> bool:
    """Whether the 95 % ellipse leaves no room inside the fence."""
    if fence_m is None:
        return False
    return not reaches95(finding.position_m[:2], finding.covariance_m2[:2, :2], np.asarray(fence_m))
