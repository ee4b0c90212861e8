"""Active: view each candidate from where its covariance is expected to shrink most per second."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from missions.driving.site_map import ShortestPaths, SiteMap
from missions.policies.seek import MEAN_SPEED_SHARE, Seek

FloatArray = NDArray[np.float64]

BEARING_STD_RAD = np.radians(1.5)
"""Of the views along a metre of way, with what is not known of array and pose (assumed)."""

POSITION_STD_M = 0.05
"""Of the robot's place (assumed)."""

LEAST_SINE = 0.05
"""Of an elevation (assumed): in the plane of the array strengths tell nothing of it, and more the higher it is."""

NEAREST_M, FARTHEST_M = 1.0, 10.0
"""From how near and from how far views are counted, on plan (assumed)."""

WITHIN_M = 0.6
"""Equipment in so much of the way at the candidate's end does not hide it: its position is not known better."""

LONGEST_WAY_M = 15.0
"""Ways to a next view are no longer (assumed)."""

START_S = 3.0
"""What turning and starting takes (assumed)."""

KNOWN_M = 0.5
"""A candidate whose 95 % ellipse is no longer than this needs another side, not a smaller deviation (assumed)."""

LEAST_GAIN_MPS = 0.003
"""A view that shrinks the deviation by less in a second is none (assumed)."""


class Active(Seek):
    """As `Seek`, with views that are worth most."""

    def viewpoint(self, target: Finding, paths: ShortestPaths, site_map: SiteMap) -> FloatArray | None:
        """The place, by the way to which most of the candidate's deviation is expected to go per second.

        For a candidate that is known well, and still is none that may be confirmed, a new side of it.
        """
        if target.semi_major_m <= KNOWN_M:
            return super().viewpoint(target, paths, site_map)
        cells = np.flatnonzero(paths.length_m < LONGEST_WAY_M)
        information = np.zeros((len(site_map.centres_m), 3, 3))
        information[cells] = expected_information(site_map.centres_m[cells], target, site_map)
        gathered = paths.gather(cells, information)
        before = float(np.sqrt(np.trace(target.covariance_m2)))
        after = np.sqrt(np.trace(np.linalg.inv(np.linalg.inv(target.covariance_m2) + gathered), axis1=1, axis2=2))
        drive_s = paths.length_m[cells] / (MEAN_SPEED_SHARE * site_map.robot.max_speed_mps)
        gain_mps = (before - after) / (START_S + drive_s)
        best = int(gain_mps.argmax())
        if gain_mps[best] < LEAST_GAIN_MPS:
            return super().viewpoint(target, paths, site_map)
        return site_map.centres_m[cells[best]]


def expected_information(places_m: FloatArray, target: Finding, site_map: SiteMap) -> FloatArray:
    """Information on a candidate's position that a metre of way about each place gives, shape (n, 3, 3), per m^2.

    Bearings tell its place across, and strengths its elevation, the better the higher it is. Nothing comes from where
    the map hides it.

    Args:
        places_m: On the ground, shape (n, 2), world frame.
        target: The candidate.
        site_map: What hides it, and how high the array is.
    """
    sight_m = target.position_m[:2] - places_m
    plan_m = np.maximum(np.linalg.norm(sight_m, axis=-1), NEAREST_M)
    rise_m = target.position_m[2] - site_map.antenna_height_m
    range_m = np.hypot(plan_m, rise_m)
    ahead = sight_m / plan_m[:, np.newaxis]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(places_m))])
    sine, cosine = rise_m / range_m, plan_m / range_m
    upward = np.column_stack([-sine[:, np.newaxis] * ahead, cosine])
    elevation_std_rad = BEARING_STD_RAD / np.maximum(np.abs(sine), LEAST_SINE)
    by_bearing = 1.0 / (np.square(BEARING_STD_RAD * plan_m) + POSITION_STD_M**2)
    by_strength = 1.0 / (np.square(elevation_std_rad * range_m) + POSITION_STD_M**2)
    counts = (plan_m < FARTHEST_M) & site_map.in_sight(places_m, target.position_m, WITHIN_M)
    information = np.einsum("n,ni,nj->nij", by_bearing * counts, across, across)
    return information + np.einsum("n,ni,nj->nij", by_strength * counts, upward, upward)
