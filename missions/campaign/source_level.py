"""How loud and how frequent a discharge was in one inspection, as it left the source."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.rules import AssignmentRules, CredibilityRules
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.campaign.inspection import Inspection, Located
from pdpatrol.missions.campaign.product_limit import Distribution, product_limit
from pdpatrol.sensing.radio.transmission import Sight

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

NEAR_M, NEARER = 10.0, 1.5
"""Pulses from within this distance tell the level, or from within so many times the least distance where that is more:
farther away the ground and other mirrors bias it (measured: up to 4 dB beyond 15 m, 1 dB within 10 m)."""

LOOK_M = 1.0
"""Pulses from one square of the ground are one look: they fade together."""

ABOVE_FLOOR = 2.0
"""How far above the weakest credible pulse a pulse is detected and credible for certain, as a ratio (assumed)."""

WEAKEST_SHARE = 0.01
"""Of all pulses, those below which some were not triggered (assumed)."""

MOST_CLIPPED = 0.05
"""Share of clipped pulses, which are left out of locating, beyond which a look does not count."""

GROUPS = 12
"""Of looks, in the order in which the robot came to them, each of which is left out once for the spread."""

FADING_DB = 2.0
"""Standard deviation of the level of one look, at least (assumed; measured are 1 to 3 dB)."""

ARRAY_DB = 0.2
"""Standard deviation of the level by gain errors of all elements together: 5 % over the root of six."""

LEAST_LEVEL_PULSES = 20
"""That tell a level (assumed): as many as confirm a finding."""


class SourceLevel(NamedTuple):
    """A discharge as one inspection has it.

    Attributes:
        level_db: Strength that its pulses would have 1 m away, dB over 1 V, mean of the middle half.
        level_std_db: Its standard deviation: by fading, the position, and the gains of the array.
        rate_hz: Pulses a second that were told to be its own; of data from the field, where nobody knows for how long
            the receiver waited, pulses a pose.
        log_rate_std: Standard deviation of the natural logarithm of that.
        n_pulses: That tell it.
        n_looks: From so many squares of the ground.
    """

    level_db: float
    level_std_db: float
    rate_hz: float
    log_rate_std: float
    n_pulses: int
    n_looks: int


class Looks(NamedTuple):
    """Steps of an inspection in which a place was in sight and near; a row is a step.

    Attributes:
        step: Rows of the table `step`, shape (n,).
        look: Number of the look that each belongs to, in the order in which the robot came, shape (n,).
        duration_s: Of each step, shape (n,); 1 of data from the field.
        loss_db: What distance and gain take from a level of 1 m, shape (n,).
    """

    step: IntArray
    look: IntArray
    duration_s: FloatArray
    loss_db: FloatArray

    def take(self, rows: BoolArray) -> Looks:
        """Some of the steps; looks keep their numbers."""
        return Looks(self.step[rows], self.look[rows], self.duration_s[rows], self.loss_db[rows])


def loss_db(inspection: Inspection, position_m: FloatArray, pose: FloatArray) -> FloatArray:
    """What distance and the gain towards a place take from the strength of its pulses, dB over that 1 m away.

    Args:
        inspection: Whose array it is.
        position_m: Of the source, shape (3,), world frame.
        pose: Of the robot, shape (n, 3).
    """
    sight_m = position_m - np.column_stack([pose[:, :2], np.full(len(pose), inspection.array_height_m)])
    plan_m = np.linalg.norm(sight_m[:, :2], axis=-1)
    elevation_rad = np.arctan2(sight_m[:, 2], plan_m)
    azimuth_rad = np.arctan2(sight_m[:, 1], sight_m[:, 0]) - pose[:, 2]
    off_rad = azimuth_rad[:, np.newaxis] - inspection.manifold.boresights_rad
    gain = inspection.manifold.response_in_space(off_rad, elevation_rad[:, np.newaxis]).gain
    return 20 * np.log10(np.linalg.norm(sight_m, axis=-1) / np.linalg.norm(gain, axis=-1))


def floor_v(inspection: Inspection) -> float:
    """Strength above which pulses were triggered and credible for certain, volts; infinite where none were."""
    pulse, bearing = inspection.log.table("pulse"), inspection.log.table("bearing")
    if bearing["pulse"].size == 0:
        return np.inf
    strength_v = np.linalg.norm(pulse["strengths_v"], axis=-1)
    weakest_v = float(np.median(bearing["std_rad"] * strength_v[bearing["pulse"]])) / CredibilityRules().max_std_rad
    return max(ABOVE_FLOOR * weakest_v, float(np.quantile(strength_v, WEAKEST_SHARE)))


def looks_at(inspection: Inspection, position_m: FloatArray) -> Looks:
    """Where the robot had a place in sight and near."""
    step = inspection.log.table("step")
    pose, time_s = step["pose"], step["time_s"]
    duration_s = np.ones(time_s.size) if inspection.is_of_the_field else np.diff(time_s, prepend=0.0)
    range_m = np.linalg.norm(pose[:, :2] - position_m[:2], axis=-1)
    in_sight = _in_sight(inspection, position_m, pose)
    near_m = max(NEAR_M, NEARER * range_m[in_sight].min(initial=np.inf)) if in_sight.any() else 0.0
    rows = np.flatnonzero(in_sight & (range_m <= near_m))
    cells = np.floor(pose[rows, :2] / LOOK_M)
    _, first, of_cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    look = np.argsort(np.argsort(first))[np.asarray(of_cell).ravel()]
    return Looks(rows, look, duration_s[rows], loss_db(inspection, position_m, pose[rows]))


def _in_sight(inspection: Inspection, position_m: FloatArray, pose: FloatArray) -> BoolArray:
    """Whether a place is in sight by the map, shape (n,); without a map all is."""
    if inspection.yard is None:
        return np.ones(len(pose), dtype=np.bool_)
    rules = AssignmentRules()
    places_m = np.column_stack([pose[:, :2], np.full(len(pose), inspection.array_height_m)])
    sight = Sight(surroundings_of(inspection.yard))
    shares = sight(places_m, position_m, rules.surface_depth_m + rules.edge_margin_m)
    return shares >= 10 ** (-rules.clear_loss_db / 20)


class _Pulses(NamedTuple):
    """Pulses of one finding in looks at it, a row each.

    Attributes:
        level_db: As they left the source, dB over 1 V at 1 m, shape (n,).
        least_db: That would have been detected for certain there, shape (n,).
        look: Shape (n,).
    """

    level_db: FloatArray
    least_db: FloatArray
    look: IntArray


def source_level(inspection: Inspection, finding: Located) -> SourceLevel | None:
    """Level and rate of a finding; None where too few of its pulses came from near and in sight."""
    log = inspection.log
    association, step_of = log.table("association"), log.column("pulse", "step")
    looks = _not_clipped(inspection, looks_at(inspection, finding.position_m))
    row_of_step = np.full(log.n_rows("step"), -1)
    row_of_step[looks.step] = np.arange(looks.step.size)
    pulse = association["pulse"][association["finding"] == finding.id]
    row = row_of_step[step_of[pulse]]
    pulse, row = pulse[row >= 0], row[row >= 0]
    strength_db = 20 * np.log10(np.linalg.norm(log.column("pulse", "strengths_v")[pulse], axis=-1))
    pulses = _Pulses(
        strength_db + looks.loss_db[row], 20 * np.log10(floor_v(inspection)) + looks.loss_db[row], looks.look[row]
    )
    n_pulses = int((pulses.level_db >= pulses.least_db).sum())
    if n_pulses < LEAST_LEVEL_PULSES:
        return None
    numbers = np.unique(looks.look)
    level_db, rate_hz = _estimate(pulses, looks, np.ones(numbers.max() + 1, dtype=np.bool_))
    groups = np.array_split(numbers, min(GROUPS, numbers.size))
    left_out = np.array([_estimate(pulses, looks, _all_but(group, numbers)) for group in groups if numbers.size > 1])
    spread = np.zeros(2)
    if len(left_out) > 1:
        left_out = np.column_stack([left_out[:, 0], np.log(np.maximum(left_out[:, 1], 1e-9))])
        spread = np.sqrt((len(left_out) - 1) * np.nanmean(np.square(left_out - np.nanmean(left_out, axis=0)), axis=0))
    fading_db = FADING_DB / np.sqrt(numbers.size)
    by_place_db = _by_position(inspection, finding, log.column("step", "pose")[looks.step])
    return SourceLevel(
        level_db=level_db,
        level_std_db=float(np.sqrt(max(spread[0], fading_db) ** 2 + by_place_db**2 + ARRAY_DB**2)),
        rate_hz=rate_hz,
        log_rate_std=float(max(spread[1], 1.0 / np.sqrt(n_pulses))),
        n_pulses=n_pulses,
        n_looks=int(numbers.size),
    )


def _all_but(group: IntArray, numbers: IntArray) -> BoolArray:
    """Which looks count when a group of them is left out, by number."""
    counts = np.ones(numbers.max() + 1, dtype=np.bool_)
    counts[group] = False
    return counts


def _estimate(pulses: _Pulses, looks: Looks, counts: BoolArray) -> tuple[float, float]:
    """Level, dB, and rate, pulses a second, of the looks that count; each look counts alike, however long it was."""
    looks, kept = looks.take(counts[looks.look]), counts[pulses.look]
    pulses = _Pulses(pulses.level_db[kept], pulses.least_db[kept], pulses.look[kept])
    spent_s = np.bincount(looks.look, looks.duration_s, minlength=counts.size).astype(np.float64)
    distribution = product_limit(pulses.level_db, pulses.least_db, 1.0 / spent_s[pulses.look])
    if distribution.level_db.size == 0:
        return np.nan, np.nan
    return distribution.middle_db, _rate(pulses, spent_s, distribution)


def _rate(pulses: _Pulses, spent_s: FloatArray, distribution: Distribution) -> float:
    """Pulses a second at and above the lowest level that can be told, with those that were too weak where they came."""
    seen = pulses.level_db >= np.maximum(pulses.least_db, distribution.level_db[0])
    share_seen = np.maximum(distribution.above(pulses.least_db[seen]), 1e-3)
    return float((1.0 / share_seen).sum() / spent_s.sum())


def _not_clipped(inspection: Inspection, looks: Looks) -> Looks:
    """The looks without those in which pulses were beyond full scale, unless they all were."""
    pulse = inspection.log.table("pulse")
    n_steps, n_looks = inspection.log.n_rows("step"), int(looks.look.max(initial=-1)) + 1
    n_pulses = np.bincount(pulse["step"], minlength=n_steps)[looks.step]
    n_clipped = np.bincount(pulse["step"], pulse["is_clipped"], minlength=n_steps)[looks.step]
    of_look = [np.bincount(looks.look, n, minlength=n_looks) for n in (n_clipped, n_pulses)]
    keep = (of_look[0] <= MOST_CLIPPED * of_look[1])[looks.look]
    return looks.take(keep) if keep.any() else looks


def _by_position(inspection: Inspection, finding: Located, pose: FloatArray) -> float:
    """Standard deviation of the level by that of the position, dB: the mean change along each axis of its ellipsoid."""
    variances, axes = np.linalg.eigh(finding.covariance_m2)
    here = loss_db(inspection, finding.position_m, pose)
    shifts_m = (np.sqrt(np.maximum(variances, 0.0)) * axes).T
    changes = [np.mean(loss_db(inspection, finding.position_m + shift_m, pose) - here) for shift_m in shifts_m]
    return float(np.linalg.norm(changes))
