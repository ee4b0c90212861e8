"""Speed compared with other libraries, as ratios within one run: `uv run --group peers pytest -m benchmark -n 0 -s`."""

import statistics
import time
from collections.abc import Callable

import numpy as np
import pytest

from dirmusic import Bearings, GainManifold, estimate_bearings, pulse_strengths, strength_variance

pytestmark = [pytest.mark.benchmark, pytest.mark.usefixtures("one_thread")]

N_PULSES, N_ELEMENTS, N_SAMPLES = 1024, 6, 60
NOISE_V = 0.02
ROUNDS = 60


def gates() -> np.ndarray:
    """Draw gated pulses (1024, 6, 60) from all directions."""
    rng = np.random.default_rng(0)
    pulse = np.exp(-np.arange(N_SAMPLES) / 10) * np.sin(0.55 * np.arange(N_SAMPLES))
    gain = GainManifold.ring(N_ELEMENTS).gain(rng.uniform(-np.pi, np.pi, N_PULSES)).T
    return gain[:, :, np.newaxis] * pulse + NOISE_V * rng.standard_normal((N_PULSES, N_ELEMENTS, N_SAMPLES))


def bearings(waveforms: np.ndarray, manifold: GainManifold) -> Bearings:
    """Compute bearings and their standard deviations from gates, as a user would."""
    strengths = pulse_strengths(waveforms, NOISE_V**2)
    variance = strength_variance(strengths, NOISE_V**2, N_SAMPLES)
    return estimate_bearings(strengths[:, np.newaxis], manifold, strength_variance=variance[:, np.newaxis])


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def cost_ratio(ours: Callable[[], object], theirs: Callable[[], object]) -> float:
    """Compute the median ratio of the costs of two calls that are run alternately."""
    for call in (ours, theirs):  # warm up
        call()
    return statistics.median(seconds(ours) / seconds(theirs) for _ in range(ROUNDS))


def peer_music() -> Callable[[], object]:
    """Prepare MUSIC of pyroomacoustics for one pulse: 6 channels, 360 angles, one bin, STFT computed beforehand."""
    pyroomacoustics = pytest.importorskip("pyroomacoustics", reason="uv run --group peers")
    boresights = GainManifold.ring(N_ELEMENTS).boresights_rad
    places = 0.2 * np.stack([np.cos(boresights), np.sin(boresights)])
    music = pyroomacoustics.doa.MUSIC(places, 20e9, 64, c=3e8, num_src=1, azimuth=np.radians(np.arange(360)))
    rng = np.random.default_rng(1)
    spectra = rng.standard_normal((N_ELEMENTS, 33, 8)) + 1j * rng.standard_normal((N_ELEMENTS, 33, 8))
    return lambda: music.locate_sources(spectra, freq_bins=[6])


@pytest.mark.parametrize(("n_pulses", "least"), [(N_PULSES, 60.0), (1, 1.0)])
def test_pulses_have_at_least_the_rate_of_a_peer(n_pulses: int, least: float) -> None:
    waveforms, manifold = gates()[:n_pulses], GainManifold.ring(N_ELEMENTS)
    rate = n_pulses / cost_ratio(lambda: bearings(waveforms, manifold), peer_music())
    print(f"\nbatch of {n_pulses}: {rate:.1f} times the rate of pyroomacoustics' MUSIC")
    assert rate >= least


def test_batch_costs_at_most_four_matrix_products() -> None:
    waveforms, manifold = gates(), GainManifold.ring(N_ELEMENTS)
    cost = cost_ratio(lambda: bearings(waveforms, manifold), lambda: waveforms @ np.swapaxes(waveforms, -1, -2))
    print(f"\nbatch of {N_PULSES}: {cost:.2f} times the cost of x @ x.T")
    assert cost <= 4.0
