"""Phase-resolved pulse trains, and the classification of the kind of discharge."""

from itertools import combinations
from typing import get_args

import numpy as np
import pytest

from dirmusic.angles import circular_mean, difference
from dirmusic.pulses.phase_resolved import KINDS, LEAST_PULSES, KindName, classify
from pdpatrol.sensing import DischargeSource, PulseTrain, Scene

NAMES: tuple[KindName, ...] = get_args(KindName)
MAINS_HZ = 50.0
CYCLES = 200


def pulses(kind: KindName, rng: np.random.Generator, rate_hz: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """Draw the phases and levels of pulses in 200 cycles of a defect on a random conductor, with 0.3 dB of noise."""
    train = PulseTrain.of_kind(kind, MAINS_HZ, float(rng.choice([0.0, 2.0, 4.0])) * np.pi / 3, rng)
    _, time_s, amplitude = train.times(rate_hz).draw(0.0, CYCLES / MAINS_HZ, rng)
    level = 20 * np.log10(np.abs(amplitude)) + rng.normal(0.0, 0.3, time_s.size)
    return 2 * np.pi * MAINS_HZ * time_s, level


@pytest.mark.parametrize("kind", NAMES)
def test_train_has_its_rate_in_intervals_of_any_length(kind: KindName) -> None:
    rng = np.random.default_rng(1)
    train = PulseTrain.of_kind(kind, MAINS_HZ, 1.0, rng)
    for duration_s in (0.003, 0.1, 7.0):
        n = [
            train.times(60.0).draw(k * duration_s, duration_s, rng)[0].size for k in range(round(400 / duration_s / 10))
        ]
        expected = 60.0 * duration_s * len(n)
        assert sum(n) == pytest.approx(expected, abs=5 * np.sqrt(expected))
    _, time_s, _ = train.times(1000.0).draw(3.0, 0.1, rng)
    assert time_s.min() >= 3.0
    assert time_s.max() < 3.1


@pytest.mark.parametrize("kind", NAMES)
def test_pulses_have_phases_of_kind_and_lag_of_conductor(kind: KindName) -> None:
    rng = np.random.default_rng(2)
    lag = np.radians(120.0)
    train = PulseTrain.of_kind(kind, 60.0, lag)
    _, time_s, amplitude = train.times(100.0).draw(0.0, 100.0, rng)
    phase = 2 * np.pi * 60.0 * time_s - lag
    for cluster in KINDS[kind]:
        near = np.abs(difference(phase, np.radians(cluster.centre_deg))) < np.radians(80.0)
        assert near.mean() == pytest.approx(cluster.share, abs=0.03)
        assert np.degrees(difference(circular_mean(phase[near]), np.radians(cluster.centre_deg))) == pytest.approx(
            0.0, abs=2.0
        )
        assert np.median(20 * np.log10(np.abs(amplitude[near]))) == pytest.approx(cluster.level_db, abs=0.5)
        assert np.mean(np.sign(amplitude[near]) == cluster.polarity) > 0.97


def test_source_starts_stops_and_drifts() -> None:
    source = DischargeSource(
        name="s",
        position_m=np.ones(3),
        amplitude_v=0.5,
        pulse_rate_hz=50.0,
        active_s=(10.0, 20.0),
        drift_db_per_min=12.0,
    )
    _, time_s, peak_v = Scene([source]).draw(0.0, 100.0, np.random.default_rng(3))
    time_s, peak_v = np.sort(time_s), peak_v[np.argsort(time_s)]
    assert 10.0 <= time_s.min() < 10.3
    assert 19.7 < time_s.max() < 20.0
    np.testing.assert_allclose(20 * np.log10(peak_v / 0.5), 12.0 * time_s / 60.0)


@pytest.mark.whole
@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("rate_hz", [20.0, 60.0])
def test_kind_is_recognised_in_nine_of_ten_defects(kind: KindName, rate_hz: float) -> None:
    rng = np.random.default_rng(4)
    patterns = [classify(*pulses(kind, rng, rate_hz)) for _ in range(60)]
    assert np.mean([pattern.kind == kind for pattern in patterns]) >= 0.9
    right = [pattern.confidence for pattern in patterns if pattern.kind == kind]
    assert np.mean(right) > 0.8


def test_two_kinds_together_are_unknown() -> None:
    """Clusters of two kinds can coincide and look like one kind, but this is rarely stated with confidence."""
    rng = np.random.default_rng(5)
    patterns = []
    for first, second in combinations(NAMES, 2):
        for _ in range(12):
            (p, a), (q, b) = pulses(first, rng, 10.0), pulses(second, rng, 10.0)
            patterns.append(classify(np.concatenate([p, q]), np.concatenate([a, b + rng.uniform(-6, 6)])))
    assert np.mean([pattern.kind == "unknown" for pattern in patterns]) >= 0.7
    assert np.mean([pattern.kind != "unknown" and pattern.confidence > 0.9 for pattern in patterns]) <= 0.05


@pytest.mark.parametrize("spread_db", [0.3, 4.0])
def test_interferer_without_mains_phase_is_unknown(spread_db: float) -> None:
    rng = np.random.default_rng(6)
    kinds = [classify(rng.uniform(0, 2 * np.pi, 80), rng.normal(0, spread_db, 80)).kind for _ in range(30)]
    assert np.mean([kind == "unknown" for kind in kinds]) >= 0.8


def test_kind_is_independent_of_conductor_and_level() -> None:
    phase, level = pulses("surface", np.random.default_rng(7))  # unlike a void, changes when shifted by half a cycle
    plain = classify(phase, level)
    turned = classify(phase + np.radians(120.0), level - 37.0)
    assert (plain.kind, turned.kind) == ("surface", "surface")
    assert turned.confidence == pytest.approx(plain.confidence, abs=1e-9)
    assert np.degrees(difference(turned.shift_rad, plain.shift_rad)) == pytest.approx(120.0)


def test_few_pulses_are_unknown() -> None:
    phase, level = pulses("corona", np.random.default_rng(8))
    assert classify(phase[: LEAST_PULSES - 1], level[: LEAST_PULSES - 1]).kind == "unknown"
