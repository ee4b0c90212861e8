"""Calibration by turning on the spot removes the manifold error and states what remains."""

import numpy as np
import pytest

from dirmusic import ElementErrors, ElementSpread, GainManifold, calibrate, estimate_bearings
from dirmusic.angles import difference
from pdpatrol.missions.reproduction.simulation import energy_to_noise

RING = GainManifold.ring(6)
QUARTERS = np.radians([90.0, 90.0, 90.0])
HALF_WIDTH = 0.1
STD = HALF_WIDTH / np.sqrt(3)
SPREADS = {"factor": ElementSpread(gain=STD), "offset": ElementSpread(offset=STD)}
BOTH = ElementSpread(gain=STD, offset=STD)


def draw_array(kind: str, rng: np.random.Generator) -> GainManifold:
    """Draw an array with uniform errors, where the calibration assumes normal ones."""
    error, none = rng.uniform(-HALF_WIDTH, HALF_WIDTH, 6), np.zeros(6)
    given = (error, none) if kind == "factor" else (none, error)
    return ElementErrors(gain=given[0], pointing_rad=none, offset=given[1]).correct(RING)


def turn_on_the_spot(
    true: GainManifold, azimuth_rad: float, n_pulses: int, rng: np.random.Generator, turn_std_rad: float = 0.0
) -> np.ndarray:
    """Draw strengths (4, n_pulses, 6) of one source at 0 dB in unit noise."""
    heading = np.concatenate([[0.0], np.cumsum(QUARTERS + rng.normal(0.0, turn_std_rad, 3))])
    amplitude = np.sqrt(energy_to_noise(0.0))
    clean = amplitude * true.gain(azimuth_rad - heading).T[:, np.newaxis, :]
    return np.abs(clean + rng.standard_normal((4, n_pulses, 6)))


def rms_deg(errors: list[float]) -> float:
    return float(np.degrees(np.sqrt(np.mean(np.square(errors)))))


@pytest.mark.parametrize("kind", ["factor", "offset"])
@pytest.mark.parametrize(("turn_std_deg", "most_deg"), [(0.0, 0.35), (0.2, 0.5)])
@pytest.mark.parametrize("prior", ["of the kind", "of both kinds"])
def test_four_quarter_turns_remove_manifold_error(kind: str, turn_std_deg: float, most_deg: float, prior: str) -> None:
    rng = np.random.default_rng(1)
    spread = SPREADS[kind] if prior == "of the kind" else BOTH
    turn_std = np.radians(turn_std_deg)
    source, fresh, before, normalised, remaining = [], [], [], [], []
    for _ in range(120):
        true, azimuth = draw_array(kind, rng), rng.uniform(-np.pi, np.pi)
        strengths = turn_on_the_spot(true, azimuth, 1, rng, turn_std)
        result = calibrate(strengths, QUARTERS, RING, spread, strength_variance=1.0, turn_std_rad=turn_std)
        source.append(float(difference(result.azimuth_rad, azimuth)))
        normalised.append(source[-1] / result.std_rad)
        elsewhere = rng.uniform(-np.pi, np.pi, 20)
        clean = np.abs(true.gain(elsewhere)).T[:, np.newaxis]
        fresh += list(difference(estimate_bearings(clean, result.manifold).azimuth_rad, elsewhere))
        before += list(difference(estimate_bearings(clean, RING).azimuth_rad, elsewhere))
        remaining.append(result.remaining_rad)
    assert rms_deg(before) > 2.0
    assert rms_deg(source) <= most_deg
    assert rms_deg(fresh) <= most_deg
    assert np.mean(np.square(normalised)) == pytest.approx(1.0, abs=0.35)
    assert rms_deg(remaining) == pytest.approx(rms_deg(fresh), rel=0.3)


def test_pointing_errors_are_found_up_to_a_rotation() -> None:
    rng = np.random.default_rng(2)
    spread = ElementSpread(pointing_rad=np.radians(2.0))
    pointing = rng.normal(0.0, spread.pointing_rad, 6)
    true = ElementErrors(gain=np.zeros(6), pointing_rad=pointing, offset=np.zeros(6)).correct(RING)
    turns = np.full(11, np.radians(30.0))
    heading = np.concatenate([[0.0], np.cumsum(turns)])
    strengths = 1000 * true.gain(0.3 - heading).T[:, np.newaxis]
    result = calibrate(strengths, turns, RING, spread, strength_variance=1.0)
    found = result.errors.pointing_rad
    np.testing.assert_allclose(found - found.mean(), pointing - pointing.mean(), atol=np.radians(0.1))
    left = np.degrees(spread.pointing_rad / np.sqrt(6))  # a rotation of the whole array cannot be observed
    assert np.degrees(result.std_rad) == pytest.approx(left, rel=0.05)
    assert np.degrees(result.remaining_rad) == pytest.approx(left, rel=0.05)


def test_more_pulses_reduce_deviation_in_any_order() -> None:
    rng = np.random.default_rng(3)
    true = draw_array("factor", rng)
    strengths = turn_on_the_spot(true, 1.0, 50, rng)
    many = calibrate(strengths, QUARTERS, RING, SPREADS["factor"], strength_variance=1.0)
    turned = calibrate(strengths[:, ::-1], QUARTERS, RING, SPREADS["factor"], strength_variance=1.0)
    one = calibrate(strengths[:, :1], QUARTERS, RING, SPREADS["factor"], strength_variance=1.0)
    assert many.std_rad < 0.5 * one.std_rad
    assert many.azimuth_rad == pytest.approx(turned.azimuth_rad, abs=1e-9)


def silent_heading() -> np.ndarray:
    strengths = np.ones((4, 1, 6))
    strengths[2] = 0.0
    return strengths


@pytest.mark.parametrize(
    ("strengths", "turns", "message"),
    [
        (np.ones((1, 1, 6)), np.empty(0), "n_headings >= 2"),
        (np.ones((4, 1, 5)), QUARTERS, "n_pulses, 6"),
        (np.ones((4, 1, 6)), QUARTERS[:2], "n_headings - 1"),
        (np.full((4, 1, 6), np.nan), QUARTERS, "finite"),
        (-np.ones((4, 1, 6)), QUARTERS, ">= 0 V"),
        (silent_heading(), QUARTERS, "not all be zero"),
        (np.ones((4, 1, 6)), np.array([0.1, np.inf, 0.1]), "finite"),
    ],
)
def test_invalid_turns_are_refused(strengths: np.ndarray, turns: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        calibrate(strengths, turns, RING, BOTH, strength_variance=1.0)
