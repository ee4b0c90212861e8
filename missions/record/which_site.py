"""Probabilities that a finding is on each known site, elsewhere on each piece of equipment, or anywhere else."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import multivariate_normal

from pdpatrol.robot_models.yard.solids import YardSolids
from pdpatrol.robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

ON_SITES, ON_EQUIPMENT = 0.8, 0.15
"""Prior probabilities of the known sites, all equal, and of the surface of equipment, uniform; the rest is for anywhere
in the yard. Assumed."""

SURFACE_STEP_M = 0.25
"""Distance between the points that represent surfaces."""

ELSEWHERE = "elsewhere"


def site_probabilities(yard: Yard, position_m: FloatArray, covariance_m2: FloatArray) -> dict[str, float]:
    """Return the probabilities of all places, which add up to 1, the most likely first.

    Places are named `equipment/site`; `equipment` for another place on that piece; `ELSEWHERE`.

    Args:
        yard: Yard as the map shows it.
        position_m: Position of the finding, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3).
    """
    sites = yard.site_names()
    volume_m3 = yard.size_m[0] * yard.size_m[1] * 5.0  # discharges are below 5 m (assumed)
    weights = {ELSEWHERE: (1.0 - ON_SITES - ON_EQUIPMENT) / volume_m3}
    if sites:
        sites_m = np.array([yard.site_position(name) for name in sites])
        covariance = covariance_m2 + 0.05**2 * np.eye(3)  # sites are mapped within 5 cm (assumed)
        density = np.atleast_1d(multivariate_normal.pdf(sites_m, position_m, covariance))
        weights |= dict(zip(sites, (ON_SITES / len(sites) * density).tolist(), strict=True))
    if yard.equipment:
        points_m, owner = _surface(yard.solids, yard.owner)
        covariance = covariance_m2 + (0.5 * SURFACE_STEP_M) ** 2 * np.eye(3)
        density = multivariate_normal.pdf(points_m, position_m, covariance)
        of_piece = np.bincount(owner, ON_EQUIPMENT / len(points_m) * density, len(yard.equipment))
        weights |= dict(zip((item.name for item in yard.equipment), of_piece.tolist(), strict=True))
    total = sum(weights.values())
    ranked = sorted(weights.items(), key=lambda entry: -entry[1])
    return {name: weight / total for name, weight in ranked}


def percent(probability: float) -> str:
    """Return a probability as text, such as `82 %`, at most `> 99 %`."""
    if probability > 0.99:
        return "> 99 %"
    return "< 1 %" if probability < 0.01 else f"{100 * probability:.0f} %"


def in_words(probabilities: Mapping[str, float]) -> str:
    """Return the most likely place, and the second from 10 % on: `transformer_1/bushing_b 82 %, bushing_a 15 %`."""
    (first, probability), *others = probabilities.items()
    words = [f"{first} {percent(probability)}"]
    for other, probability in others[:1]:
        if probability >= 0.1:
            piece, _, site = other.partition("/")
            words.append(f"{site if site and piece == first.partition('/')[0] else other} {percent(probability)}")
    return ", ".join(words)


def _surface(solids: YardSolids, owner: NDArray[np.intp]) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return points spread evenly over the sides and tops of solids (n, 3), and the piece of each point (n,)."""
    points, of = list[FloatArray](), list[int]()
    for k in range(len(owner)):
        heights = _steps(float(solids.bottom_m[k]), float(solids.top_m[k]))
        half_x, half_y = solids.half_size_m[k] + solids.radius_m[k]
        if solids.radius_m[k] > 0.0:
            n_round = max(round(2 * np.pi * half_x / SURFACE_STEP_M), 4)
            angle = 2 * np.pi / n_round * np.arange(n_round)
            rim, top = half_x * np.column_stack([np.cos(angle), np.sin(angle)]), np.zeros((1, 2))
        else:
            x, y = _steps(-half_x, half_x), _steps(-half_y, half_y)
            rim = np.concatenate([_pairs(x, [-half_y, half_y]), _pairs([-half_x, half_x], y)])
            top = _pairs(x, y)
        sides = np.column_stack([np.repeat(rim, heights.size, axis=0), np.tile(heights, len(rim))])
        own = np.concatenate([sides, np.column_stack([top, np.full(len(top), solids.top_m[k])])])
        cos, sin = np.cos(solids.yaw_rad[k]), np.sin(solids.yaw_rad[k])
        turned = own[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + solids.centre_m[k]
        points.append(np.column_stack([turned, own[:, 2]]))
        of += [int(owner[k])] * len(own)
    return np.concatenate(points), np.array(of, dtype=np.intp)


def _pairs(x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Return all pairs of coordinates, shape (n, 2)."""
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _steps(low: float, high: float) -> FloatArray:
    """Return the midpoints of equal steps between two bounds."""
    n = max(round((high - low) / SURFACE_STEP_M), 1)
    return low + (high - low) / n * (np.arange(n, dtype=np.float64) + 0.5)
