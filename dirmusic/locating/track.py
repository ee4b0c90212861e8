"""Tracks: hypothetical sources with their state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from dirmusic.arrays import FloatArray
from dirmusic.locating.association import NO_COMPARISON, Comparison, Level
from dirmusic.locating.existence import OCCAM
from dirmusic.locating.finding import Finding, State, ellipse95
from dirmusic.locating.initiation import APART_M
from dirmusic.locating.joint_fit import LEVEL_PRIOR_DB
from dirmusic.locating.measurement import N_PLACE
from dirmusic.locating.two_sources import ONE_SOURCE, TwoSources

MOVED, GROWN = 0.1, 1.25
"""Squared Mahalanobis distance, and factor of the semi-major axis, by which a track may change before all pulses are
compared with it anew. Assumed; halving both changes no finding."""

TWINS_APART_M = 0.2
"""Distance within which two tracks are merged that have been split (assumed)."""


class Evidence(NamedTuple):
    """Log odds that a track is a source, by origin.

    Attributes:
        pulses: Directions and levels of its pulses.
        rate: Numbers of detections in the windows in which it was visible.
        image: All evidence against an image of a source with higher odds; infinity without one.
    """

    pulses: float = 0.0
    rate: float = 0.0
    image: float = np.inf


NO_EVIDENCE, UNKNOWN_LEVEL = Evidence(), Level(*LEVEL_PRIOR_DB)
NEVER_FITTED = NEVER_TESTED = (0.0, 0.0)


@dataclass(kw_only=True)
class Track:
    """A hypothetical source; it keeps its id from initiation to deletion.

    Attributes:
        id: Id of its finding.
        position_m: Position, world frame, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3).
        uncertainty: Covariance of the position and of the states of the array.
        initiated_s: Time of its initiation.
        first_s: Time of its first pulse.
        last_s: Time of its last pulse.
        direct: Probability that each group of pulses came from it on the direct path, shape (n,).
        multipath: Probability that each group came from it on another path, shape (n,).
        level: Level and its spread.
        state: State of its finding.
        confirmed_s: Time of its first confirmation.
        evidence: Evidence for its existence.
        log_odds: Log odds that it exists.
        aperture_rad: Angle over which its lines of sight spread.
        nearest_m: Least horizontal distance from which it was detected.
        n_pulses: Number of its pulses on the direct path.
        compared: Comparison of groups with it.
        n_compared: Number of leading groups whose comparison is up to date.
        fitted: Number of its groups and aperture at the last fit.
        two: Latest comparison with two sources.
        n_tested: Numbers of its groups and of others near it at that time.
        twin: Id of the track that was split off from it, or from which it was split off; 0 without one.
    """

    id: int
    position_m: FloatArray
    covariance_m2: FloatArray
    uncertainty: FloatArray
    initiated_s: float
    first_s: float
    last_s: float
    direct: FloatArray
    multipath: FloatArray
    level: Level = UNKNOWN_LEVEL
    state: State = "candidate"
    confirmed_s: float | None = None
    evidence: Evidence = NO_EVIDENCE
    log_odds: float = -OCCAM
    aperture_rad: float = 0.0
    nearest_m: float = np.inf
    n_pulses: int = 0
    compared: Comparison = NO_COMPARISON
    n_compared: int = 0
    fitted: tuple[float, float] = NEVER_FITTED
    two: TwoSources = ONE_SOURCE
    n_tested: tuple[float, float] = NEVER_TESTED
    twin: int = 0

    @property
    def semi_major_m(self) -> float:
        """Semi-major axis of the 95 % ellipse."""
        return ellipse95(self.covariance_m2[:2, :2]).semi_major_m

    @property
    def height_std_m(self) -> float:
        """Standard deviation of the height."""
        return float(np.sqrt(self.covariance_m2[2, 2]))

    @property
    def is_possibly_two(self) -> bool:
        """True if two sources explain its pulses better, but it has not been split."""
        return self.two.is_possible and not self.twin

    def move(
        self, position_m: FloatArray, covariance_m2: FloatArray, uncertainty: FloatArray, pose_std_m: float
    ) -> None:
        """Set a new position; all groups are compared anew if it differs considerably by its error and the poses'."""
        off_m, error_m2 = position_m - self.position_m, self.covariance_m2 + pose_std_m**2 * np.eye(N_PLACE)
        growth = ellipse95(covariance_m2[:2, :2]).semi_major_m / self.semi_major_m
        if off_m @ np.linalg.solve(error_m2, off_m) > MOVED or not 1.0 / GROWN < growth < GROWN:
            self.n_compared = 0
        self.position_m, self.covariance_m2, self.uncertainty = position_m, covariance_m2, uncertainty

    def finding(self) -> Finding:
        """Return the finding."""
        return Finding(
            id=self.id,
            state=self.state,
            position_m=self.position_m,
            covariance_m2=self.covariance_m2 + self.two.scatter_m2 * self.is_possibly_two,
            possibly_two=self.is_possibly_two,
            existence=float(expit(self.log_odds)),
            n_bearings=self.n_pulses,
            first_detected_s=self.first_s,
            last_detected_s=self.last_s,
            confirmed_s=self.confirmed_s,
            aperture_rad=self.aperture_rad,
            nearest_m=self.nearest_m,
            level_db=self.level.mean_db,
        )


def merge(tracks: list[Track], merge_m: float) -> list[Track]:
    """Merge tracks of one place: return those to keep, of which a confirmed one, or else the first, stands for all.

    Twins that are `APART_M` or more apart become separate tracks. A candidate that was initiated after a track had been
    confirmed is merged with it within that distance, because reflections cause such candidates.

    Args:
        tracks: All tracks; `twin` is changed.
        merge_m: Horizontal distance within which other tracks are merged.
    """
    places_m = {track.id: track.position_m[:2] for track in tracks}
    for track in tracks:
        if track.twin and np.linalg.norm(track.position_m[:2] - places_m[track.twin]) >= APART_M:
            track.twin = 0
    kept: list[Track] = []
    for track in sorted(tracks, key=lambda t: (t.state != "confirmed", t.id)):
        off_m = [np.linalg.norm((track.position_m - other.position_m)[:2]) for other in kept]
        if all(m >= _least_distance(track, other, merge_m) for m, other in zip(off_m, kept, strict=True)):
            kept.append(track)
    return kept


def _least_distance(track: Track, kept: Track, merge_m: float) -> float:
    """Return the distance within which a track is merged with another one that is kept."""
    if track.twin == kept.id:
        return TWINS_APART_M
    is_later = kept.confirmed_s is not None and kept.confirmed_s < track.initiated_s
    return APART_M if is_later and track.state == "candidate" else merge_m
