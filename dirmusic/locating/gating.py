"""Comparison of pulses with one finding: offset in direction, level, and the propagation path of a pulse.

Behind equipment, every pulse is diffracted or reflected, and all pulses consistently point to a wrong position. Two
observations reveal this: the map, if there is one, because a reflector stands between the robot and the mirror image;
and the strength, because strength times range is the same for all pulses on the direct path.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from dirmusic.angles import difference
from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.locating.finding import Finding
from dirmusic.locating.pulse_record import LEAST_RANGE_M, PulseRecord, Rows
from dirmusic.locating.rules import AssignmentRules

NEAR_FIELD_SHARE = 0.5
"""Distance by which a far-field bearing may miss a nearby source, as a fraction of the array's radius (assumed)."""

MAX_POSITION_RAD = np.radians(15.0)
"""Upper limit of the bearing's standard deviation due to the uncertainty of both positions (assumed). Without it, a
poorly located finding that is close to the robot would attract the pulses from every direction."""

ELEVATION_MARGIN_RAD = np.radians(25.0)
"""Largest elevation above a finding that the best fit of its own pulse may have (assumed), because of array errors and
a height that is not known yet."""


class ExpectedBearings(NamedTuple):
    """Bearings at which a finding is expected; every array has n rows.

    Attributes:
        sight_m: Vector from the middle of the array to the finding, shape (n, 3), world frame.
        range_m: Horizontal length of that vector, at least `LEAST_RANGE_M`.
        bearing_rad: Bearing that an estimator in the plane would return, world frame.
        position_rad2: Variance of the bearing due to the error of the robot's position and the size of the array.
        elevation_rad2: Variance of the bearing due to unknown properties of the elements off the plane.
    """

    sight_m: FloatArray
    range_m: FloatArray
    bearing_rad: FloatArray
    position_rad2: FloatArray
    elevation_rad2: FloatArray


def expect_bearings(record: PulseRecord, rows: Rows | slice, finding: Finding) -> ExpectedBearings:
    """Compute the bearings at which a finding is expected from the poses of some pulses."""
    pose = record.pose[rows]
    sight_m = np.empty_like(pose)
    sight_m[:, :2] = finding.position_m[:2] - pose[:, :2]
    sight_m[:, 2] = finding.position_m[2] - record.array.height_m
    range_m = np.maximum(np.hypot(sight_m[:, 0], sight_m[:, 1]), LEAST_RANGE_M)
    towards_rad = np.arctan2(sight_m[:, 1], sight_m[:, 0])
    elevation_rad = np.arctan2(sight_m[:, 2], range_m)
    by_elevation_rad, elevation_rad2 = record.errors_by_elevation(towards_rad - pose[:, 2], elevation_rad)
    return ExpectedBearings(
        sight_m,
        range_m,
        towards_rad + by_elevation_rad,
        position_rad2=(record.pose_error.position_m**2 + (NEAR_FIELD_SHARE * record.aperture_m) ** 2) / range_m**2,
        elevation_rad2=elevation_rad2,
    )


class JudgedPulses(NamedTuple):
    """Pulses compared with one finding, shape (n,), or with several, shape (n_findings, n).

    Attributes:
        offset_sigmas: Offset of the bearing from the finding, in standard deviations due to bearing and positions;
            infinite for pulses that come from above the finding and for diffracted ones.
        log_likelihood: Logarithm of the normal density of that offset, up to a constant.
        level_db: Level 1 m from the finding, computed from the strength of the pulses of the same time and direction,
            dB relative to 1 V, corrected for the attenuation of the map if the finding is in sight.
        is_direct: True if the pulse would have come on the direct path if it came from this finding, according to the
            map or to its level.
        is_ghost: True if the pulse may have been diffracted or reflected while the finding was obstructed.
        is_diffracted: True if the pulse points to the finding but is too weak for its range.
        is_biased: True if the bearing of a pulse on the direct path may be biased by a reflection within the gate.
    """

    offset_sigmas: FloatArray
    log_likelihood: FloatArray
    level_db: FloatArray
    is_direct: BoolArray
    is_ghost: BoolArray
    is_diffracted: BoolArray
    is_biased: BoolArray

    @classmethod
    def stacked(cls, judged: Sequence[Self]) -> Self:
        """Stack the results of several findings, so that every array has the shape (n_findings, n)."""
        columns: list[Any] = [np.array(column) for column in zip(*judged, strict=True)]
        return cls(*columns)

    def continued(self, n: int, later: JudgedPulses) -> JudgedPulses:
        """Append later pulses to the first n of these."""
        columns: list[Any] = [np.concatenate([column[:n], more]) for column, more in zip(self, later, strict=True)]
        return JudgedPulses(*columns)


