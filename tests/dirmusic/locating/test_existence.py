"""Evidence for the existence of a source: pulses, silence and images."""

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from dirmusic.locating.association import Association, Comparison, Level
from dirmusic.locating.existence import (
    DIFFUSE,
    WANDERING,
    Wander,
    image_evidence,
    log_ratios,
    pulse_evidence,
    rate_evidence,
)

LEVEL = Level(-5.0, 2.0)


def ratios_of(
    bearing_sigmas: float | FloatArray,
    level_db: float | FloatArray,
    n: int,
    *,
    direct: float = 0.98,
    wander: Wander = WANDERING,
) -> FloatArray:
    """Return the log ratios of n pulses that are off in bearing and level."""
    one = np.ones(n)
    compared = Comparison(
        0.0 * one,
        (LEVEL.mean_db + level_db) * one,
        2.0 * one,
        0.0 * one,
        0.05 * one,
        bearing_sigmas * one,
        direct * one,
        5.0 * one,
    )
    return log_ratios(compared, LEVEL, one, wander)


def evidence(n_windows: int, n_each: int, bearing_sigmas: float = 0.5, level_db: float = 1.0) -> float:
    """Return the evidence of a single source by pulses in windows."""
    n = n_windows * n_each
    share = np.tile([[0.8], [0.2]], (1, n))
    association = Association(np.full((1, n), 0.9), np.zeros((1, n)), share)
    ratios = ratios_of(bearing_sigmas, level_db, n)[np.newaxis]
    return float(pulse_evidence(ratios, association, np.repeat(np.arange(n_windows), n_each))[0])


def test_evidence_grows_with_windows_not_with_repetitions() -> None:
    """Each window counts once, whatever the number of its pulses."""
    assert evidence(1, 1) > 0.5
    assert evidence(8, 5) == pytest.approx(8.0 * evidence(1, 5))
    assert evidence(4, 50) == pytest.approx(evidence(4, 2))


def test_scattered_pulses_are_evidence_against_a_source() -> None:
    """Bearings or levels that scatter more than their errors lower the odds."""
    assert evidence(5, 3, bearing_sigmas=4.0) < 0.0
    assert evidence(5, 3, level_db=15.0) < 0.0
    assert evidence(5, 3) > evidence(5, 3, bearing_sigmas=2.0) > evidence(5, 3, bearing_sigmas=4.0)


def test_pulses_from_behind_equipment_hardly_count() -> None:
    """Where the direct path is hidden, waves of a source wander like others: scattered ones do not refute it."""
    assert ratios_of(4.0, 1.0, 1, direct=0.02) > -0.2 > -2.0 > ratios_of(4.0, 1.0, 1)
    assert 0.0 < ratios_of(0.5, 1.0, 1, direct=0.02) < 0.6 * ratios_of(0.5, 1.0, 1)


def test_point_is_told_from_an_extended_image() -> None:
    """An extended image explains bearings and levels that scatter by more than their errors."""
    rng = np.random.default_rng(0)

    def evidence(bearing_std_rad: float, level_std_db: float) -> float:
        bearing_sigmas = rng.normal(0.0, np.hypot(0.05, bearing_std_rad) / 0.05, 1000)
        level_db = rng.normal(0.0, np.hypot(np.hypot(2.0, LEVEL.spread_db), level_std_db), 1000)
        return ratios_of(bearing_sigmas, level_db, 1000, wander=DIFFUSE).mean()

    assert evidence(*DIFFUSE) < 0.0 < 1.0 < evidence(0.0, 0.0)


def test_source_in_the_shadow_of_another_has_little_evidence() -> None:
    """A second source that explains the same pulses takes the evidence of both."""
    n, share = 6, np.tile([[0.45], [0.45], [0.1]], (1, 6))
    both = Association(np.full((2, n), 0.5), np.zeros((2, n)), share)
    own = pulse_evidence(np.tile(ratios_of(0.5, 1.0, n), (2, 1)), both, np.arange(n))
    assert (own < 0.5 * evidence(n, 1)).all()


@pytest.mark.parametrize("strong", [0.01, 0.5, 0.895])
def test_other_sources_do_not_add_to_the_evidence(strong: float) -> None:
    """Pulses that no other source explains count the same beside a strong source, however few come from none."""
    n, ratios = 6, np.stack([ratios_of(0.5, 1.0, 6), np.full(6, -30.0)])
    share = np.tile([[0.1], [strong], [0.9 - strong]], (1, n))
    association = Association(np.tile([[0.9], [0.0]], (1, n)), np.zeros((2, n)), share)
    own = pulse_evidence(ratios, association, np.arange(n))[0]
    assert own < ratios[0].sum()


