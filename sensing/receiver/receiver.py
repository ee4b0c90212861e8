"""The receiver: noise, trigger level, gate and converter, as they follow from its settings; and who has one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.bearing.gain_delay import SPEED_OF_LIGHT_MPS
from dirmusic.bearing.sub_bands import SubBands
from pdpatrol.sensing.array.gain_grid import NO_GRID, GainGrid, gain_grid
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.nature.pulse_shape import DECAY_S
from pdpatrol.sensing.nature.scene import Scene
from pdpatrol.sensing.nature.sources import Carrier
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detection import Converter, ReceiverChain
from pdpatrol.sensing.receiver.faults import Faults
from pdpatrol.sensing.receiver.front_end import PulseTable, front_end
from pdpatrol.sensing.receiver.gates import BandReading, GateParameters
from pdpatrol.sensing.receiver.sampling.sampler import BurstTest, Sampler, Timing, Tones, Trigger
from pdpatrol.sensing.receiver.trigger import STEP, probabilities, threshold_over_noise

FloatArray = NDArray[np.float64]

BURST_WINDOWS, BURST_SHARE, BURST_ECHOES = 4, 0.15, 3
"""A burst (assumed): from one to three times `longest_echo_s` after the trigger, the loudest channel has more than this
share of the gate's power in all of four windows, each half a gate long. Echoes do not fill them all; paths of a burst
that cancel leave a quarter of it now and then."""


@dataclass(frozen=True, kw_only=True)
class Listener:
    """What is a robot's own where several with the same receiver listen.

    Attributes:
        array: The array as it was really built.
        scene: All that radiates, and what stands about.
        nature_rng: When the sources discharge, and how strongly.
        receiver_rng: Noise and triggers.
    """

    array: HelicalArray
    scene: Scene
    nature_rng: np.random.Generator
    receiver_rng: np.random.Generator


class Receiver:
    """One make of receiver: what follows from its settings.

    Args:
        config: The settings.
        n_elements: How many channels it has.

    Attributes:
        config: As given.
        n_elements: As given.
        front_end: The band-pass.
        faults: Faults of the channels.
    """

    def __init__(self, config: ReceiverConfig, n_elements: int) -> None:
        self.config = config
        self.n_elements = n_elements
        band_hz = None if config.band_hz == "all" else config.band_hz
        self.front_end = front_end(config.sample_rate_hz, band_hz, config.gate_samples)
        self.faults = Faults(config.faults, n_elements)

    @property
    def step_v(self) -> float:
        """What one count of the converter stands for."""
        return self.config.full_scale_v / (2 ** (self.config.bits - 1) - 1)

    @cached_property
    def filtered_noise_v(self) -> float:
        """Standard deviation of the noise behind the band-pass."""
        return self.config.noise_v * float(np.sqrt(self.front_end.noise_power))

    @cached_property
    def noise_variance_v2(self) -> float:
        """Variance of one sample without a pulse: filtered noise, and the converter's rounding (within one count)."""
        return self.filtered_noise_v**2 + self.step_v**2 / 12

    @cached_property
    def threshold_v(self) -> float:
        """Trigger level that noise alone crosses `false_alarm_rate_hz` times a second in all channels together."""
        config = self.config
        correlation = float(self.front_end.correlation[1]) if config.gate_samples > 1 else 0.0
        samples_hz = self.n_elements * config.sample_rate_hz
        return self.filtered_noise_v * threshold_over_noise(config.false_alarm_rate_hz, samples_hz, correlation)

    def trigger(self, above_v: float = 0.0) -> Trigger:
        """The trigger, its level so much above that of `threshold_v`."""
        noise_v, level_v = self.filtered_noise_v, self.threshold_v + above_v
        return Trigger(level_v, noise_v, self.front_end.correlation, probabilities(level_v / noise_v), STEP * noise_v)

    def chain(self, array: HelicalArray, above_v: float = 0.0) -> ReceiverChain:
        """All that is behind the feeds of an array, its trigger level so much above that of `threshold_v`."""
        config, front_end = self.config, self.front_end
        rate_hz, correlation = config.sample_rate_hz, front_end.correlation
        n_aperture, n_decay = round(aperture_m(array) / SPEED_OF_LIGHT_MPS * rate_hz), round(2 * DECAY_S * rate_hz)
        timing = Timing(
            before=config.pretrigger_samples,
            aperture=n_aperture,
            rise=round(front_end.pulse_lag) + n_decay,
            peak=n_aperture + n_decay,
            gate=config.gate_samples,
            apart=correlation.size,
        )
        n_window, n_echo = max(config.gate_samples // 2, 1), round(config.longest_echo_s * rate_hz)
        burst = BurstTest(
            first=max(n_echo, config.gate_samples),
            step=max((BURST_ECHOES * n_echo - n_echo - 2 * n_window) // (BURST_WINDOWS - 1), n_window),
            n_windows=BURST_WINDOWS,
            n_samples=n_window,
            share=BURST_SHARE,
        )
        noise = front_end.noise_filter(config.noise_v)
        highest = 2 ** (config.bits - 1) - 1
        return ReceiverChain(
            Sampler(self.pulse_table(array), noise, timing, self.trigger(above_v), burst),
            Converter(self.step_v, float(highest)),
            GateParameters(
                front_end.energy_spread,
                front_end.noise_on_pulse,
                config.mains_hz,
                (highest - 0.5) * self.step_v,
                self._band_reading,
            ),
        )

    @cached_property
    def _band_reading(self) -> BandReading:
        """How strengths in sub-bands are read."""
        config, front_end = self.config, self.front_end
        if not config.band_edges_hz:
            return BandReading(np.empty((0, 0, config.gate_samples)), np.empty(0), np.empty(0), np.empty(0))
        bands = SubBands(config.band_edges_hz, config.sample_rate_hz, config.gate_samples, front_end.correlation)
        since = np.arange(config.gate_samples, dtype=np.float64) - config.pretrigger_samples
        pulse = front_end.pulse(since + front_end.pulse_lag)
        return BandReading(bands.lines, bands.noise_samples, bands.energy_spread, bands.noise_on(pulse))

    def pulse_table(self, array: HelicalArray) -> PulseTable:
        """The filtered pulse, in bands where the gain of an array depends on frequency."""
        pattern, front_end = array.pattern, self.front_end
        if not isinstance(pattern, SpatialPattern):
            return front_end.pulse_table
        return front_end.pulse_in_bands(front_end.bands_hz(pattern.frequency_hz))

    def grid(self, array: HelicalArray) -> GainGrid:
        """Gains of an array in the bands of `pulse_table`; none where its pattern is one in the plane."""
        if not isinstance(array.pattern, SpatialPattern):
            return NO_GRID
        table, bands_hz = self.pulse_table(array), self.front_end.bands_hz(array.pattern.frequency_hz)
        peak = np.sqrt(np.square(table.sine_v) + np.square(table.cosine_v)).max(axis=(1, 2))
        return gain_grid(array.pattern, bands_hz, peak)

    def tones(self, carriers: Sequence[Carrier], array: HelicalArray, world_from_array: FloatArray) -> Tones:
        """What the band-pass leaves of carriers, in the channels of an array at a place (4, 4)."""
        n, rate_hz = self.n_elements, self.config.sample_rate_hz
        tones = Tones(np.empty((len(carriers), n)), np.empty((len(carriers), n)), np.empty(len(carriers)))
        heading_rad = np.arctan2(world_from_array[1, 0], world_from_array[0, 0])
        for row, carrier in enumerate(carriers):
            azimuth_rad = np.full(n, carrier.bearing_rad - heading_rad)
            sight = np.array([np.cos(azimuth_rad[0]), np.sin(azimuth_rad[0])])
            gain = array.gain(azimuth_rad, np.zeros(n), carrier.frequency_hz)
            tones.amplitude_v[row] = carrier.amplitude_v * self.front_end.response(carrier.frequency_hz) * gain
            tones.phase_rad[row] = (
                2 * np.pi * carrier.frequency_hz / SPEED_OF_LIGHT_MPS * array.positions_m[:, :2] @ sight
            )
            tones.turn_rad[row] = 2 * np.pi * carrier.frequency_hz / rate_hz
        return tones


def aperture_m(array: HelicalArray) -> float:
    """Extent of the elements, the larger of breadth and height: how far apart in space arrivals may begin."""
    breadth_m = 2 * float(np.linalg.norm(array.positions_m[:, :2], axis=-1).max())
    return max(breadth_m, float(np.ptp(array.positions_m[:, 2])))
