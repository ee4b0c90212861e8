"""A receiver in plain numpy that samples every pulse from long before its first arrival on, and looks at all of it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from pdpatrol.sensing import HelicalArray, ReceiverConfig, Scene
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.nature.pulse_shape import DECAY_S, FREQUENCY_HZ, damped_pulse
from pdpatrol.sensing.radio.arrivals import Arrivals, propagate
from pdpatrol.sensing.radio.propagation import Propagation, SourceTable
from pdpatrol.sensing.receiver.front_end import FILTER_ORDER
from pdpatrol.sensing.receiver.receiver import BURST_ECHOES, BURST_SHARE, BURST_WINDOWS, Receiver, aperture_m

FloatArray = NDArray[np.float64]

LEAD = 400
"""Samples in which the filter forgets that it began at rest."""

FINE = 16
"""Into how many parts a sample is divided where a pulse is made."""


class Sampled(NamedTuple):
    """What a number of pulses gave: gates behind the converter (n, n_elements, n_gate), and how many were bursts."""

    gates_v: FloatArray
    n_bursts: int


def arrivals_of(scene: Scene, array: HelicalArray, world_from_array: FloatArray) -> Arrivals:
    """All paths of the first source of a scene."""
    sources = SourceTable(*(column[np.newaxis, :1] for column in (scene.positions_m, scene.axes, scene.burst_s)))
    around = Propagation(sources, ArrayTable.of([array]), scene.surroundings)
    return propagate(0, np.zeros(1), world_from_array[np.newaxis], around).arrivals


def sample(
    config: ReceiverConfig,
    array: HelicalArray,
    scene: Scene,
    world_from_array: FloatArray,
    n: int,
    rng: np.random.Generator,
) -> Sampled:
    """Gates of n pulses of the first source of a scene, all as loud as its typical one; no carriers, no faults."""
    receiver, arrivals = Receiver(config, array.n_elements), arrivals_of(scene, array, world_from_array)
    rate_hz, n_gate, source = config.sample_rate_hz, config.gate_samples, scene.sources[0]
    aperture, decay = round(aperture_m(array) / 299_792_458.0 * rate_hz), round(2 * DECAY_S * rate_hz)
    rise, echo = round(receiver.front_end.pulse_lag) + decay, round(config.longest_echo_s * rate_hz)
    first_s = arrivals.delay_s.min() - (LEAD + aperture + config.pretrigger_samples) / rate_hz
    n_samples = int(np.ptp(arrivals.delay_s) * rate_hz) + LEAD + 4 * echo + 1000
    gates, n_bursts = list[FloatArray](), 0
    for _ in range(n):
        start_s = first_s + rng.random() / rate_hz
        volts = _signal(arrivals, source.amplitude_v, source.burst_s, start_s, n_samples, rate_hz)
        volts = volts * (source.burst_s == 0.0) + config.noise_v * rng.standard_normal(volts.shape)
        if config.band_hz != "all":
            sections = butter(FILTER_ORDER, config.band_hz, btype="bandpass", fs=rate_hz, output="sos")
            volts = np.asarray(sosfilt(sections, volts, axis=-1))
        if source.burst_s > 0.0:  # in the band, and not filtered
            volts = volts + _signal(arrivals, source.amplitude_v, source.burst_s, start_s, n_samples, rate_hz)
        searched = np.zeros(n_samples, dtype=np.bool_)
        for arrives_s in arrivals.loudest_s:
            at = round((arrives_s - start_s) * rate_hz)
            searched[at - aperture : at + aperture + rise] = True
        above = searched & (np.abs(volts) > receiver.threshold_v).any(axis=0)
        if not above.any():
            continue
        crossing = int(above.argmax())
        level = np.abs(volts[:, crossing : crossing + aperture + decay])
        loudest = int(level.max(axis=1).argmax())
        back = crossing - config.pretrigger_samples
        half = back + int((np.abs(volts[loudest, back:]) >= 0.5 * level.max()).argmax())
        start = half - config.pretrigger_samples
        gate = volts[:, start : start + n_gate]
        background = receiver.noise_variance_v2
        least = BURST_SHARE * (np.square(gate[loudest]).mean() - background) + background
        step = (BURST_ECHOES * echo - echo - 2 * (n_gate // 2)) // (BURST_WINDOWS - 1)
        windows = [volts[loudest, start + echo + w * step :][: n_gate // 2] for w in range(BURST_WINDOWS)]
        if min(np.square(window).mean() for window in windows) > least:
            n_bursts += 1
            continue
        highest = 2 ** (config.bits - 1) - 1
        gates.append(np.clip(np.round(gate / receiver.step_v), -highest, highest) * receiver.step_v)
    return Sampled(np.array(gates).reshape(-1, array.n_elements, n_gate), n_bursts)


def _signal(
    arrivals: Arrivals, amplitude_v: float, burst_s: float, start_s: float, n_samples: int, rate_hz: float
) -> FloatArray:
    """What all paths bring to the elements before the filter, shape (n_elements, n_samples)."""
    time_s = start_s + np.arange(n_samples) / rate_hz - arrivals.delay_s[:, :, np.newaxis]
    if burst_s > 0.0:
        turn = np.exp(2j * np.pi * FREQUENCY_HZ * time_s)
        shape = ((time_s >= 0) & (time_s < burst_s)) * -1j * turn
    else:
        shape = damped_pulse(time_s) - 1j * damped_pulse(time_s, 0.5 * np.pi)
    return amplitude_v * (arrivals.amplitude[:, :, 0, np.newaxis] * shape).sum(axis=0).real
