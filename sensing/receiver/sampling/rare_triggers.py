"""Pulses that hardly ever trigger: whether one does is drawn before anything is sampled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.compiled import compiled
from pdpatrol.sensing.receiver.sampling.noise import draw_tail, tail_probability
from pdpatrol.sensing.receiver.sampling.record import PIECE, Record, Windows, fill, fill_signal
from pdpatrol.sensing.receiver.sampling.sampler import Incoming, Sampler, Trigger

FloatArray = NDArray[np.float64]

LIKELY = 0.3
"""Samples expected beyond the trigger level from which on a window is sampled at once. Below, a draw decides first
whether there is anything to sample; the law is the same, see `gate.find_trigger`."""


@compiled
def step_probability(trigger: Trigger, signal_v: float) -> float:
    """That a sample with so much signal, rounded up to the next step, triggers; 1 beyond the last step."""
    step = math.ceil(abs(signal_v) / trigger.step_v)
    return trigger.probability[step] if step < trigger.probability.size else 1.0


@compiled
def expect(
    record: Record, windows: Windows, w: int, incoming: Incoming, sampler: Sampler, limit_v: FloatArray
) -> float:
    """How many samples of a window are expected to exceed the level; it is not counted on beyond `LIKELY`."""
    expected, trigger, row = 0.0, sampler.trigger, windows.first[w] + sampler.timing.before
    while row < windows.search_end[w] and expected <= LIKELY:
        end = min(row + PIECE, windows.search_end[w])
        fill_signal(record, windows, w, end, incoming, sampler.pulse)
        for t in range(row, end):
            for e in range(limit_v.size):
                if limit_v[e] > trigger.level_v:
                    expected += step_probability(trigger, record.volts[t, e])
        row = end
    return expected


class Fixed(NamedTuple):
    """The sample that is known to exceed the level.

    Attributes:
        row: Of it; -1 for none.
        channel: Of it.
        added_v: To the noise that was drawn for it.
    """

    row: int
    channel: int
    added_v: float


@compiled
def follow(volts: FloatArray, first: int, end: int, fixed: Fixed, correlation: FloatArray) -> None:
    """Let the noise from row `first` to `end` follow that of the sample that is fixed, if one is."""
    if fixed.row < 0:
        return
    for t in range(max(first, fixed.row - correlation.size + 1), min(end, fixed.row + correlation.size)):
        volts[t, fixed.channel] += fixed.added_v * correlation[abs(t - fixed.row)]


@compiled
def fix_one(
    record: Record,
    windows: Windows,
    w: int,
    left: float,
    incoming: Incoming,
    sampler: Sampler,
    limit_v: FloatArray,
    rng: np.random.Generator,
) -> Fixed:
    """Choose the sample at which the sum of the probabilities passes `left`; let it exceed the level; fill the window.

    The table of probabilities is rounded up: what it has too much is made up for by choosing none now and then.
    """
    trigger, before = sampler.trigger, sampler.timing.before
    row = channel = -1
    probability = 0.0
    for t in range(windows.first[w] + before, windows.search_end[w]):
        for e in range(limit_v.size):
            if row < 0 and limit_v[e] > trigger.level_v:
                probability = step_probability(trigger, record.volts[t, e])
                left -= probability
                if left < 0.0:
                    row, channel = t, e
    if row < 0:
        return Fixed(-1, -1, 0.0)
    signal_v = record.volts[row, channel]
    below, above = (
        (trigger.level_v - abs(signal_v)) / trigger.noise_v,
        (trigger.level_v + abs(signal_v)) / trigger.noise_v,
    )
    with_signal = tail_probability(below)
    exact = with_signal + tail_probability(above)
    if rng.random() * probability >= exact:
        return Fixed(-1, -1, 0.0)
    side = 1.0 if signal_v >= 0.0 else -1.0
    if rng.random() * exact < with_signal:
        noise_v = side * trigger.noise_v * draw_tail(below, rng)
    else:
        noise_v = -side * trigger.noise_v * draw_tail(above, rng)
    fill(record, windows, w, windows.search_end[w], incoming, sampler, rng)
    fixed = Fixed(row, channel, signal_v + noise_v - record.volts[row, channel])
    follow(record.volts, windows.first[w], windows.search_end[w], fixed, trigger.correlation)
    return fixed
