"""Band-pass filter of the receiver: its response to pulses and to white noise.

This module imports `scipy.signal`, which takes 0.9 s.
"""

from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import solve_discrete_lyapunov
from scipy.optimize import brentq
from scipy.signal import butter, sosfilt, sosfreqz
from scipy.special import ndtr, owens_t

from dirmusic.array.spatial_pattern import frequency_weights
from dirmusic.arrays import FloatArray
from pdpatrol.sensing.nature.pulses import DECAY_S, FREQUENCY_HZ, damped_pulse
from pdpatrol.sensing.receiver.config import Band
from pdpatrol.sensing.receiver.sampling import NoiseFilter, PulseTable, Trigger

FILTER_ORDER = 6
"""Order of the Butterworth prototype. With the default band, the filter attenuates the interferer of the Dir-MUSIC
paper at 948 MHz by 54 dB, and settles within a gate."""

PHASES = 128
"""Number of sub-sample delays at which the filtered pulse is tabulated; at 2 GHz and 20 GS/s, rounding to these delays
changes the phase by up to 0.003 rad."""

MOST_BANDS = 8
"""Maximum number of bands into which a pulse is divided if the gain depends on frequency; they are 114 MHz apart with
the default band."""

SIGNAL_STEP = 0.02
"""Step of the table of trigger probabilities, in standard deviations of the noise."""


