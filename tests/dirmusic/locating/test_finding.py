"""A finding is a position that something can be done with."""

from dataclasses import replace

import numpy as np
import pytest

from dirmusic import Finding


def finding(position_m: np.ndarray, covariance_m2: np.ndarray) -> Finding:
    return Finding(
        id=3, state="candidate", position_m=position_m, covariance_m2=covariance_m2, n_bearings=1,
        first_detected_s=0.0, last_detected_s=0.0, confirmed_s=None, aperture_rad=0.0, nearest_m=1.0, level_db=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("position", "covariance", "fault"),
    [
        ([np.nan, 0.0, 0.0], np.eye(3), "position_m"),
        ([0.0, 0.0], np.eye(3), "position_m"),
        ([0.0, 0.0, 0.0], np.diag([1.0, 1.0, np.inf]), "covariance_m2"),
        ([0.0, 0.0, 0.0], np.ones(2), "covariance_m2"),
        ([0.0, 0.0, 0.0], np.diag([1.0, 1.0, -1.0]), "covariance_m2.*positive"),
    ],
)
def test_a_position_or_covariance_that_cannot_be_is_refused(
    position: list[float], covariance: np.ndarray, fault: str
) -> None:
    with pytest.raises(ValueError, match=f"finding 3: `{fault}"):
        finding(np.array(position), covariance)


@pytest.mark.parametrize("number", [0, -1])
def test_an_id_below_one_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match=f"`id` must be at least 1, got {number}"):
        replace(finding(np.zeros(3), np.eye(3)), id=number)


def test_a_longer_ellipse_has_a_longer_half_axis() -> None:
    assert finding(np.zeros(3), np.diag([4.0, 1.0, 9.0])).semi_major_m == pytest.approx(2 * np.sqrt(5.9915), rel=1e-4)
