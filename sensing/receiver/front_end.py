"""The receiver's band-pass: what it makes of a pulse, and of white noise."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.spatial_pattern import frequency_weights
from pdpatrol.sensing.nature.pulse_shape import DECAY_S, FREQUENCY_HZ, damped_pulse
from pdpatrol.sensing.receiver.band_pass import butterworth_sections, response, run, state_space

FloatArray = NDArray[np.float64]

FILTER_ORDER = 6
"""Of the Butterworth prototype: 54 dB at the 948 MHz of the Dir-MUSIC paper's interferer with the default band, while
the filter still settles within a gate."""

PHASES = 128
"""Into how many parts a sample is divided where the filtered pulse is tabulated; what lies between is rounded, to 0.003
rad at 2 GHz and 20 GS/s."""

MOST_BANDS = 8
"""Into which a pulse is divided where the gain depends on frequency: of the default band, 114 MHz each."""

LEAD_S = 12e-9
"""How long before and after a pulse its bands are known: at eight in 800 MHz, all but 1 % of each."""

SETTLED = 1e-6
"""Share of its energy that is left of the filter's impulse response when it is taken as over."""


class PulseTable(NamedTuple):
    """A filtered pulse of 1 V before the filter, divided into bands that add up to it, as compiled loops read it.

    Attributes:
        sine_v: In each band, row k begins with the sample that lies k / n_phases of a sample after the first known one,
            and goes on sample by sample, shape (n_bands, n_phases, n_samples); the pulse is 0 before and after.
        cosine_v: Of a pulse whose oscillation is a quarter of a turn ahead; same shape.
        lead: Samples from the first known one to the arrival.
        steady_share: Share of each band in a steady wave of the pulses' frequency, shape (n_bands,).
        rate_hz: Samples per second.
    """

    sine_v: FloatArray
    cosine_v: FloatArray
    lead: int
    steady_share: FloatArray
    rate_hz: float


class NoiseFilter(NamedTuple):
    """White noise and the filter behind it, as compiled loops run them.

    Attributes:
        std_v: Standard deviation of a sample before the filter.
        sections: Second-order sections b0, b1, b2, 1, a1, a2, shape (n_sections, 6); none if all passes.
        settled: Turns standard normal numbers into the state that the sections have after a long time in white noise
            of unit variance, two numbers each, shape (2 n_sections, 2 n_sections).
    """

    std_v: float
    sections: FloatArray
    settled: FloatArray


@lru_cache(maxsize=16)
def front_end(sample_rate_hz: float, band_hz: tuple[float, float] | None, gate_samples: int) -> FrontEnd:
    """The same front end for the same settings: its tables are made once."""
    return FrontEnd(sample_rate_hz, band_hz, gate_samples)