def judge_pulses(
    record: PulseRecord, rows: slice, finding: Finding, error_rad: FloatArray, rules: AssignmentRules
) -> JudgedPulses:
    """Compare some pulses with one finding.

    Until the level of a finding is known, only direction and map are used.

    Args:
        record: All pulses.
        rows: Rows of the pulses to compare.
        finding: The finding.
        error_rad: Table of known bearing errors, see `PulseRecord.error_table`.
        rules: Gate in bearing, and limits of the level.
    """
    bearing_rad, bearing_std_rad = record.bearings(rows, error_rad)
    place, expected = record.place[rows], expect_bearings(record, rows, finding)
    sight, range_m = expected.sight_m, expected.range_m
    across = np.stack([-sight[:, 1], sight[:, 0]], axis=-1) / range_m[:, np.newaxis]
    position_m2 = np.einsum("ni,ij,nj->n", across, finding.covariance_m2[:2, :2], across)
    position_rad2 = np.minimum(expected.position_rad2 + position_m2 / range_m**2, MAX_POSITION_RAD**2)
    std = np.sqrt(bearing_std_rad**2 + position_rad2 + expected.elevation_rad2)
    offset_rad = np.abs(difference(bearing_rad, expected.bearing_rad))
    elevation_rad = np.arctan2(np.abs(sight[:, 2]), range_m)
    is_too_high = record.is_from_above[rows] & (record.elevation_rad[rows] - elevation_rad > ELEVATION_MARGIN_RAD)
    offset_sigmas = np.where(is_too_high, np.inf, offset_rad / std)
    in_gate = offset_sigmas <= rules.gate_sigmas

    transmission = record.transmission_at_heights(finding, rules.surface_depth_m).max(axis=0)
    least = 10 ** (-rules.sight_loss_db / 20)
    loss_db = -20 * np.log10(np.maximum(transmission, least))
    in_sight = transmission >= least
    level_db = record.local_level_db(rows) + record.level_at_one_metre(sight) + (in_sight * loss_db)[place]

    excess_db, is_direct = level_db - finding.level_db, in_sight[place]
    is_diffracted = in_gate & (excess_db < -rules.obstruction_db)
    is_ghost, is_biased = is_diffracted, np.zeros(excess_db.size, dtype=np.bool_)
    if finding.state == "confirmed":
        is_direct = is_direct | (in_gate & (excess_db > -rules.direct_path_db))
        is_clear = is_direct & _is_clear_of_edges(record, finding, rules)[place]
        is_ghost = is_diffracted | (~is_clear & (excess_db < rules.ghost_db))
        is_biased = is_direct & (offset_rad < rules.bias_arc_rad) & (np.abs(excess_db) < rules.bias_db)
    return JudgedPulses(
        offset_sigmas=np.where(is_diffracted, np.inf, offset_sigmas),
        log_likelihood=-0.5 * np.square(offset_sigmas) - np.log(std),
        level_db=level_db,
        is_direct=is_direct,
        is_ghost=is_ghost,
        is_diffracted=is_diffracted,
        is_biased=is_biased,
    )


def _is_clear_of_edges(record: PulseRecord, finding: Finding, rules: AssignmentRules) -> BoolArray:
    """Return, for each place, whether the finding and points slightly to each side of it are unattenuated.

    Returns:
        Shape (n_places,).
    """
    clear, least = np.ones(len(record.places_m), dtype=np.bool_), 10 ** (-rules.clear_loss_db / 20)
    for aside in ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]):
        target_m = finding.position_m + rules.edge_margin_m * np.array(aside)
        clear &= record.transmission(target_m, rules.surface_depth_m + rules.edge_margin_m) >= least
    return clear
