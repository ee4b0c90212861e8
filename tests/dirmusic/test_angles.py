"""Angles and directions."""

import numpy as np
import pytest

from dirmusic.angles import azimuth_of, unit_vector, wrap


def test_azimuth_of_unit_vector_is_its_angle() -> None:
    angle_rad = np.linspace(-7.0, 7.0, 100)
    vector = unit_vector(angle_rad)
    assert np.linalg.norm(vector, axis=-1) == pytest.approx(np.ones(100))
    np.testing.assert_allclose(azimuth_of(3.0 * vector), wrap(angle_rad), atol=1e-12)
