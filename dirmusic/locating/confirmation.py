"""Confirmation: the properties of a finding by its pulses, and the state that follows from them."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import aperture, difference
from dirmusic.locating.association import Assignment
from dirmusic.locating.finding import Finding, reaches95
from dirmusic.locating.gating import expect_bearings
from dirmusic.locating.pulse_record import LIKELIEST_HEIGHT, PulseRecord, Rows, choose_evenly
from dirmusic.locating.rules import AssignmentRules, LocatingRules

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LEVEL_QUANTILE = 0.75
"""Quantile of the levels of its pulses that is the level of a finding (assumed): those on the direct path are the
stronger ones."""

LONG_OBSERVED_FACTOR = 40
"""Multiple of the pulses that confirm from which on a finding was observed for long (assumed): it may have a longer
ellipse, and need not be in sight for certain. More pulses improve neither much."""

LONG_OBSERVED_ELLIPSE = 1.5
"""Factor by which the ellipse of a finding that was observed for long may be longer (assumed)."""

NEARLY_AS_NEAR = 1.25
"""Multiple of the smallest range of detection from within which a finding should be detected again (assumed), if it has
not been detected from within `detection_range_m`."""

VISIT_S = 5.0
"""Length of a visit of one place, within which the errors of the pose stay the same (assumed)."""


class Presence(NamedTuple):
    """How often a finding is detected where it should be: near it and in sight of it.

    Attributes:
        rate: Share of the seconds there with any detection in which its pulses may have come; 1 if nothing was
            detected.
        observed_s: Number of these seconds.
        silent_s: Seconds there since its last pulse, with or without detections.
        is_sure: True if the finding is in sight there at all heights or at the likeliest one, false if the array was in
            no such place.
    """

    rate: float
    observed_s: int
    silent_s: int
    is_sure: bool = True


def updated_state(
    finding: Finding,
    number: int,
    assignment: Assignment,
    record: PulseRecord,
    error_rad: FloatArray,
    rules: LocatingRules,
    fence_m: tuple[float, float] | None,
    time_s: float,
) -> Finding:
    """Update the state of a finding by its pulses.

    Args:
        finding: Position and covariance are of the last fit.
        number: Its position among the findings that pulses were assigned to.
        assignment: Assignment of all pulses.
        record: All pulses.
        error_rad: Table of known bearing errors, see `PulseRecord.error_table`.
        rules: Conditions for a confirmed finding and for a ghost.
        fence_m: Length of the yard along x and y, origin at the corner; None without a fence.
        time_s: Current time.
    """
    own = np.flatnonzero(assignment.finding == number)
    rows = own[assignment.in_sight[own]]
    present = presence(finding, assignment.may_be[number], assignment.is_too_weak[number], record, rules.assignment)
    if own.size:
        finding = _measured(finding, number, own, rows, assignment, record)
    if _lies_outside(finding, fence_m):
        return replace(finding, state="outside")
    if _is_where_the_array_was(finding, record, rules):
        return replace(finding, state="ghost")
    if finding.state != "confirmed" and _is_ghost(finding, present, rules):
        return replace(finding, state="ghost")
    n_own = rows.size - int(assignment.is_echo[rows].sum())
    is_found = _stays_confirmed(finding, n_own, present.rate, rules) or _meets(finding, n_own, present, rules)
    if not is_found or disagreement(record, rows, finding, error_rad) > rules.confirm_disagreement:
        return replace(finding, state="candidate")
    confirmed_s = time_s if finding.confirmed_s is None else finding.confirmed_s
    return replace(finding, state="confirmed", confirmed_s=confirmed_s)


def presence(
    finding: Finding, may_be: BoolArray, is_too_weak: BoolArray, record: PulseRecord, rules: AssignmentRules
) -> Presence:
    """Count how often a finding is detected where it should be; without a map, the rate is 1.

    A place is in sight if it is so at every height at which the finding may be; if the array was in no such place, at
    the likeliest height; and if not there either, at any. Seconds in which pulses point to the finding, all too weak
    for its level, are left out, whatever the map says: a position that is a little off next to an edge is in sight
    where the source is not.

    Args:
        finding: The finding.
        may_be: True for pulses that may have come from it, shape (n,).
        is_too_weak: True for pulses that point to it and are too weak for its level, shape (n,).
        record: All pulses.
        rules: Distance from within which it should be detected.
    """
    if not record.has_map:
        return Presence(1.0, 1, 0)
    nearest_m = finding.nearest_m if np.isfinite(finding.nearest_m) else 0.0
    near_m = max(rules.detection_range_m, NEARLY_AS_NEAR * nearest_m)
    is_near = np.linalg.norm(record.places_m[:, :2] - finding.position_m[:2], axis=-1) < near_m
    transmission = record.transmission_at_heights(finding, rules.surface_depth_m)
    is_clear = is_near & (transmission >= 10 ** (-rules.sight_loss_db / 20))
    surest_first = (is_clear.all(axis=0), is_clear[LIKELIEST_HEIGHT], is_clear.any(axis=0))
    is_near = next((seen for seen in surest_first if seen.any()), surest_first[-1])
    time_s, elapsed_s = record.pulses.time_s, record.elapsed_s
    second = np.floor(elapsed_s - np.floor(elapsed_s.min())).astype(np.intp)
    is_present = _occurring(second[may_be], second)
    is_hidden = _occurring(second[is_too_weak], second) & ~is_present
    is_observed = _occurring(second[is_near[record.place]], second) & ~is_hidden
    n_observed, n_present = int(is_observed.sum()), int((is_observed & is_present).sum())
    last_s = time_s[may_be | is_too_weak].max(initial=finding.first_detected_s)
    silent = is_near[record.listened] & (record.listened_s > last_s)
    is_sure = bool(surest_first[0].any() or surest_first[1].any())
    return Presence(n_present / n_observed if n_observed else 1.0, n_observed, int(silent.sum()), is_sure)


def disagreement(record: PulseRecord, rows: Rows, finding: Finding, error_rad: FloatArray) -> float:
    r"""Return the rms offset of bearings from a finding, in their expected deviations; 1 for a source, on average.

    .. math:: \sqrt{\frac{1}{m} \sum_{g=1}^{m} \frac{\bar o_g^2}{1 / \sum_i \sigma_i^{-2} + \sigma_c^2}}

    over visits of places: :math:`\bar o` is the mean offset of their pulses, weighted by their noise :math:`\sigma_i`,
    and :math:`\sigma_c` is the deviation that they have in common, by array, pose and range. Multipath of something
    that moves, and waves diffracted at many edges, point past any one place by more, each pulse within its own
    deviation.

    At most 200 pulses are used (assumed), because those of one visit share their errors.

    Args:
        record: All pulses.
        rows: Rows of the finding's own pulses, shape (n,), n >= 1.
        finding: The finding.
        error_rad: Table of known bearing errors, see `PulseRecord.error_table`.
    """
    rows = choose_evenly(rows, 200)
    bearing_rad, std_rad = record.bearings(rows, error_rad)
    expected, noise_rad2 = expect_bearings(record, rows, finding), np.square(record.pulses.std_rad[rows])
    offset_rad = difference(bearing_rad, expected.bearing_rad)
    common_rad2 = np.square(std_rad) - noise_rad2 + expected.position_rad2 + expected.elevation_rad2
    visit = (record.elapsed_s[rows] // VISIT_S).astype(np.intp) * len(record.places_m) + record.place[rows]
    _, group = np.unique(visit, return_inverse=True)
    of_group = np.bincount(group, 1.0 / noise_rad2)
    mean_rad = np.bincount(group, offset_rad / noise_rad2) / of_group
    expected_rad2 = 1.0 / of_group + np.bincount(group, common_rad2) / np.bincount(group)
    return float(np.sqrt(np.mean(np.square(mean_rad) / expected_rad2)))


def _occurring(some: Rows, of: Rows) -> BoolArray:
    """Mark which numbers, up to the largest of `of`, occur among `some`."""
    occurs = np.zeros(of.max(initial=-1) + 1, dtype=np.bool_)
    occurs[some] = True
    return occurs


def _measured(
    finding: Finding, number: int, own: Rows, rows: Rows, assignment: Assignment, record: PulseRecord
) -> Finding:
    """Update the time of the last pulse, and number, aperture, nearest range and level of the pulses in sight."""
    last_s = float(record.pulses.time_s[own[-1]])
    if not rows.size:
        return replace(finding, last_detected_s=last_s)
    sight = record.pose[rows, :2] - finding.position_m[:2]
    places_m = record.places_m[np.flatnonzero(_occurring(record.place[rows], record.place)), :2]
    from_places = places_m - finding.position_m[:2]
    return replace(
        finding,
        last_detected_s=last_s,
        n_bearings=rows.size,
        aperture_rad=aperture(np.arctan2(from_places[:, 1], from_places[:, 0])),
        nearest_m=float(np.hypot(sight[:, 0], sight[:, 1]).min()),
        level_db=_level(finding, number, rows, assignment),
    )


def _level(finding: Finding, number: int, rows: Rows, assignment: Assignment) -> float:
    """Return the level of a finding by its pulses in sight.

    If more pulses that point to a candidate are too weak for its level, the level is wrong, by the attenuation of the
    map for another place than the source's. They count as well then; otherwise the candidate would stay as it is.
    """
    weak = np.flatnonzero(assignment.is_too_weak[number])
    if finding.state != "confirmed" and weak.size > rows.size:
        rows = np.union1d(rows, weak)
    return float(np.quantile(assignment.level_db[number, rows], LEVEL_QUANTILE))


def _is_ghost(finding: Finding, present: Presence, rules: LocatingRules) -> bool:
    """Return whether a candidate is not detected where it should be, and known well enough for that to count."""
    if not present.is_sure:
        return False
    is_missed = present.observed_s >= rules.ghost_observed_s and present.rate < rules.ghost_detection_rate
    return (is_missed and finding.semi_major_m < rules.ghost_semi_major_m) or present.silent_s >= rules.ghost_silent_s


def _is_where_the_array_was(finding: Finding, record: PulseRecord, rules: LocatingRules) -> bool:
    """Return whether the finding lies where the robot stood and nothing can discharge."""
    apart_m = float(np.linalg.norm(record.places_m - finding.position_m, axis=-1).min())
    return apart_m < rules.least_range_m and finding.semi_major_m <= rules.confirm_semi_major_m


def _stays_confirmed(finding: Finding, n_own: int, rate: float, rules: LocatingRules) -> bool:
    """Return whether half of what confirmed the finding remains, without possible multipath of other findings.

    If most of its pulses may be multipath, as many must remain as confirm it.
    """
    most_are_own = 2 * n_own >= finding.n_bearings
    least = rules.confirm_pulses // 2 if most_are_own else rules.confirm_pulses
    return finding.state == "confirmed" and n_own >= least and rate >= 0.5 * rules.confirm_detection_rate


def _meets(finding: Finding, n_own: int, present: Presence, rules: LocatingRules) -> bool:
    """Return whether a candidate meets every rule of confirmation, by pulses that are not multipath of others.

    A candidate that was never observed where it is in sight for certain must also have been observed for long.
    """
    was_observed_long = (
        n_own >= LONG_OBSERVED_FACTOR * rules.confirm_pulses and finding.aperture_rad >= rules.planned_aperture_rad
    )
    is_observed = present.is_sure and present.observed_s > 0
    longest_m = rules.confirm_semi_major_m * (LONG_OBSERVED_ELLIPSE if was_observed_long else 1.0)
    return (
        (is_observed or was_observed_long)
        and finding.aperture_rad >= rules.confirm_aperture_rad
        and finding.semi_major_m <= longest_m
        and finding.nearest_m <= rules.confirm_range_m
        and n_own >= rules.confirm_pulses
        and present.rate >= rules.confirm_detection_rate
    )


def _lies_outside(finding: Finding, fence_m: tuple[float, float] | None) -> bool:
    """Return whether the 95 % ellipse lies entirely outside the fence."""
    if fence_m is None:
        return False
    return not reaches95(finding.position_m[:2], finding.covariance_m2[:2, :2], np.asarray(fence_m))
