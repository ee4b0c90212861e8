"""Places in a yard as longitude and latitude on WGS 84, and back."""

import numpy as np
from pyproj import Proj

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.map import GeoreferenceConfig


def longitude_latitude(places_m: FloatArray, reference: GeoreferenceConfig) -> FloatArray:
    """Convert places in the yard, shape (..., 2 or more), to longitude and latitude on WGS 84, degrees, (..., 2)."""
    # East and north of the origin, as real and imaginary part.
    turned_m = (places_m[..., 0] + 1j * places_m[..., 1]) * np.exp(-1j * np.radians(reference.heading_deg))
    return np.array(_ground(reference)(turned_m.real, turned_m.imag, inverse=True)).T.round(8)  # to the millimetre


def places_in_yard(longitude_latitude_deg: FloatArray, reference: GeoreferenceConfig) -> FloatArray:
    """Convert longitude and latitude on WGS 84, degrees, shape (n, 2), to places in the yard, metres, (n, 2)."""
    east_m, north_m = _ground(reference)(*longitude_latitude_deg.T)
    turned_m = (east_m + 1j * north_m) * np.exp(1j * np.radians(reference.heading_deg))
    return np.column_stack([turned_m.real, turned_m.imag])


def _ground(reference: GeoreferenceConfig) -> Proj:
    return Proj(proj="aeqd", lat_0=reference.latitude_deg, lon_0=reference.longitude_deg, ellps="WGS84")
