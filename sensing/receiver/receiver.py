"""Model of a receiver: noise, trigger level, gate and readings, derived from its configuration."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray
from dirmusic.bearing.sub_bands import SubBands
from pdpatrol.sensing.array.array_table import gain_grid
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.nature.pulses import DECAY_S
from pdpatrol.sensing.nature.sources import Carrier
from pdpatrol.sensing.quantities import SPEED_OF_LIGHT_MPS
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detection import GateReading
from pdpatrol.sensing.receiver.faults import ChannelFault, add_faults
from pdpatrol.sensing.receiver.sampling import BURST_LENGTH, BURST_WINDOWS, Channels, Sampler

if TYPE_CHECKING:
    from pdpatrol.sensing.receiver.front_end import FrontEnd


class Receiver:
    """Multichannel receiver.

    Args:
        config: Configuration.
        n_elements: Number of channels.
    """

    def __init__(self, config: ReceiverConfig, n_elements: int) -> None:
        self.config, self.n_elements = config, n_elements

    @cached_property
    def front_end(self) -> FrontEnd:
        """Band-pass filter."""
        from pdpatrol.sensing.receiver.front_end import front_end  # imports scipy.signal, which takes 0.9 s

        return front_end(self.config.sample_rate_hz, self.config.band_hz, self.config.gate_samples)

    @property
    def step_v(self) -> float:
        """Voltage of one ADC count."""
        return self.config.full_scale_v / (2 ** (self.config.bits - 1) - 1)

    @property
    def filtered_noise_v(self) -> float:
        """Standard deviation of the noise after the band-pass."""
        return self.config.noise_v * float(np.sqrt(self.front_end.noise_power))

    @cached_property
    def noise_variance_v2(self) -> float:
        """Variance of a sample without a pulse: filtered noise plus quantisation by the ADC."""
        return self.filtered_noise_v**2 + self.step_v**2 / 12

    @cached_property
    def threshold_v(self) -> float:
        """Trigger level that noise alone crosses `false_alarm_rate_hz` times per second in all channels together."""
        rate_hz = self.config.false_alarm_rate_hz
        return self.filtered_noise_v * self.front_end.threshold_over_noise(rate_hz, self.n_elements)

    def sampler(self, array: HelicalArray) -> Sampler:
        """Return the parameters of the receiver from the antenna feeds of an array to the gate."""
        config, front_end, rate_hz = self.config, self.front_end, self.config.sample_rate_hz
        aperture, decay = round(array.aperture_m / SPEED_OF_LIGHT_MPS * rate_hz), round(2 * DECAY_S * rate_hz)
        n_echo, window = round(config.longest_echo_s * rate_hz), max(config.gate_samples // 2, 1)
        pulse, pattern = front_end.pulse_table, array.pattern
        if isinstance(pattern, SpatialPattern):
            pulse = front_end.pulse_in_bands(*front_end.bands_hz(pattern.frequency_hz).tolist())
        return Sampler(
            pulse=pulse,
            noise=front_end.noise_filter(config.noise_v),
            trigger=front_end.trigger(config.noise_v, self.threshold_v),
            before=config.pretrigger_samples,
            aperture=aperture,
            rise=round(front_end.pulse_lag) + decay,
            peak=aperture + decay,
            gate=config.gate_samples,
            burst_first=max(n_echo, config.gate_samples),
            burst_step=max(((BURST_LENGTH - 1) * n_echo - 2 * window) // (BURST_WINDOWS - 1), window),
            burst_window=window,
        )

    def reading(self) -> GateReading:
        """Return the parameters of the ADC, and those of the readings taken from a gate."""
        config, front_end, n = self.config, self.front_end, self.config.gate_samples
        band_lines, bands = np.empty((0, 0, n)), [np.empty(0)] * 3
        if config.band_edges_hz:
            sub_bands = SubBands(config.band_edges_hz, config.sample_rate_hz, n, front_end.correlation)
            pulse = front_end.pulse(np.arange(n, dtype=np.float64) - config.pretrigger_samples + front_end.pulse_lag)
            band_lines = sub_bands.lines
            bands = [sub_bands.noise_samples, sub_bands.energy_spread, sub_bands.noise_on(pulse)]
        highest, spread = float(2 ** (config.bits - 1) - 1), front_end.energy_spread
        return GateReading(self.step_v, highest, config.mains_hz, spread, front_end.noise_on_pulse, band_lines, *bands)

    def grid(self, array: HelicalArray) -> tuple[FloatArray, FloatArray]:
        """Return `grid` and `band_peak` of the `ArrayTable` of an array."""
        if not isinstance(array.pattern, SpatialPattern):
            return np.empty((0, 0, 1)), np.ones(1)
        pulse, bands_hz = self.sampler(array).pulse, self.front_end.bands_hz(array.pattern.frequency_hz)
        peak = np.sqrt(np.square(pulse.sine_v) + np.square(pulse.cosine_v)).max(axis=(1, 2))
        return gain_grid(array.pattern, bands_hz), peak

    def channels(
        self,
        time_s: float,
        carriers: Sequence[Carrier],
        faults: Sequence[ChannelFault],
        array: HelicalArray,
        world_from_array: FloatArray,
    ) -> Channels:
        """Return the state of the channels at a given time, including carriers and the faults that have begun.

        Args:
            time_s: Simulated time.
            carriers: Carriers.
            faults: Faults of the channels.
            array: The array.
            world_from_array: Pose of the array, shape (4, 4), on which the received carriers depend.
        """
        n, shape = self.n_elements, (len(carriers), self.n_elements)
        tone_v, tone_rad, turn_rad = np.empty(shape), np.empty(shape), np.empty(len(carriers))
        heading_rad = np.arctan2(world_from_array[1, 0], world_from_array[0, 0])
        for row, carrier in enumerate(carriers):
            azimuth_rad, turn_hz = carrier.bearing_rad - heading_rad, 2 * np.pi * carrier.frequency_hz
            gain = array.gain(np.full(n, azimuth_rad), np.zeros(n), carrier.frequency_hz)
            towards = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
            tone_v[row] = carrier.amplitude_v * self.front_end.response(carrier.frequency_hz) * gain
            tone_rad[row] = turn_hz / SPEED_OF_LIGHT_MPS * array.positions_m[:, :2] @ towards
            turn_rad[row] = turn_hz / self.config.sample_rate_hz
        background_v2 = self.noise_variance_v2 + 0.5 * np.square(tone_v).sum(axis=0)
        channels = Channels(
            np.full(n, np.inf), background_v2, np.arange(n), np.full(n, np.nan), tone_v, tone_rad, turn_rad
        )
        # Assumed; any constant has the same effect.
        add_faults(channels, faults, time_s, stuck_v=0.25 * self.config.full_scale_v)
        return channels
