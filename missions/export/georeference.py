"""From the frame of a yard to longitude and latitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.scenario.map_section import GeoreferenceConfig

FloatArray = NDArray[np.float64]

SEMI_MAJOR_M, FLATTENING = 6_378_137.0, 1.0 / 298.257_223_563
"""Of the WGS 84 ellipsoid (NGA.STND.0036)."""


def longitude_latitude(places_m: FloatArray, reference: GeoreferenceConfig) -> FloatArray:
    """Places (..., 2 or more), x and y in the yard, as longitude and latitude, degrees, shape (..., 2).

    To first order in the distance from the origin, with the ellipsoid's radii of curvature there: north over the
    meridian's, east over that of the parallel. What is left out is below 1 cm at 200 m up to 60 degrees of latitude.
    """
    heading, latitude = np.radians(reference.heading_deg), np.radians(reference.latitude_deg)
    x, y = places_m[..., 0], places_m[..., 1]
    east, north = np.cos(heading) * x + np.sin(heading) * y, np.cos(heading) * y - np.sin(heading) * x
    square = FLATTENING * (2.0 - FLATTENING)
    swell = 1.0 - square * np.sin(latitude) ** 2
    meridian_m = SEMI_MAJOR_M * (1.0 - square) / swell**1.5
    parallel_m = SEMI_MAJOR_M / np.sqrt(swell) * np.cos(latitude)
    longitude_deg = reference.longitude_deg + np.degrees(east / parallel_m)
    return np.stack([longitude_deg, reference.latitude_deg + np.degrees(north / meridian_m)], axis=-1)
