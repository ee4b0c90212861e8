"""Sources above and below the array: height estimates, obstruction, and absence of pulses."""

import numpy as np
import pytest

from dirmusic import Locator, PulseBatch
from dirmusic.locating.locator import EDGE_M
from dirmusic.locating.protocol import LineOfSight
from tests.dirmusic.scenes import ARRAY, NO_POSE_ERROR, RING, around, detected, sights, with_bearings

NOISE_V = 1e-3
TANK_TOP_M = 2.0


def pulses_of(pose: np.ndarray, source_m: np.ndarray, gains: np.ndarray, rng: np.random.Generator) -> PulseBatch:
    """Make two pulses of a source in space, received by an array with gain errors."""
    azimuth, elevation, range_m = sights(pose[np.newaxis], source_m)
    gain = gains * RING.response_in_space(azimuth - RING.boresights_rad, elevation).gain
    strengths = np.abs(0.8 / range_m * gain + rng.normal(0.0, NOISE_V, (2, 6)))
    return with_bearings(detected(strengths, NOISE_V))


def drive_round(source_m: np.ndarray, seed: int, sight: LineOfSight | None = None) -> Locator:
    """Drive about a third of a circle around a source, and return the Locator."""
    rng = np.random.default_rng(seed)
    gains, start_deg = np.exp(rng.normal(0.0, 0.05, 6)), rng.uniform(0.0, 360.0)
    locator = Locator(ARRAY, NO_POSE_ERROR, sight=sight)
    for k, place in enumerate(around(source_m[:2], 3.0, start_deg, start_deg + 130.0, 200)):
        pose = np.array([*place, np.radians(start_deg + 90.0 + 0.65 * k) + 0.7 * np.sin(0.1 * k)])
        locator.update(0.1 * k, pose, pulses_of(pose, source_m, gains, rng))
    return locator


@pytest.mark.whole
@pytest.mark.parametrize("height_m", [1.8, 2.5, 3.8])
def test_height_error_agrees_with_its_deviation(height_m: float) -> None:
    source_m, errors, sigmas = np.array([10.0, 10.0, height_m]), list[float](), list[float]()
    for seed in range(8):
        (finding,) = drive_round(source_m, seed).findings
        errors.append(finding.position_m[2] - height_m)
        sigmas.append(errors[-1] / finding.height_std_m)
        assert finding.state == "confirmed"
    assert np.median(np.abs(errors)) < 0.15
    assert np.mean(np.abs(sigmas) < 2.0) >= 0.75


def over_the_tank(places_m: np.ndarray, target_m: np.ndarray, within_m: float) -> np.ndarray:
    """Return the transmission for a map with a tank that hides targets below `TANK_TOP_M` from all places."""
    return np.full(len(places_m), float(target_m[2] > TANK_TOP_M))


def test_paths_close_above_an_edge_make_the_position_less_certain() -> None:
    """A source 1 m above a tank has a larger covariance than without the tank, but not one 1.8 m above it."""
    for height_m, more_m in ((3.0, EDGE_M), (3.8, 0.0)):
        source_m = np.array([10.0, 10.0, height_m])
        (above,), (free,) = (drive_round(source_m, 1, sight).findings for sight in (over_the_tank, None))
        np.testing.assert_allclose(above.covariance_m2 - free.covariance_m2, more_m**2 * np.eye(3), atol=1e-4)


def test_source_on_a_tank_is_confirmed_but_not_inside() -> None:
    on_top, inside = (
        [finding.state for finding in drive_round(np.array([10.0, 10.0, height_m]), 1, over_the_tank).findings]
        for height_m in (3.8, 1.2)
    )
    assert on_top == ["confirmed"]
    assert "confirmed" not in inside
