"""Pooling: pulses from one place and direction as the one pulse that they are worth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]


def pooled(pulses: PulseBatch, pose: FloatArray, group: NDArray[np.intp]) -> tuple[PulseBatch, FloatArray]:
    """One pulse for each group of pulses, with less noise: means, weighted by what noise leaves each pulse worth.

    Pulses have amplitudes of their own: of their strengths the shares are averaged, channel by channel, over the
    pulses in which the channel is usable.

    Args:
        pulses: With their directions, n rows.
        pose: Believed x m, y m, yaw rad at each pulse, world frame, shape (n, 3); nearly alike within a group.
        group: Which group each pulse belongs to, any numbers, shape (n,).

    Returns:
        The pulses, of unit strength, without sub-bands, and their poses, one row for each group in ascending order.
    """
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=group.min(initial=0) - 1))
    row = np.repeat(np.arange(starts.size), np.diff(starts, append=order.size))
    pulses, pose = pulses.take(order), pose[order]
    first_rad, first_yaw_rad = pulses.azimuth_rad[starts][row], pose[starts, 2][row]

    def total(values: FloatArray) -> FloatArray:
        return np.add.reduceat(values, starts, axis=0)

    usable_v = pulses.strengths_v * pulses.is_usable
    norm_v = np.linalg.norm(usable_v, axis=-1, keepdims=True)
    weight = pulses.is_usable * norm_v**2 / np.maximum(pulses.variance_v2, np.finfo(np.float64).tiny)
    of_channel = total(weight)
    is_usable = of_channel > 0.0
    of_channel = np.where(is_usable, of_channel, 1.0)
    precision = 1.0 / np.square(pulses.std_rad)
    of_bearing = total(precision)

    def mean(values: FloatArray) -> FloatArray:
        return total(precision * values) / of_bearing

    azimuth_rad = pulses.azimuth_rad[starts] + mean(difference(pulses.azimuth_rad, first_rad))
    yaw_rad = pose[starts, 2] + mean(difference(pose[:, 2], first_yaw_rad))
    one_each = PulseBatch.detected(
        time_s=mean(pulses.time_s),
        strengths_v=total(weight * usable_v / norm_v) / of_channel,
        variance_v2=1.0 / of_channel,
    )
    return one_each._replace(
        azimuth_rad=difference(azimuth_rad, 0.0),
        std_rad=1.0 / np.sqrt(of_bearing),
        misfit=mean(pulses.misfit),
        is_usable=is_usable,
    ), np.column_stack([mean(pose[:, 0]), mean(pose[:, 1]), yaw_rad])