class FrontEnd:
    """A band-pass filter and what follows from it.

    Args:
        sample_rate_hz: Samples per second of the converter.
        band_hz: Where the filter is 3 dB down; None lets all pass, and noise stays white.
        gate_samples: Length of the gate.
    """

    def __init__(self, sample_rate_hz: float, band_hz: tuple[float, float] | None, gate_samples: int) -> None:
        self.sample_rate_hz = sample_rate_hz
        self.band_hz = band_hz
        self.gate_samples = gate_samples
        self._divided: dict[tuple[float, ...], PulseTable] = {}

    def filter(self, samples: FloatArray) -> FloatArray:
        """Run forward in time along the last axis, starting from rest; same shape."""
        if self._sections is None:
            return samples
        return run(self._sections, samples)

    def noise_filter(self, std_v: float) -> NoiseFilter:
        """The filter with white noise of a standard deviation before it."""
        sections = np.empty((0, 6)) if self._sections is None else self._sections
        return NoiseFilter(std_v, np.ascontiguousarray(sections), self._settled)

    @cached_property
    def _settled(self) -> FloatArray:
        """As of `NoiseFilter`: a square root of the covariance of the state in white noise."""
        if self._sections is None:
            return np.empty((0, 0))
        from scipy.linalg import solve_discrete_lyapunov  # here, so that a command line help need not wait for it

        transition, drive = state_space(self._sections)
        covariance = np.asarray(solve_discrete_lyapunov(transition, drive @ drive.T), dtype=np.float64)
        values, vectors = np.linalg.eigh(covariance)
        return np.ascontiguousarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def response(self, frequency_hz: float) -> float:
        """Gain for a steady tone."""
        if self._sections is None:
            return 1.0
        return abs(response(self._sections, 2.0 * np.pi * frequency_hz / self.sample_rate_hz))

    @cached_property
    def _sections(self) -> FloatArray | None:
        if self.band_hz is None:
            return None
        return butterworth_sections(FILTER_ORDER, self.band_hz, self.sample_rate_hz)

    @cached_property
    def _impulse_response(self) -> FloatArray:
        if self.band_hz is None:
            return np.ones(1)
        n = 256
        while True:
            impulse = np.zeros(n)
            impulse[0] = 1.0
            response = self.filter(impulse)
            left = np.square(response)[::-1].cumsum()[::-1]
            if left[n // 2] < SETTLED * left[0]:
                return response[: int(np.argmax(left < SETTLED * left[0]))]
            n *= 2

    @cached_property
    def correlation(self) -> FloatArray:
        """Autocorrelation of filtered white noise over the lags of a gate, 1 at lag 0; shape (gate_samples,)."""
        h = self._impulse_response
        full = np.correlate(h, h, mode="full")[h.size - 1 :]
        padded = np.zeros(self.gate_samples)
        n = min(full.size, padded.size)
        padded[:n] = full[:n]
        return padded / padded[0]

    @cached_property
    def noise_power(self) -> float:
        """Variance of filtered white noise of unit variance."""
        return float(np.square(self._impulse_response).sum())

    @cached_property
    def energy_spread(self) -> float:
        """Sum of the squared eigenvalues: a gate's noise energy has variance 2 sigma^4 times this; n when white."""
        lags = np.arange(1, self.gate_samples)
        squared = np.square(self.correlation)
        return float(self.gate_samples * squared[0] + 2 * ((self.gate_samples - lags) * squared[1:]).sum())

    @cached_property
    def noise_on_pulse(self) -> float:
        """Variance of the noise along the filtered pulse, over that of one sample; 1 when white."""
        pulse = self._pulse_table[::PHASES][: self.gate_samples]
        padded = np.zeros(self.gate_samples)
        padded[: pulse.size] = pulse
        own = np.correlate(padded, padded, mode="full")[padded.size - 1 :]
        return float((own[0] + 2 * (own[1:] * self.correlation[1:]).sum()) / own[0])

    @cached_property
    def _pulse_table(self) -> FloatArray:
        """A pulse of 1 V before the filter, `PHASES` values a sample, from its arrival on; zero at the end."""
        return self._tabulated(0.0)

    def _tabulated(self, phase_rad: float) -> FloatArray:
        n = int(12 * DECAY_S * self.sample_rate_hz) + self._impulse_response.size
        sample = np.arange(n) - np.arange(PHASES)[:, np.newaxis] / PHASES  # arrives that much after a sample
        filtered = self.filter(damped_pulse(sample / self.sample_rate_hz, phase_rad))
        late = filtered.T[:, ::-1].ravel()  # value k is at (k - (PHASES - 1)) / PHASES samples after arrival
        table = np.append(late[PHASES - 1 :], 0.0)
        table[0] = 0.0  # what comes before counts as the first value, what comes after as the last
        return table

    def bands_hz(self, known_hz: FloatArray) -> FloatArray:
        """Frequencies that bands stand for where the gain of an array depends on frequency, shape (n_bands,).

        Those at which it is known, if there are few enough within the band and next to it; else even steps.

        Args:
            known_hz: Where the gain is known; it is linear in between.
        """
        low_hz, high_hz = self.band_hz or (known_hz[0], known_hz[-1])
        within = known_hz[(low_hz <= known_hz) & (known_hz <= high_hz)]
        low_hz, high_hz = (float(np.clip(end_hz, known_hz[0], known_hz[-1])) for end_hz in (low_hz, high_hz))
        exact = np.unique(np.concatenate([[low_hz, high_hz], within]))
        return exact if exact.size <= MOST_BANDS else np.linspace(low_hz, high_hz, MOST_BANDS)

    @cached_property
    def pulse_table(self) -> PulseTable:
        """The filtered pulse as compiled loops read it, in one band."""
        sine, cosine = (by_phase(table) for table in (self._pulse_table, self._tabulated(0.5 * np.pi)))
        return PulseTable(sine[np.newaxis], cosine[np.newaxis], 0, np.ones(1), self.sample_rate_hz)

    def pulse_in_bands(self, bands_hz: FloatArray) -> PulseTable:
        """The filtered pulse in bands: times the gains at their frequencies they add up to what a linear gain makes.

        A band's share of the spectrum falls linearly from 1 at its own frequency to 0 at its neighbours'. No phase goes
        with it: what is in a band begins before the arrival, and the less so the wider the bands.

        Args:
            bands_hz: Rising, shape (n_bands,).
        """
        key = tuple(bands_hz.tolist())
        if key not in self._divided:
            lead = round(LEAD_S * self.sample_rate_hz)
            n_pulse = self._pulse_table.size
            n = (-(-n_pulse // PHASES) + 2 * lead) * PHASES
            frequency_hz = np.asarray(np.fft.rfftfreq(n, 1.0 / (PHASES * self.sample_rate_hz)), dtype=np.float64)
            share = frequency_weights(frequency_hz, bands_hz).T
            sine, cosine = (
                np.array([by_phase(band) for band in np.fft.irfft(share * np.fft.rfft(whole), n)])
                for whole in (
                    np.pad(table, (lead * PHASES, n - lead * PHASES - n_pulse))
                    for table in (self._pulse_table, self._tabulated(0.5 * np.pi))
                )
            )
            steady = frequency_weights(np.array([FREQUENCY_HZ]), bands_hz)[0]
            self._divided[key] = PulseTable(sine, cosine, lead, steady, self.sample_rate_hz)
        return self._divided[key]

    def pulse(self, sample: FloatArray) -> FloatArray:
        """The filtered pulse so many samples after its arrival, any shape; 0 before. Its peak is `pulse_peak`."""
        return self._pulse_table.take((PHASES * sample + 0.5).astype(np.intp), mode="clip")

    @cached_property
    def pulse_peak(self) -> float:
        """Largest magnitude of the filtered pulse."""
        return float(np.abs(self._pulse_table).max())

    @cached_property
    def pulse_lag(self) -> float:
        """Samples from the arrival of a pulse to where it first has half its peak."""
        return float(np.argmax(np.abs(self._pulse_table) >= 0.5 * self.pulse_peak)) / PHASES


def by_phase(table: FloatArray) -> FloatArray:
    """`PHASES` values a sample, as a row for each phase, shape (PHASES, n_samples)."""
    n_samples = -(-table.size // PHASES)
    return np.ascontiguousarray(np.pad(table, (0, n_samples * PHASES - table.size)).reshape(n_samples, PHASES).T)
