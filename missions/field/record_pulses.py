"""Pulses of one record: offsets removed, noise measured, and all pulses found and gated as by the receiver."""

from typing import NamedTuple

import numpy as np

from dirmusic import pulse_start
from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.pulses.clipping import Extremes
from dirmusic.pulses.strengths import find_gates
from pdpatrol.missions.field.instruments import WaveformRecord
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.front_end import front_end

FALSE_ALARMS = 1e-3
"""Expected number of triggers by noise in a segment of a record. Assumed; the level is then 5 standard deviations of
the noise, and changes by a tenth of that for a tenth of the false alarms."""

BEFORE = ReceiverConfig().pretrigger_samples / ReceiverConfig().gate_samples
"""Share of the gate before the half peak of the strongest channel, as in the receiver of the missions."""

LEAST_EXCESS = 5.0
"""Energy of a gate above that of the noise, in standard deviations, from which a record without a trigger still holds a
pulse. Assumed; noise alone reaches 4 in records of a thousand samples."""

LEAST_QUIET = 16
"""Number of samples outside all gates from which they give offset and noise."""


class RecordPulses(NamedTuple):
    """Pulses of one record.

    Attributes:
        energy_v2: Energy of each gate, offsets removed, shape (n_pulses, n_channels).
        touches: True where a gate has a sample at the lowest or highest value of the record, shape (n_pulses, 2,
            n_channels).
        gates_v: Samples of those gates that have such a sample, by the number of the pulse, offsets removed, shape
            (n_channels, n_gate) each.
        extremes: Extreme samples of the record.
        offset_v: Mean of the quiet part, shape (n_channels,); 0 without a quiet part.
        noise_v2: Variance of the quiet part, same shape.
        n_quiet: Number of quiet samples per channel.
        n_empty: Number of segments without a pulse.
    """

    energy_v2: FloatArray
    touches: BoolArray
    gates_v: dict[int, FloatArray]
    extremes: Extremes
    offset_v: FloatArray
    noise_v2: FloatArray
    n_quiet: int
    n_empty: int


def find_pulses(record: WaveformRecord, n_gate: int, noise_v: float | None) -> RecordPulses:
    """Find all pulses of a record.

    A segment in which no sample triggers holds a pulse if the gate with the most energy clearly exceeds the noise, or
    if it is shorter than two gates.

    Args:
        record: The record.
        n_gate: Length of a gate, at most that of the record.
        noise_v: Standard deviation of a noise sample; None to estimate it from the record.
    """
    volts, extremes = record.volts, Extremes.of(record.samples, record.volts_per_count)
    n_channels, n_samples = volts.shape[1:]
    by_channel = volts.swapaxes(0, 1).reshape(n_channels, -1)
    middle_v = np.median(by_channel, axis=1)
    std_v = np.full(n_channels, noise_v or 0.0)
    if noise_v is None:
        std_v = 1.4826 * np.median(np.abs(by_channel - middle_v[:, np.newaxis]), axis=1)
    std_v = np.where(std_v > 0, std_v, np.maximum(by_channel.std(axis=1), 1e-300))
    n_before = round(BEFORE * n_gate)
    receiver = front_end(record.sample_rate_hz, "all", n_gate)
    level = receiver.threshold_over_noise(FALSE_ALARMS * record.sample_rate_hz / n_samples, n_channels)
    start = [
        _starts((segment - middle_v[:, np.newaxis]) / std_v[:, np.newaxis], level, n_before, n_gate)
        for segment in volts
    ]
    since = np.arange(n_samples)
    is_quiet = np.array([_is_quiet(since, of_segment, n_gate) for of_segment in start])
    offset_v, noise_v2, n_quiet = np.zeros(n_channels), np.full(n_channels, np.nan), int(is_quiet.sum())
    if n_quiet >= LEAST_QUIET:
        quiet_v = volts.swapaxes(1, 2)[is_quiet]
        is_constant = np.ptp(by_channel, axis=1) == 0
        offset_v = np.where(is_constant, by_channel[:, 0], quiet_v.mean(axis=0))
        noise_v2 = np.maximum(quiet_v.var(axis=0), np.square(extremes.step_v) / 12)
    cuts = [(k, at) for k, of_segment in enumerate(start) for at in of_segment]
    raw_v = np.array([volts[k, :, at : at + n_gate] for k, at in cuts]).reshape(-1, n_channels, n_gate)
    touches = np.array([(raw_v == end_v[:, np.newaxis]).any(axis=-1) for end_v in extremes.volts]).swapaxes(0, 1)
    gates_v = raw_v - offset_v[:, np.newaxis]
    return RecordPulses(
        energy_v2=np.square(gates_v).sum(axis=-1),
        touches=touches,
        gates_v={int(k): gates_v[k].copy() for k in np.flatnonzero(touches.any(axis=(1, 2)))},
        extremes=extremes,
        offset_v=offset_v,
        noise_v2=noise_v2,
        n_quiet=n_quiet,
        n_empty=sum(not len(of_segment) for of_segment in start),
    )


def _starts(sigmas: FloatArray, level: float, n_before: int, n_gate: int) -> list[int]:
    """Return the first samples of the gates in a segment, whose samples are in standard deviations of the noise."""
    padded = np.pad(sigmas, ((0, 0), (n_before, 0)))
    found = find_gates(padded, level, n_before, n_gate - n_before, n_gate) - n_before
    if found.size:
        return np.maximum(found, 0).tolist()
    strongest = int(pulse_start(sigmas, n_gate))
    energy = np.square(sigmas[:, strongest : strongest + n_gate]).sum()
    n = sigmas.shape[0] * n_gate
    is_pulse = sigmas.shape[1] < 2 * n_gate or energy - n > LEAST_EXCESS * np.sqrt(2.0 * n)
    return [strongest] if is_pulse else []


def _is_quiet(sample: FloatArray, starts: list[int], n_gate: int) -> BoolArray:
    """Return True for samples outside of pulses, which may begin before their gate and end after it."""
    is_quiet = np.ones(sample.size, dtype=np.bool_)
    for start in starts:
        is_quiet[max(start - 10, 0) : start + 2 * n_gate] = False
    return is_quiet
