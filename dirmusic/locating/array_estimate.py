"""Estimate of an array by the pulses of confirmed sources, and contradictions between it and the data sheet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from dirmusic.array.element_errors import EstimatedErrors
from dirmusic.locating.joint_fit import JointEstimate
from dirmusic.locating.measurement import N_PLACE, WIDENING

SIGNIFICANT_STD = 3.0
"""Deviation from the data sheet, in standard deviations, from which it is reported (assumed)."""

LEAST_WIDTH, LEAST_YAW_RAD, LEAST_PATTERN_ERROR = 0.05, np.radians(2.0), 0.05
"""Smallest deviations that are reported (assumed): width of the beam, yaw of the mount, and error of the pattern
relative to the largest gain. Smaller ones are within the spread of sound arrays, or change a bearing by less than a
degree."""


@dataclass(frozen=True, kw_only=True)
class ArrayEstimate:
    """Array as estimated in a mission, together with the confirmed sources.

    Attributes:
        errors: Posterior errors of the elements, which include those known from earlier missions.
        n_pulses: Number of pulses of this mission that were used.
        beam_width: Width of the beam relative to that of the data sheet.
        beam_width_std: Its standard deviation.
        yaw_rad: Yaw of the mount relative to the robot: mean of the pointing errors, counter-clockwise.
        yaw_std_rad: Its standard deviation.
        pattern_error: Standard deviation of the pattern from that of the data sheet, relative to the largest gain.
        unexplained_error: Relative error of the strengths that neither sources nor array explain.
    """

    errors: EstimatedErrors
    n_pulses: int
    beam_width: float
    beam_width_std: float
    yaw_rad: float
    yaw_std_rad: float
    pattern_error: float
    unexplained_error: float

    @classmethod
    def of_fit(cls, estimate: JointEstimate, n_pulses: int) -> Self:
        """Take the states of the array from a joint fit with n pulses."""
        at = estimate.positions_m.shape[0] * N_PLACE + WIDENING
        beam_width = 1.0 / (1.0 - float(estimate.state[at]))
        pointing = slice(estimate.errors.state.size // 3, 2 * estimate.errors.state.size // 3)
        return cls(
            errors=estimate.errors,
            n_pulses=n_pulses,
            beam_width=beam_width,
            beam_width_std=beam_width**2 * float(np.sqrt(estimate.covariance[at, at])),
            yaw_rad=float(estimate.errors.state[pointing].mean()),
            yaw_std_rad=float(np.sqrt(estimate.errors.covariance[pointing, pointing].mean())),
            pattern_error=estimate.levels.pattern,
            unexplained_error=estimate.levels.unexplained,
        )

    def contradictions(self) -> tuple[str, ...]:
        """Describe in one sentence each how the array differs from its data sheet; empty if it hardly does."""
        wider, turned = self.beam_width - 1.0, self.yaw_rad
        found: list[str] = []
        if abs(wider) > max(LEAST_WIDTH, SIGNIFICANT_STD * self.beam_width_std):
            side = "wider" if wider > 0.0 else "narrower"
            found.append(
                f"the beam of the antennas is {100.0 * abs(wider):.0f} +- {100.0 * self.beam_width_std:.0f} % {side} "
                "than that of the data sheet"
            )
        if abs(turned) > max(LEAST_YAW_RAD, SIGNIFICANT_STD * self.yaw_std_rad):
            side = "counter-clockwise" if turned > 0.0 else "clockwise"
            found.append(
                f"the array is turned by {np.degrees(abs(turned)):.1f} +- {np.degrees(self.yaw_std_rad):.1f} degrees "
                f"{side} against the robot"
            )
        if self.pattern_error > LEAST_PATTERN_ERROR:
            found.append(
                "the gain pattern of the antennas differs from that of the data sheet by "
                f"{100.0 * self.pattern_error:.0f} % of the largest gain"
            )
        return tuple(found)
