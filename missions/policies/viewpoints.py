"""Viewpoints: places from which to view a candidate from another side, and the value of a view.

A single bearing says little about distance; bearings that differ by 60 degrees give a small ellipse. `best_viewpoint`
weighs the new angle that a place adds against the path to it, both in metres; `expected_information` is the information
on the candidate's position per metre of path.
"""

import numpy as np

from dirmusic import Finding
from dirmusic.angles import azimuth_of, difference, unit_vector
from dirmusic.arrays import FloatArray
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap

MAX_ELEVATION_RAD = np.radians(35.0)
"""Elevation of a candidate above which it is not viewed if the pattern is known in the horizontal plane only. Assumed;
bearings with the computed helices are off by 4 degrees at 30 degrees of elevation, by 40 at 45."""

MIN_PATH_M = 0.5
"""Path length below which a place does not count as another view. Assumed."""


def likely_place(target: Finding, pose: FloatArray, site_map: SiteMap) -> FloatArray:
    """Return the mean position (3,) of a candidate over its possible distances from a pose (3,), inside the fence.

    Bearings determine the inverse of a distance r: with a standard deviation s, 1 / r is normal with s / r^2, so a
    candidate that seems near may be far. The prior is uniform along the line of sight. The distance is at least 1 cm,
    so that a candidate at the position of the robot has a direction.
    """
    sight_m = target.position_m[:2] - pose[:2]
    range_m = max(np.linalg.norm(sight_m), 0.01)
    std_m = np.sqrt(sight_m @ target.covariance_m2[:2, :2] @ sight_m) / range_m
    sigmas = np.linspace(-3.0, 3.0, 121)
    share = 1.0 + sigmas * std_m / range_m  # factor of the inverse distance
    sigmas, longer = sigmas[share > 0.0], 1.0 / share[share > 0.0]
    is_inside = site_map.yard.contains(pose[:2] + np.multiply.outer(longer, sight_m))
    weights = np.exp(-0.5 * np.square(sigmas)) * np.square(longer) * is_inside
    if not is_inside.any():
        return target.position_m
    mean = np.average(longer, weights=weights)
    return np.append(pose[:2] + mean * sight_m, target.position_m[2])


def best_viewpoint(target_m: FloatArray, views_m: FloatArray, paths: ShortestPaths) -> FloatArray | None:
    """Return a place near a candidate that views it from a new side over a short path, else a sidestep.

    Viewpoints surround the candidate every 15 degrees at horizontal distances from 1.8 to 3.5 m, or farther if the
    pattern is not known above `MAX_ELEVATION_RAD`: near enough to confirm it, clear of its equipment. They add at least
    15 degrees of new angle and have a line of sight, whose last half metre does not count, because an estimate may lie
    inside the surface. All assumed.

    Args:
        target_m: The candidate, shape (3,), world frame.
        views_m: Places from which it has been viewed, shape (n, 2), n at least 1.
        paths: Shortest paths from the robot.

    Returns:
        Shape (2,), world frame; None if no place adds an angle.
    """
    site_map = paths.site_map
    radii_m, aspects_rad = np.array([1.8, 2.3, 2.9, 3.5]), np.radians(np.arange(0.0, 360.0, 15.0))
    if not site_map.knows_pattern_above:
        least_m = abs(target_m[2] - site_map.antenna_height_m) / np.tan(MAX_ELEVATION_RAD)
        radii_m = radii_m + max(least_m - radii_m[0], 0.0)
    ring = target_m[:2] + np.multiply.outer(radii_m, unit_vector(aspects_rad)).reshape(-1, 2)
    ring = ring[site_map.yard.contains(ring)]
    ring = ring[site_map.clearance(ring) > site_map.robot.footprint_radius_m + 0.2]  # to stop and turn there (assumed)
    ring = ring[site_map.in_sight(ring, target_m, 0.5)]
    length_m = paths.length_m[site_map.nearest_free(ring)]
    new_rad = novelty(ring, target_m, views_m)
    cost_m = np.where((length_m > MIN_PATH_M) & (new_rad > np.radians(15.0)), length_m - worth(new_rad), np.inf)
    if np.isfinite(cost_m).any():
        return ring[cost_m.argmin()]
    return _sidestep(target_m, views_m, paths)


