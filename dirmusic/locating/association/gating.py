"""Gating: how far each pulse is from a finding, in direction and in level."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.locating.association.pulse_record import LEAST_RANGE_M, Measurements, PulseRecord, Rows
from dirmusic.locating.finding import Finding
from dirmusic.locating.rules import AssignmentRules

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NEAR_FIELD_SHARE = 0.5
"""Share of the ring's radius by which a far-field bearing may miss a source close by (assumed)."""

WIDEST_POSITION_RAD = np.radians(15.0)
"""What the uncertainty of the positions may add to the deviation of a bearing at most (assumed): a finding that is not
known well, seen from close by, would take the pulses of every direction."""


ELEVATION_MARGIN_RAD = np.radians(25.0)
"""A pulse from above may fit best so far above a finding and still be its own (assumed): errors of the array, and a
height that is not known yet."""


class Gate(NamedTuple):
    """Pulses as seen by one finding; every array has shape (n,).

    Attributes:
        offset_rad: How far the bearing points past the finding, in [0, pi].
        offset_sigmas: The same in standard deviations of bearing and positions; infinite for pulses from above that
            came from higher than the finding is.
        log_likelihood: Logarithm of the normal density of that offset, but for a constant.
        level_db: Level 1 m from the finding that the strength of pulses of that time and direction means, dB over 1 V,
            what the map takes from a finding in sight made good.
        in_sight: Whether the map leaves the finding in sight from where the pulse was detected.
        in_gate: Whether the bearing points to the finding.
    """

    offset_rad: FloatArray
    offset_sigmas: FloatArray
    log_likelihood: FloatArray
    level_db: FloatArray
    in_sight: BoolArray
    in_gate: BoolArray


class ExpectedBearings(NamedTuple):
    """What a finding lets one expect of bearings; every array has n rows.

    Attributes:
        sight_m: From the middle of the array to the finding, shape (n, 3), world frame.
        range_m: Its length on plan, not below `LEAST_RANGE_M`.
        bearing_rad: World frame, as bearings are taken in the plane of the array.
        position_rad2: Variance of it by the robot's position, and by the size of the array.
        elevation_rad2: Variance of it by what is not known of elements off the plane.
    """

    sight_m: FloatArray
    range_m: FloatArray
    bearing_rad: FloatArray
    position_rad2: FloatArray
    elevation_rad2: FloatArray


def expect_bearings(record: PulseRecord, rows: Rows | slice, finding: Finding) -> ExpectedBearings:
    """Of a finding where it is taken to be, for some pulses."""
    pose = record.pose[rows]
    sight_m = np.empty_like(pose)
    sight_m[:, :2] = finding.position_m[:2] - pose[:, :2]
    sight_m[:, 2] = finding.position_m[2] - record.array.height_m
    range_m = np.maximum(np.linalg.norm(sight_m[:, :2], axis=-1), LEAST_RANGE_M)
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


def gate_pulses(
    record: PulseRecord, rows: slice, measured: Measurements, finding: Finding, rules: AssignmentRules
) -> Gate:
    """Compare some pulses, and what they say, with one finding."""
    place, expected = record.place[rows], expect_bearings(record, rows, finding)
    sight, range_m = expected.sight_m, expected.range_m
    across = np.stack([-sight[:, 1], sight[:, 0]], axis=-1) / range_m[:, np.newaxis]
    position_m2 = np.einsum("ni,ij,nj->n", across, finding.covariance_m2[:2, :2], across)
    position_rad2 = np.minimum(expected.position_rad2 + position_m2 / range_m**2, WIDEST_POSITION_RAD**2)
    std = np.sqrt(measured.std_rad**2 + position_rad2 + expected.elevation_rad2)
    offset_rad = np.abs(difference(measured.bearing_rad, expected.bearing_rad))
    elevation_rad = np.arctan2(np.abs(sight[:, 2]), range_m)
    is_too_high = record.is_from_above[rows] & (record.elevation_rad[rows] - elevation_rad > ELEVATION_MARGIN_RAD)
    offset_sigmas = np.where(is_too_high, np.inf, offset_rad / std)
    left = record.sight.at_heights(record.places_m, finding, rules.surface_depth_m).max(axis=0)
    least = 10 ** (-rules.sight_loss_db / 20)
    lost_db = -20 * np.log10(np.maximum(left, least))
    in_sight = left >= least
    return Gate(
        offset_rad=offset_rad,
        offset_sigmas=offset_sigmas,
        log_likelihood=-0.5 * np.square(offset_sigmas) - np.log(std),
        level_db=measured.local_level_db + record.level_at_one_metre(sight) + (in_sight * lost_db)[place],
        in_sight=in_sight[place],
        in_gate=offset_sigmas <= rules.gate_sigmas,
    )
