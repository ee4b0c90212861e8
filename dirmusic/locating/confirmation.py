"""Confirmation: the properties of a finding as measured by its pulses, and the resulting state."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dirmusic.angles import aperture, difference
from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.locating.association import Assignment
from dirmusic.locating.finding import Finding, reaches95
from dirmusic.locating.gating import expect_bearings
from dirmusic.locating.pulse_record import LIKELIEST_HEIGHT, PulseRecord, Rows, choose_evenly
from dirmusic.locating.rules import AssignmentRules, LocatingRules

LEVEL_QUANTILE = 0.75
"""Quantile of the levels of its pulses that is taken as the level of a finding (assumed): the stronger pulses are those
on the direct path."""

LONG_OBSERVED_FACTOR = 40
"""Multiple of `confirm_pulses` at which a finding counts as observed for long (assumed). Its ellipse may then be
longer, and it need not be in sight for certain, because more pulses would hardly improve either."""

LONG_OBSERVED_ELLIPSE = 1.5
"""Factor by which the ellipse may be longer if the finding was observed for long (assumed)."""

NEARLY_AS_NEAR = 1.25
"""Multiple of the smallest range at which a finding was detected, within which it should be detected again (assumed).
It applies if the product is larger than `detection_range_m`."""

VISIT_S = 5.0
"""Duration of a visit to one place, during which the pose errors do not change (assumed)."""


class Presence(NamedTuple):
    """How often a finding is detected from places that are near it and in sight of it.

    Attributes:
        rate: Fraction of `observed_s` in which pulses were detected that may have come from the finding; 1 if
            `observed_s` is 0.
        observed_s: Number of seconds at such places in which any pulse was detected.
        silent_s: Number of seconds at such places since its last pulse, with or without other detections.
        is_sure: True if the array was at a place from which the finding is in sight at all possible heights, or at the
            likeliest height.
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
    """Update the state of a finding from its pulses.

    Args:
        finding: The finding, with position and covariance from the last fit.
        number: Index of the finding in `assignment`.
        assignment: Assignment of all pulses to findings.
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
    """Count how often a finding is detected from places near it and in sight of it; without a map, the rate is 1.

    A place counts if the finding is in sight at every height at which it may be. If the array was at no such place,
    the likeliest height decides; if that leaves no place either, any height is enough. Seconds in which all pulses that
    point to the finding are too weak for its level are not counted, whatever the map says: if the source is next to an
    edge and its position is slightly wrong, the position can be in sight where the source is not.

    Args:
        finding: The finding.
        may_be: True for pulses that may have come from the finding, shape (n,).
        is_too_weak: True for pulses that point to the finding but are too weak for its level, shape (n,).
        record: All pulses.
        rules: Distance within which the finding should be detected, and limits of attenuation.
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
    r"""Return the rms offset of bearings from a finding, in expected standard deviations; about 1 for a true source.

    .. math:: \sqrt{\frac{1}{m} \sum_{g=1}^{m} \frac{\bar o_g^2}{1 / \sum_i \sigma_i^{-2} + \sigma_c^2}}

    The sum is over the m visits to places. :math:`\bar o_g` is the mean offset of the pulses of a visit, weighted by
    their noise :math:`\sigma_i`, and :math:`\sigma_c` is the standard deviation of the error that they share, due to
    array, pose and range. The value is larger for multipath of a moving interferer and for waves diffracted at many
    edges, even if each pulse alone is within its standard deviation.

    At most 200 pulses are used (assumed), because the pulses of one visit share their errors.

    Args:
        record: All pulses.
        rows: Rows of the pulses associated with the finding, shape (n,), n >= 1.
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
    """Return a mask over the numbers from 0 to the largest in `of`: True for those that occur in `some`."""
    occurs = np.zeros(of.max(initial=-1) + 1, dtype=np.bool_)
    occurs[some] = True
    return occurs


def _measured(
    finding: Finding, number: int, own: Rows, rows: Rows, assignment: Assignment, record: PulseRecord
) -> Finding:
    """Update the time of the last pulse, and the number, aperture, nearest range and level of the pulses in sight."""
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
    """Return the level of a finding, from its pulses in sight.

    If most of the pulses that point to a candidate are too weak for its level, the level is wrong: the position is not
    that of the source, and the map predicts the wrong attenuation. The weak pulses are then included, because the
    candidate would otherwise never be corrected.
    """
    weak = np.flatnonzero(assignment.is_too_weak[number])
    if finding.state != "confirmed" and weak.size > rows.size:
        rows = np.union1d(rows, weak)
    return float(np.quantile(assignment.level_db[number, rows], LEVEL_QUANTILE))


def _is_ghost(finding: Finding, present: Presence, rules: LocatingRules) -> bool:
    """Return whether a candidate is not detected where it should be, although its position is known well enough."""
    if not present.is_sure:
        return False
    is_missed = present.observed_s >= rules.ghost_observed_s and present.rate < rules.ghost_detection_rate
    return (is_missed and finding.semi_major_m < rules.ghost_semi_major_m) or present.silent_s >= rules.ghost_silent_s


def _is_where_the_array_was(finding: Finding, record: PulseRecord, rules: LocatingRules) -> bool:
    """Return whether the finding lies where the robot has been, so that no source can be there."""
    apart_m = float(np.linalg.norm(record.places_m - finding.position_m, axis=-1).min())
    return apart_m < rules.least_range_m and finding.semi_major_m <= rules.confirm_semi_major_m


def _stays_confirmed(finding: Finding, n_own: int, rate: float, rules: LocatingRules) -> bool:
    """Return whether a confirmed finding keeps at least half of the pulses and of the detection rate that confirm it.

    Pulses that may be multipath of other findings do not count. If these are the majority, the full number of
    confirming pulses must remain.
    """
    most_are_own = 2 * n_own >= finding.n_bearings
    least = rules.confirm_pulses // 2 if most_are_own else rules.confirm_pulses
    return finding.state == "confirmed" and n_own >= least and rate >= 0.5 * rules.confirm_detection_rate


def _meets(finding: Finding, n_own: int, present: Presence, rules: LocatingRules) -> bool:
    """Return whether a candidate meets every rule of confirmation with pulses that are not multipath of others.

    A candidate that was never observed from a place where it is in sight for certain must also have been observed for
    long.
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
