"""Viewpoints: where to go to see a candidate from another side.

A bearing says little of the distance; bearings from sides 60 degrees apart give a small ellipse. So a place is worth
the new angle that it adds to the views already had, and costs the way there; both are counted in metres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from dirmusic.angles import difference
from pdpatrol.missions.driving.site_map import ShortestPaths, SiteMap

FloatArray = NDArray[np.float64]

VIEW_RADII_M = np.array([1.8, 2.3, 2.9, 3.5])
VIEW_ASPECTS_RAD = np.radians(np.arange(0.0, 360.0, 15.0))
"""Viewpoints that are considered around a candidate (assumed): near enough to confirm, clear of its equipment."""

HIGHEST_VIEW_RAD = np.radians(35.0)
"""Where the pattern is known in the plane alone, viewpoints are no nearer to a candidate than where it is seen at this
elevation (assumed): of the computed helices, bearings are off by 4 degrees at 30 degrees of elevation, by 40 at 45."""

VIEW_ROOM_M = 0.2
"""Room about the robot at a viewpoint, to equipment, fence and obstacles (assumed): it can stop and turn there."""

ON_SURFACE_M = 0.5
"""Equipment this near to a candidate does not hide it (assumed): an estimate may lie a little inside its surface."""

NOVELTY_RAD = np.radians(60.0)
NOVELTY_WORTH_M = 8.0
"""A view that widens the aperture angle by 60 degrees is worth a detour of this length (assumed)."""

LEAST_NOVELTY_RAD = np.radians(15.0)
LEAST_WAY_M = 0.5
"""A viewpoint that is nearer than this, or adds less angle, is no other view (assumed)."""

LEAST_RANGE_M = 0.01
"""A candidate is taken to be no nearer (assumed): one that lies where the robot stands is in no direction."""

MOST_SIGMAS, N_PLACES = 3.0, 121
"""How far off a candidate may be, and how many places stand for that (assumed)."""

SIDESTEP_M = (2.0, 12.0)
"""Lengths of the way to a sidestep (assumed): shorter ones change no angle, longer ones leave the candidate."""

SIDESTEP_COST = 0.2
"""What a metre of way to a sidestep costs (assumed): a fifth of a metre to a viewpoint, for every sidestep is far."""

SIDESTEP_SIGHT_WORTH_M = 2.0
"""What sight of the candidate adds to a sidestep (assumed): as much as 10 m of way or 15 degrees of new angle."""

SIDESTEP_ON_SURFACE_M = 1.5
"""As `ON_SURFACE_M`, for a sidestep (assumed): more, because what cannot be approached is located worse."""


def likely_place(target: Finding, pose: FloatArray, site_map: SiteMap) -> FloatArray:
    """Where a candidate is, on average over its distance from a pose (3,) inside the fence; shape (3,).

    Bearings tell of a distance r as of its inverse: with a deviation s, 1 / r is normal with s / r^2, and what seems
    near may be far. Each metre of the line of sight is as likely before them.
    """
    sight_m = target.position_m[:2] - pose[:2]
    range_m = max(float(np.linalg.norm(sight_m)), LEAST_RANGE_M)
    std_m = float(np.sqrt(sight_m @ target.covariance_m2[:2, :2] @ sight_m)) / range_m
    off = np.linspace(-MOST_SIGMAS, MOST_SIGMAS, N_PLACES)
    share = 1.0 + off * std_m / range_m  # of the inverse
    off, longer = off[share > 0.0], 1.0 / share[share > 0.0]
    is_inside = site_map.yard.contains(pose[:2] + np.multiply.outer(longer, sight_m))
    if not is_inside.any():
        return target.position_m
    mean = np.average(longer[is_inside], weights=(np.exp(-0.5 * np.square(off)) * np.square(longer))[is_inside])
    return np.append(pose[:2] + mean * sight_m, target.position_m[2])


def best_viewpoint(
    target_m: FloatArray, views_m: FloatArray, paths: ShortestPaths, site_map: SiteMap
) -> FloatArray | None:
    """A place near a candidate that sees it from a new side and is not far to go, else a sidestep.

    Args:
        target_m: The candidate, shape (3,), world frame.
        views_m: Where it was viewed from so far, shape (n, 2), n at least 1.
        paths: Shortest paths from where the robot is.
        site_map: Where the robot fits.

    Returns:
        Shape (2,), world frame; None if no place adds an angle.
    """
    spokes = np.stack([np.cos(VIEW_ASPECTS_RAD), np.sin(VIEW_ASPECTS_RAD)], axis=-1)
    ring = target_m[:2] + np.multiply.outer(_view_radii(target_m, site_map), spokes).reshape(-1, 2)
    ring = ring[site_map.yard.contains(ring)]
    clearance_m = site_map.robot.footprint_radius_m + VIEW_ROOM_M
    ring = ring[site_map.clearance(ring) > clearance_m] if ring.size else ring
    ring = ring[site_map.in_sight(ring, target_m, ON_SURFACE_M)] if ring.size else ring
    length_m = paths.length_m[site_map.nearest_free(ring)]
    new_rad = novelty(ring, target_m, views_m)
    cost_m = np.where((length_m > LEAST_WAY_M) & (new_rad > LEAST_NOVELTY_RAD), length_m - worth(new_rad), np.inf)
    if cost_m.size and np.isfinite(cost_m.min()):
        return ring[cost_m.argmin()]
    return _sidestep(target_m, views_m, paths, site_map)


def _view_radii(target_m: FloatArray, site_map: SiteMap) -> FloatArray:
    """Distances on plan at which a candidate (3,) is to be viewed, metres."""
    if site_map.knows_pattern_above:
        return VIEW_RADII_M
    least_m = abs(target_m[2] - site_map.antenna_height_m) / np.tan(HIGHEST_VIEW_RAD)
    return VIEW_RADII_M + max(least_m - VIEW_RADII_M[0], 0.0)


def _sidestep(target_m: FloatArray, views_m: FloatArray, paths: ShortestPaths, site_map: SiteMap) -> FloatArray | None:
    """Where no viewpoint near the candidate can be had: the place nearby that adds most angle, at best in sight."""
    near = np.flatnonzero((paths.length_m > SIDESTEP_M[0]) & (paths.length_m < SIDESTEP_M[1]))
    if near.size == 0:
        return None
    points = site_map.centres_m[near]
    is_visible = site_map.in_sight(points, target_m, SIDESTEP_ON_SURFACE_M)
    gain_m = worth(novelty(points, target_m, views_m))
    score_m = gain_m - SIDESTEP_COST * paths.length_m[near] + SIDESTEP_SIGHT_WORTH_M * is_visible
    return points[score_m.argmax()]


def novelty(points_m: FloatArray, target_m: FloatArray, views_m: FloatArray) -> FloatArray:
    """Angle, seen from the target, between each point (n, 2) and the nearest view already had; shape (n,)."""
    views = views_m - target_m[:2]
    had = np.arctan2(views[:, 1], views[:, 0])
    aspect = np.arctan2(points_m[:, 1] - target_m[1], points_m[:, 0] - target_m[0])
    return np.abs(difference(aspect[:, np.newaxis], had)).min(axis=-1)


def worth(new_rad: FloatArray) -> FloatArray:
    """Length of way that a new angle is worth, metres; no more is gained beyond `NOVELTY_RAD`."""
    return NOVELTY_WORTH_M * np.minimum(new_rad, NOVELTY_RAD) / NOVELTY_RAD