class FrontEnd:
    """Band-pass filter in front of the ADC.

    Args:
        sample_rate_hz: Samples per second of the ADC.
        band_hz: The two 3 dB frequencies, or "all" for no filter, so that the noise is white.
        gate_samples: Length of the gate in samples.
    """

    def __init__(self, sample_rate_hz: float, band_hz: Band, gate_samples: int) -> None:
        self.sample_rate_hz, self.band_hz, self.gate_samples = sample_rate_hz, band_hz, gate_samples
        self._sections = np.empty((0, 6))
        if band_hz != "all":
            sections = butter(FILTER_ORDER, band_hz, "bandpass", fs=sample_rate_hz, output="sos")
            self._sections = np.ascontiguousarray(sections, np.float64)

    def filter(self, samples: FloatArray) -> FloatArray:
        """Filter samples along the last axis, starting from rest; the result has the same shape."""
        return np.asarray(sosfilt(self._sections, samples)) if self._sections.size else samples

    @lru_cache(maxsize=64)  # noqa: B019 - front ends are cached anyway
    def response(self, frequency_hz: float) -> float:
        """Return the gain for a steady tone."""
        if not self._sections.size:
            return 1.0
        return float(np.abs(sosfreqz(self._sections, [frequency_hz], fs=self.sample_rate_hz)[1][0]))

    def noise_filter(self, std_v: float) -> NoiseFilter:
        """Return the filter with white noise of a given standard deviation at its input."""
        return NoiseFilter(std_v, self._sections, self._settled)

    @cached_property
    def _settled(self) -> FloatArray:
        """Square root of the covariance of the filter state in white noise, as in `NoiseFilter`."""
        n = 2 * len(self._sections)
        if n == 0:
            return np.empty((0, 0))
        # One step of the filter from each unit state, and from rest with an input sample of 1.
        states = np.eye(n, n + 1).reshape(-1, 2, n + 1).transpose(0, 2, 1)
        _, stepped = sosfilt(self._sections, np.eye(n + 1)[:, n:], zi=states)
        stepped = np.transpose(stepped, (0, 2, 1)).reshape(n, n + 1)
        transition, drive = stepped[:, :n], stepped[:, n:]
        covariance = np.asarray(solve_discrete_lyapunov(transition, drive @ drive.T), dtype=np.float64)
        values, vectors = np.linalg.eigh(covariance)
        return np.ascontiguousarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    @cached_property
    def _impulse_response(self) -> FloatArray:
        """Impulse response, truncated where a millionth of its energy remains."""
        impulse = np.zeros(2**16)  # long enough for the narrowest band
        impulse[0] = 1.0
        response = self.filter(impulse)
        remaining = np.square(response)[::-1].cumsum()[::-1]
        return response[: int(np.argmax(remaining < 1e-6 * remaining[0]))]

    @cached_property
    def correlation(self) -> FloatArray:
        """Autocorrelation of filtered white noise over the lags of a gate, 1 at lag 0, shape (gate_samples,)."""
        return _autocorrelation(self._impulse_response, self.gate_samples)

    @cached_property
    def noise_power(self) -> float:
        """Variance of filtered white noise of unit variance."""
        return float(np.square(self._impulse_response).sum())

    @cached_property
    def energy_spread(self) -> float:
        """Variance of the noise energy of a gate, divided by 2 sigma^4; equal to `gate_samples` for white noise."""
        n = self.gate_samples
        return float(2 * np.arange(n, 0, -1) @ np.square(self.correlation) - n)

    @cached_property
    def noise_on_pulse(self) -> float:
        """Variance of the noise projected on the filtered pulse, relative to that of one sample; 1 for white noise."""
        pulse = self.pulse(np.arange(self.gate_samples, dtype=np.float64))
        return float(2 * _autocorrelation(pulse, self.gate_samples) @ self.correlation - 1)

    def trigger(self, noise_v: float, level_v: float) -> Trigger:
        """Return the trigger for a level and for white noise of a given standard deviation at the filter's input."""
        filtered_v = noise_v * float(np.sqrt(self.noise_power))
        level = level_v / filtered_v
        signal = SIGNAL_STEP * np.arange(int(np.ceil(level / SIGNAL_STEP)) + 1)
        probability = np.asarray(ndtr(signal - level) + ndtr(-signal - level), dtype=np.float64)
        return Trigger(level_v, filtered_v, self.correlation, probability, SIGNAL_STEP * filtered_v)

    def threshold_over_noise(self, false_alarm_rate_hz: float, n_elements: int) -> float:
        r"""Return the trigger level for a false alarm rate, in standard deviations of the filtered noise.

        A Gaussian sequence with correlation :math:`\rho` between neighbouring samples rises through T with the
        probability :math:`2 \, T_O(T / \sigma, \sqrt{(1 - \rho) / (1 + \rho)})` per sample, where :math:`T_O` is Owen's
        T function, and falls through -T with the same probability. Several crossings within a gate are counted
        separately.

        Args:
            false_alarm_rate_hz: Mean number of crossings per second in all channels together, > 0.
            n_elements: Number of channels.
        """
        slope = np.sqrt((1.0 - self.correlation[1]) / (1.0 + self.correlation[1]))
        often = 4 * n_elements * self.sample_rate_hz / false_alarm_rate_hz

        def log_excess(sigmas: float) -> float:
            return float(np.log(often * owens_t(sigmas, slope)))

        return float(brentq(log_excess, 0.0, 30.0))  # pyright: ignore[reportArgumentType]

    @cached_property
    def _pulse(self) -> FloatArray:
        return self._tabulated(0.0)

    def _tabulated(self, phase_rad: float) -> FloatArray:
        """Tabulate the response to a pulse of 1 V, `PHASES` values per sample from its arrival on; 0 at the end."""
        n = int(12 * DECAY_S * self.sample_rate_hz) + self._impulse_response.size
        sample = np.arange(n) - np.arange(PHASES)[:, np.newaxis] / PHASES  # row k arrives k / PHASES after a sample
        filtered = self.filter(damped_pulse(sample / self.sample_rate_hz, phase_rad))
        late = filtered.T[:, ::-1].ravel()  # value k is at (k - (PHASES - 1)) / PHASES samples after arrival
        table = np.pad(late[PHASES - 1 :], (0, PHASES - 1))
        table[0] = 0.0  # earlier times use the first value, later ones the last
        return table

    def pulse(self, sample: FloatArray) -> FloatArray:
        """Return the filtered pulse at times after its arrival, in samples, any shape; it is 0 before the arrival."""
        return self._pulse.take((PHASES * sample + 0.5).astype(np.intp), mode="clip")

    @cached_property
    def pulse_peak(self) -> float:
        """Largest magnitude of the filtered pulse."""
        return float(np.abs(self._pulse).max())

    @cached_property
    def pulse_lag(self) -> float:
        """Number of samples from the arrival of a pulse to where it first reaches half its peak."""
        return float(np.argmax(np.abs(self._pulse) >= 0.5 * self.pulse_peak)) / PHASES

    @cached_property
    def pulse_table(self) -> PulseTable:
        """Table of the filtered pulse as a single band."""
        sine_v, cosine_v = (_by_phase(table[np.newaxis]) for table in (self._pulse, self._tabulated(0.5 * np.pi)))
        return PulseTable(sine_v, cosine_v, 0, np.ones(1), self.sample_rate_hz)

    def bands_hz(self, known_hz: FloatArray) -> FloatArray:
        """Choose the frequencies of the bands for a gain that depends on frequency, shape (n_bands,).

        These are the frequencies within the band-pass at which the gain is known, and the limits of the band-pass,
        clipped to the known frequencies. If these are more than `MOST_BANDS`, that number of evenly spaced frequencies
        is used instead.

        Args:
            known_hz: Frequencies at which the gain is known, ascending; the gain is linear in between.
        """
        ends_hz = known_hz[[0, -1]]
        low_hz, high_hz = ends_hz if self.band_hz == "all" else np.clip(self.band_hz, *ends_hz)
        exact = np.union1d([low_hz, high_hz], known_hz[(low_hz <= known_hz) & (known_hz <= high_hz)])
        return exact if exact.size <= MOST_BANDS else np.linspace(low_hz, high_hz, MOST_BANDS)

    @lru_cache(maxsize=4)  # noqa: B019 - front ends are cached anyway
    def pulse_in_bands(self, *bands_hz: float) -> PulseTable:
        """Divide the filtered pulse into bands, so that the sum of bands times gains is the pulse after a gain.

        The gain is linear in frequency between the bands. The weight of a band falls linearly from 1 at its own
        frequency to 0 at those of its neighbours, with zero phase. A band therefore begins before the arrival of the
        pulse; the wider the band, the shorter this lead.

        Args:
            bands_hz: Frequencies of the bands, ascending.
        """
        lead = round(12e-9 * self.sample_rate_hz)  # contains all but 1 % of each of eight bands in 800 MHz
        tables = [np.pad(table, lead * PHASES) for table in (self._pulse, self._tabulated(0.5 * np.pi))]
        n, rate_hz = tables[0].size, PHASES * self.sample_rate_hz
        frequency_hz = np.arange(n // 2 + 1, dtype=np.float64) * (rate_hz / n)
        share = frequency_weights(frequency_hz, np.array(bands_hz)).T
        sine_v, cosine_v = (_by_phase(np.fft.irfft(share * np.fft.rfft(table))) for table in tables)
        steady_share = frequency_weights(np.array([FREQUENCY_HZ]), np.array(bands_hz))[0]
        return PulseTable(sine_v, cosine_v, lead, steady_share, self.sample_rate_hz)


front_end = lru_cache(maxsize=16)(FrontEnd)
"""Front end for given settings, cached so that its tables are computed only once."""


def _autocorrelation(values: FloatArray, n_lags: int) -> FloatArray:
    """Return the autocorrelation at lags 0, 1, ..., scaled to 1 at lag 0, shape (n_lags,)."""
    products = np.correlate(np.pad(values, (0, n_lags - 1)), values)
    return products / products[0]


def _by_phase(bands: FloatArray) -> FloatArray:
    """Arrange tables (n_bands, n) with `PHASES` values per sample by phase, shape (n_bands, PHASES, n_samples)."""
    return np.ascontiguousarray(bands.reshape(len(bands), -1, PHASES).swapaxes(1, 2))