def test_rate_counts_where_a_source_is_visible() -> None:
    """Other numbers than expected lower the odds where detections were expected."""
    silent, expected = np.zeros(4), np.full(4, 20.0)

    def odds(expected: FloatArray, detected: FloatArray) -> float:
        return rate_evidence(expected, detected, detected)

    assert odds(np.zeros(4), silent) == pytest.approx(0.0, abs=1e-12)
    assert odds(expected, silent) < odds(expected[:2], silent[:2]) < -2.0
    assert odds(expected, expected) > 0.0 > odds(expected, 8.0 * expected)
    assert abs(odds(np.full(4, 1.0), silent)) < 1.0  # a slow source is often silent for a window


def test_long_pause_counts_little_more_than_its_beginning() -> None:
    """Silence refutes a wave that came once, and not a source that was heard long before it paused."""
    expected = np.full(120, 4.0)

    def odds(n_heard: int, n_silent: int) -> float:
        detected = np.r_[np.full(n_heard, 4.0), np.zeros(n_silent)]
        return rate_evidence(expected[: n_heard + n_silent], detected, detected)

    assert odds(1, 10) < -3.0
    assert odds(10, 0) - 9.0 < odds(10, 17) < odds(10, 0)
    assert odds(10, 20) - odds(10, 40) < 3.0


def test_source_is_not_silent_where_candidates_have_its_pulses() -> None:
    """Pulses that may be of a source do not refute it, do not support it, and never change what it has itself."""
    silent, expected = np.zeros(4), np.full(4, 20.0)
    assert rate_evidence(expected, silent, expected) == pytest.approx(0.0, abs=1e-12)
    assert rate_evidence(expected, silent, 0.1 * expected) > rate_evidence(expected, silent, silent)
    assert rate_evidence(expected, silent, 0.1 * expected) < 0.0
    assert rate_evidence(expected, expected, 5.0 * expected) == rate_evidence(expected, expected, expected)


def image(
    senior: float, expected: float, *, is_too_strong: bool = False, n_windows: int = 5, rate_hz: float = 0.0
) -> float:
    """Return the evidence against an image, detected each second in windows of 5 s with a senior source or without."""
    window = np.repeat(np.arange(n_windows), 5)
    n = window.size
    strong = np.full(n, is_too_strong)
    return image_evidence(window, np.ones(n), np.full(n, senior), np.full(n, expected), rate_hz, strong)


def test_image_is_detected_only_while_the_senior_is_missing() -> None:
    """Detections in place of the senior source refute; those together with it, or too strong ones, support."""
    assert image(0.0, 5.0) < -5.0
    assert image(3.0, 5.0) > 5.0
    assert image(0.0, 0.0) == image(3.0, 0.0) == 0.0  # the senior source is hidden
    assert image(0.0, 5.0, is_too_strong=True) > 10.0
    assert image(0.0, 5.0, n_windows=10) == pytest.approx(2.0 * image(0.0, 5.0))


def test_image_is_not_detected_more_often_than_the_senior_emits() -> None:
    """Of five detections in five seconds, a senior source of one pulse in ten seconds cannot be the cause."""
    assert image(0.0, 0.0, rate_hz=0.1, n_windows=20) > 5.0
    assert image(0.0, 0.0, rate_hz=2.0) == pytest.approx(-np.log(2.0), abs=0.1)


def test_pulses_taken_for_those_of_an_image_do_not_make_it_a_source() -> None:
    """At 70 pulses per second both are detected in each second; only more of them than the senior emits count."""
    window, n = np.repeat(np.arange(20), 5), 100
    expected, weak = np.full(n, 70.0), np.zeros(n, dtype=np.bool_)

    def odds(own: float, senior: float) -> float:
        return image_evidence(window, np.full(n, own), np.full(n, senior), expected, 70.0, weak)

    assert odds(20.0, 50.0) < 0.5
    assert odds(70.0, 70.0) > 5.0
    assert image(60.0, 70.0) < 0.5 < image(1.0, 1.0)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("rate_hz", [0.4, 10.0])
def test_chance_does_not_make_a_source_of_an_image(rate_hz: float, share: float) -> None:
    """An image that takes a share of the detections of a senior source has the mean odds 1 at most."""
    rng, window = np.random.default_rng(0), np.repeat(np.arange(20), 5)
    hidden, weak, odds = np.zeros(100), np.zeros(100, dtype=np.bool_), list[float]()
    for _ in range(400):
        emitted = rng.poisson(rate_hz * rng.lognormal(0.0, 0.6, 20).repeat(5))
        taken = rng.binomial(emitted, share)
        counts = taken.astype(np.float64), (emitted - taken).astype(np.float64)
        odds.append(np.exp(image_evidence(window, *counts, hidden, rate_hz, weak)))
    assert np.mean(odds) < 1.1
