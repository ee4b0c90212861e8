"""Active: view each candidate along the way on which its ellipse is expected to be short enough soonest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from dirmusic import Finding
from dirmusic.angles import difference
from dirmusic.locating.finding import CHI2_95
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap
from pdpatrol.missions.policies.seek import Seek
from pdpatrol.missions.policies.viewpoints import LEAST_WAY_M, likely_place

FloatArray = NDArray[np.float64]

LEAST_BEARING_STD_RAD = np.radians(0.3)
"""Of the views along a metre of way (assumed): what reflections leave where array and pose are known exactly."""

LEAST_SINE = 0.05
"""Of an elevation (assumed): in the plane of the array strengths tell nothing of it, and more the higher it is."""

NEAREST_M, FARTHEST_M = 1.0, 10.0
"""From how near and from how far views are counted, on plan (assumed)."""

WITHIN_M = 0.6
"""Equipment in so much of the way at the candidate's end does not hide it: its position is not known better."""

KNOWN_M = 0.5
"""A candidate whose 95 % ellipse is no longer than this needs another side, not a smaller deviation (assumed)."""

EXPECTED_M = 0.4
"""Ways are taken to the end on which this is expected of it (assumed): what is driven is not what was expected."""

SPEED_SHARE, TURN_SHARE = 0.75, 0.6
"""Shares of its top speed and of its top yaw rate that the robot makes on its way to a view (assumed)."""

AHEAD_M = 0.7
"""So far along its way the robot heads when it starts (assumed)."""

NEW_VIEW_M = 0.6
"""From nearer to where the robot has been than this, a view tells nothing new (assumed): its errors are the same."""

STICK_S = 2.0
"""A way that takes so much longer than the best one is kept (assumed): each change of mind costs a turn."""


class Active(Seek):
    """As `Seek`, with the views that locate soonest."""

    def __init__(self) -> None:
        super().__init__()
        self._chosen: tuple[int, int] | None = None

    def viewpoint(
        self, target: Finding, pose: FloatArray, paths: ShortestPaths, site_map: SiteMap
    ) -> FloatArray | None:
        """The end of the way that takes least time of those on which the candidate gets known well enough.

        What is gathered along the way counts, not its end alone; of places where the robot has been, nothing does. The
        way chosen before is kept while it is nearly as good. For a candidate that is known well, and still is none that
        may be confirmed, and where no way is enough: a new side of it.
        """
        if target.semi_major_m <= KNOWN_M:
            return super().viewpoint(target, pose, paths, site_map)
        target_m = likely_place(target, pose, site_map)
        information = expected_information(site_map.centres_m, target_m, site_map)
        is_new = np.asarray(KDTree(self._views_m).query(site_map.centres_m)[0]) > NEW_VIEW_M
        gathered = paths.gather(information * is_new[:, np.newaxis, np.newaxis])
        after_m2 = np.asarray(np.linalg.inv(np.linalg.inv(target.covariance_m2) + gathered), dtype=np.float64)
        semi_major_m = _semi_major(after_m2[:, :2, :2])
        time_s = np.where(paths.length_m > LEAST_WAY_M, driving_time(paths, pose, site_map), np.inf)
        soonest_s = np.where(semi_major_m <= EXPECTED_M, time_s, np.inf)
        best = int(soonest_s.argmin())
        if not np.isfinite(soonest_s[best]):
            return super().viewpoint(target, pose, paths, site_map)
        if self._chosen is not None and self._chosen[0] == target.id:
            kept = self._chosen[1]
            if semi_major_m[kept] <= KNOWN_M and time_s[kept] <= soonest_s[best] + STICK_S:
                best = kept
        self._chosen = target.id, best
        return site_map.centres_m[best]


def driving_time(paths: ShortestPaths, pose: FloatArray, site_map: SiteMap) -> FloatArray:
    """Seconds to each cell from a pose (3,), with the turn at the start; shape (n_cells,), infinite without a way."""
    away_m = site_map.centres_m[paths.along(AHEAD_M)] - pose[:2]
    turn_rad = np.abs(difference(np.arctan2(away_m[:, 1], away_m[:, 0]), pose[2])) * (paths.length_m >= AHEAD_M)
    robot = site_map.robot
    return paths.length_m / (SPEED_SHARE * robot.max_speed_mps) + turn_rad / (TURN_SHARE * robot.max_yaw_rate_radps)


def expected_information(places_m: FloatArray, target_m: FloatArray, site_map: SiteMap) -> FloatArray:
    """Information on a candidate's position that a metre of way about each place gives, shape (n, 3, 3), per m^2.

    Bearings tell its place across, and strengths its elevation, the better the higher it is, as well as array and pose
    are known. Nothing comes from where the map hides it.

    Args:
        places_m: On the ground, shape (n, 2), world frame.
        target_m: Where it is taken to be, shape (3,).
        site_map: What hides it, how high the array is, and how well array and pose are known.
    """
    sight_m = target_m[:2] - places_m
    plan_m = np.maximum(np.linalg.norm(sight_m, axis=-1), NEAREST_M)
    rise_m = target_m[2] - site_map.antenna_height_m
    range_m = np.hypot(plan_m, rise_m)
    ahead = sight_m / plan_m[:, np.newaxis]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(places_m))])
    sine, cosine = rise_m / range_m, plan_m / range_m
    upward = np.column_stack([-sine[:, np.newaxis] * ahead, cosine])
    bearing_std_rad, position_m2 = max(site_map.bearing_std_rad, LEAST_BEARING_STD_RAD), site_map.position_std_m**2
    elevation_std_rad = bearing_std_rad / np.maximum(np.abs(sine), LEAST_SINE)
    by_bearing = 1.0 / (np.square(bearing_std_rad * plan_m) + position_m2)
    by_strength = 1.0 / (np.square(elevation_std_rad * range_m) + position_m2)
    counts = plan_m < FARTHEST_M
    counts[counts] = site_map.in_sight(places_m[counts], target_m, WITHIN_M)
    information = np.einsum("n,ni,nj->nij", by_bearing * counts, across, across)
    return information + np.einsum("n,ni,nj->nij", by_strength * counts, upward, upward)


def _semi_major(covariance_m2: FloatArray) -> FloatArray:
    """Longer half-axes of the 95 % ellipses of covariances (n, 2, 2), shape (n,)."""
    return np.sqrt(CHI2_95 * np.linalg.eigvalsh(covariance_m2)[:, 1])