def _sidestep(target_m: FloatArray, views_m: FloatArray, paths: ShortestPaths) -> FloatArray | None:
    """Return the place nearby that adds the most angle, preferably with line of sight, for use without a viewpoint.

    Paths to sidesteps are 2 to 12 m long: shorter ones hardly change the angle, longer ones leave the candidate. A
    metre of path costs only 0.2 m, because sidesteps are far; line of sight is worth 2 m, and its last 1.5 m do not
    count, because a candidate that cannot be approached is located less accurately. All assumed.
    """
    near = np.flatnonzero((paths.length_m > 2.0) & (paths.length_m < 12.0))
    if near.size == 0:
        return None
    points = paths.site_map.centres_m[near]
    is_visible = paths.site_map.in_sight(points, target_m, 1.5)
    score_m = worth(novelty(points, target_m, views_m)) - 0.2 * paths.length_m[near] + 2.0 * is_visible
    return points[score_m.argmax()]


def novelty(points_m: FloatArray, target_m: FloatArray, views_m: FloatArray) -> FloatArray:
    """Return the angle at the target between each point (n, 2) and the nearest earlier view, shape (n,)."""
    earlier, aspect = azimuth_of(views_m - target_m[:2]), azimuth_of(points_m - target_m[:2])
    return np.abs(difference(aspect[:, np.newaxis], earlier)).min(axis=-1)


def worth(new_rad: FloatArray) -> FloatArray:
    """Return the path length that a new angle is worth, metres: 8 m from 60 degrees on, less below (assumed)."""
    most_rad = np.radians(60.0)
    return 8.0 * np.minimum(new_rad, most_rad) / most_rad


def driving_time(paths: ShortestPaths, pose: FloatArray) -> FloatArray:
    """Return the driving time from a pose (3,) to each cell, seconds, shape (n_cells,); infinite if unreachable.

    Assumed: 75 % of the top speed, 60 % of the top yaw rate, and a first turn towards the path 0.7 m ahead.
    """
    robot = paths.site_map.robot
    away_m = paths.site_map.centres_m[paths.cell_after(0.7)] - pose[:2]
    turn_rad = np.abs(difference(azimuth_of(away_m), pose[2])) * (paths.length_m >= 0.7)
    return paths.length_m / (0.75 * robot.max_speed_mps) + turn_rad / (0.6 * robot.max_yaw_rate_radps)


def expected_information(places_m: FloatArray, target_m: FloatArray, site_map: SiteMap) -> FloatArray:
    """Return the information on a candidate's position per metre of path at each place, shape (n, 3, 3), 1/m^2/m.

    Bearings determine the position across the line of sight; strengths determine the elevation, better at larger
    elevations. Both are as accurate as array and pose. Hidden places contribute nothing.

    Args:
        places_m: Places on the ground, shape (n, 2), world frame.
        target_m: Assumed position of the candidate, shape (3,).
        site_map: Map with lines of sight, height of the array, and accuracy of array and pose.
    """
    sight_m = target_m[:2] - places_m
    plan_m = np.maximum(np.linalg.norm(sight_m, axis=-1), 1.0)  # nearer views count as at 1 m (assumed)
    rise_m = target_m[2] - site_map.antenna_height_m
    range_m = np.hypot(plan_m, rise_m)
    ahead = sight_m / plan_m[:, np.newaxis]
    across = np.column_stack([-ahead[:, 1], ahead[:, 0], np.zeros(len(places_m))])
    sine, cosine = rise_m / range_m, plan_m / range_m
    upward = np.column_stack([-sine[:, np.newaxis] * ahead, cosine])
    # Assumed: at least 0.3 degrees, because reflections disturb all views along a metre of path alike.
    bearing_std_rad, position_m2 = max(site_map.bearing_std_rad, np.radians(0.3)), site_map.position_std_m**2
    # Strengths do not depend on the elevation in the plane of the array, where the sine is 0; the limit is assumed.
    elevation_std_rad = bearing_std_rad / np.maximum(np.abs(sine), 0.05)
    by_bearing = 1.0 / (np.square(bearing_std_rad * plan_m) + position_m2)
    by_strength = 1.0 / (np.square(elevation_std_rad * range_m) + position_m2)
    is_visible = plan_m < 10.0  # farther views do not count (assumed)
    # Equipment up to 0.6 m deep around a candidate does not hide it (assumed).
    is_visible[is_visible] = site_map.in_sight(places_m[is_visible], target_m, 0.6)
    axes, weights = np.stack([across, upward]), np.stack([by_bearing, by_strength]) * is_visible
    return np.einsum("kn,kni,knj->nij", weights, axes, axes)
