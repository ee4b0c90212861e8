"""The receiver's band-pass is the one that SciPy designs and runs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfreqz

from pdpatrol.sensing.receiver.band_pass import butterworth_sections, response, run, state_space

FILTERS = [
    (6, (1.4e9, 2.2e9), 20e9),
    (6, (1.79e9, 1.81e9), 20e9),
    (6, (0.3e9, 3e9), 10e9),
    (4, (0.1e9, 9e9), 20e9),
    (2, (6e9, 9e9), 20e9),
]


@pytest.mark.parametrize("case", FILTERS)
def test_the_response_is_the_reference_s(case: tuple[int, tuple[float, float], float]) -> None:
    order, band_hz, rate_hz = case
    frequency_hz = np.linspace(0.01, 0.49, 97) * rate_hz
    reference = sosfreqz(butter(order, band_hz, "bandpass", fs=rate_hz, output="sos"), worN=frequency_hz, fs=rate_hz)[1]
    sections = butterworth_sections(order, band_hz, rate_hz)
    given = np.array([response(sections, turn) for turn in 2 * np.pi * frequency_hz / rate_hz])
    np.testing.assert_allclose(given, reference, atol=1e-11)
    for edge_hz in band_hz:
        assert abs(response(sections, 2 * np.pi * edge_hz / rate_hz)) == pytest.approx(np.sqrt(0.5), rel=1e-9)


@pytest.mark.parametrize("case", FILTERS)
def test_what_comes_out_is_the_reference_s(case: tuple[int, tuple[float, float], float]) -> None:
    sections = butterworth_sections(*case)
    samples = np.random.default_rng(0).standard_normal((2, 3, 1500))
    given = run(sections, samples)
    assert given.shape == samples.shape
    np.testing.assert_allclose(given, np.asarray(sosfilt(sections, samples, axis=-1)), atol=1e-10)


@pytest.mark.parametrize("case", FILTERS)
def test_the_state_goes_on_as_samples_do(case: tuple[int, tuple[float, float], float]) -> None:
    sections = butterworth_sections(*case)
    transition, drive = state_space(sections)
    impulse, state = np.zeros(40), np.zeros(len(drive))
    impulse[0] = 1.0
    states = [state]
    for sample in impulse:
        state = transition @ state + drive[:, 0] * sample
        states.append(state)
    _, reference = sosfilt(sections, impulse, zi=np.zeros((len(sections), 2)))
    np.testing.assert_allclose(state, np.asarray(reference).ravel(), atol=1e-12 * np.abs(states).max())
