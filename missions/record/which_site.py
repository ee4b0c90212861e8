"""Probabilities that a finding is on a known site, elsewhere on a piece of equipment, or anywhere else in the yard."""

from collections.abc import Mapping

import numpy as np

from dirmusic.arrays import FloatArray
from dirmusic.locating.finding import draw_positions, log_density
from pdpatrol.missions.record.words import percent
from pdpatrol.robot_models.yard.solids import YardSolids
from pdpatrol.robot_models.yard.yard import Yard

ON_SITES, ON_EQUIPMENT = 0.8, 0.15
"""Prior probabilities of all known sites together, each equally likely, and of the surface of all equipment, uniformly
distributed. The rest is uniformly distributed in the yard. Assumed."""

ON_PIECE_STD_M = 0.05
"""Standard deviation of each coordinate of a site or surface relative to its piece. Assumed; with pieces 0.3 m off, the
first-named site is right equally often from 0 to 0.1 m."""

ELSEWHERE = "elsewhere"

LAYER_M = 0.125
"""Distance from a surface within which a place is on the piece of equipment. Assumed."""

ON_SITE_M = 0.1
"""Distance from a site within which a true source is on it. Sources are drawn exactly on sites, or at least 0.3 m away.
"""


def site_probabilities(
    yard: Yard, position_m: FloatArray, covariance_m2: FloatArray, map_accuracy_m: float
) -> dict[str, float]:
    """Return the probability of each place by name, in descending order; the probabilities add up to 1.

    Names are `equipment/site` for a site, `equipment` for another place on that piece, and `ELSEWHERE`. The unknown
    horizontal displacement of a piece, which its sites and its surface share, adds to the covariance of the finding.

    Args:
        yard: Yard as the map shows it.
        position_m: Position of the finding, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3).
        map_accuracy_m: Standard deviation of each horizontal coordinate of a piece on the map, `[map] accuracy_m`.
    """
    covariance = covariance_m2 + np.diag(np.square([map_accuracy_m, map_accuracy_m, 0.0]) + ON_PIECE_STD_M**2)
    sites = yard.site_names()
    volume_m3 = yard.size_m[0] * yard.size_m[1] * 5.0  # assumed: discharges are lower than 5 m
    weights = {ELSEWHERE: (1.0 - ON_SITES - ON_EQUIPMENT) / volume_m3}
    if sites:
        sites_m = np.array([yard.site_position(name) for name in sites])
        density = np.atleast_1d(np.exp(log_density(sites_m, position_m, covariance)))
        weights |= dict(zip(sites, (ON_SITES / len(sites) * density).tolist(), strict=True))
    if yard.equipment:
        by_solid = ON_EQUIPMENT * _surface_density(yard.solids, position_m, covariance)
        by_piece = np.bincount(yard.owner, by_solid, len(yard.equipment)).tolist()
        weights |= dict(zip((item.name for item in yard.equipment), by_piece, strict=True))
    total = sum(weights.values())
    return {name: weight / total for name, weight in sorted(weights.items(), key=lambda entry: -entry[1])}


def true_place(yard: Yard, known: Yard, position_m: FloatArray) -> str:
    """Return the name that `site_probabilities` uses for a true position, shape (3,); for scores only.

    A place on a piece that the map does not show is elsewhere.

    Args:
        yard: True yard.
        known: Yard as the map shows it.
        position_m: Position of a source, shape (3,).
    """
    names = yard.site_names()
    place = min(names, key=lambda name: np.linalg.norm(yard.site_position(name) - position_m), default=ELSEWHERE)
    if not names or np.linalg.norm(yard.site_position(place) - position_m) > ON_SITE_M:
        distance_m = yard.solids.distance(position_m)
        is_on_piece = distance_m.min(initial=np.inf) < LAYER_M
        place = yard.equipment[yard.owner[distance_m.argmin()]].name if is_on_piece else ELSEWHERE
    return place if place.partition("/")[0] in {item.name for item in known.equipment} else ELSEWHERE


def _surface_density(solids: YardSolids, mean_m: FloatArray, covariance_m2: FloatArray) -> FloatArray:
    """Return the density, per cubic metre, of a position near the surface of each solid, shape (n_solids,).

    The density is the probability of the layer within `LAYER_M` of the solid's surface, divided by the volume of the
    layers of all solids. The error due to the quasi-random points is below 1 % of the highest density.
    """
    points_m = draw_positions(mean_m, covariance_m2, 12)
    is_near = (np.abs(solids.distance(points_m)) < LAYER_M) & (points_m[:, 2:] > 0.0)  # above the ground
    around_m = 4.0 * solids.half_size_m.sum(axis=1) + 2.0 * np.pi * solids.radius_m
    top_m2 = 4.0 * solids.half_size_m.prod(axis=1) + np.pi * np.square(solids.radius_m)
    area_m2 = around_m * (solids.top_m - solids.bottom_m) + top_m2
    return is_near.mean(axis=0) / (2.0 * LAYER_M * area_m2.sum())


def in_words(probabilities: Mapping[str, float]) -> str:
    """Describe the most likely place, and the second if it has 10 % or more.

    An example is `transformer_1/bushing_b 82 %, bushing_a 15 %`.
    """
    (first, probability), *others = probabilities.items()
    words = [f"{first} {percent(probability)}"]
    for other, probability in others[:1]:
        if probability >= 0.1:
            piece = first.partition("/")[0]
            words.append(f"{other.removeprefix(f'{piece}/')} {percent(probability)}")
    return ", ".join(words)
