"""The rules of locating: when a pulse counts, to which finding it belongs, what makes and what confirms a finding."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np


@dataclass(frozen=True, kw_only=True)
class CredibilityRules:
    """When a pulse looks like one plane wave from one direction. All values are assumed.

    Attributes:
        max_std_rad: Most that noise may add to the deviation of the estimator's own method; noise triggers are wider by
            far.
        misfit_factor: A pulse is not credible if its direction leaves this many times more of its energy unexplained
            than noise, the array's spread and `misfit_floor` explain.
        misfit_floor: Share of the energy that the far-field model of a perfect array leaves unexplained close by.
    """

    max_std_rad: float = np.radians(12.0)
    misfit_factor: float = 3.0
    misfit_floor: float = 0.05**2


@dataclass(frozen=True, kw_only=True)
class AssignmentRules:
    """When a pulse belongs to a finding. All values are assumed.

    The level of a pulse is its strength times its range to a finding; that of a finding, the level of its pulses that
    came on the direct path.

    Attributes:
        gate_sigmas: How many standard deviations off a finding a bearing may point and still belong to it.
        level_window_s: Pulses within so long a time and `level_arc_rad` are judged by their median strength.
        level_arc_rad: Width of the arc of bearings that share a median strength.
        obstruction_db: Pulses in a finding's gate that are this far below its level were diffracted round an obstacle.
        direct_path_db: Pulses in a confirmed finding's gate that are no further below its level than this came on the
            direct path, whatever the map says: an obstacle attenuates more.
        ghost_db: While the map obstructs a confirmed finding, pulses that are not this far above its level are its
            multipath ghosts, whatever their bearing; not more of them, though, than pulses of its own are missing.
        bias_arc_rad: While a confirmed finding is in sight, pulses at its level that point past it by less than this
            are its own, their bearing biased by a reflection within the gate; they are left out, and make no candidate,
            as far as they are no more than its pulses that are missing.
        bias_db: How far from the finding's level the level of such pulses may be.
        sight_loss_db: What takes no more than this from a wave on the straight path leaves in sight: one insulator or a
            fence, not two.
        clear_loss_db: What takes more than this from it, if less than that, lets other paths be the louder ones.
        surface_depth_m: A finding this far behind a surface is still in sight: it sits on the surface, and its position
            is not known better.
        edge_margin_m: What would be obstructed this far to one side may be obstructed: map and poses are not known
            better.
        detection_range_m: From how near a finding in sight should be detected, at least; from as near as it was, about.
    """

    gate_sigmas: float = 3.0
    level_window_s: float = 1.0
    level_arc_rad: float = np.radians(30.0)
    obstruction_db: float = 10.0
    direct_path_db: float = 4.0
    ghost_db: float = 2.0
    bias_arc_rad: float = np.radians(20.0)
    bias_db: float = 5.0
    sight_loss_db: float = 12.0
    clear_loss_db: float = 3.0
    surface_depth_m: float = 0.6
    edge_margin_m: float = 0.5
    detection_range_m: float = 6.0


APERTURE_MARGIN = 4.0 / 3.0
"""Routes are planned for so many times the aperture that confirms (assumed): what is driven is not what is planned."""


@dataclass(frozen=True, kw_only=True)
class LocatingRules:
    """When pulses make a candidate, and what confirms it. All values are assumed.

    Attributes:
        solver: What positions are fitted to: `joint`, the strengths, with the errors of the array fitted along; or
            `bearings`, the estimator's bearings and deviations alone.
        credibility: When a pulse is credible.
        assignment: When a pulse belongs to a finding.
        birth_pulses: Unassigned pulses from one direction, within `birth_s`, that make a candidate.
        birth_s: How long unassigned pulses can make a candidate.
        birth_arc_rad: Half the arc that counts as one direction.
        birth_by_crossing: Whether so many pulses whose lines of sight cross at one place make a candidate too: for data
            from the field, a pulse or two from each pose. Two sources have ghosts where their lines cross.
        refit_s: Time between fits.
        max_pulses: Pulses of one finding that a fit uses, each pooled of those of one place, heading and direction.
        confirm_aperture_rad: Lines of sight must spread over this angle: one line of bearings is no fix. How good a fix
            is, is for the ellipse to say.
        confirm_semi_major_m: The 95 % ellipse must be no longer than this to confirm; half as long again for what was
            seen for long, with 40 times `confirm_pulses` over `planned_aperture_rad`.
        confirm_range_m: The finding must have been detected from within this distance on plan; that it is known well
            enough is for the ellipse to say.
        confirm_pulses: The finding must have so many pulses. Confirmed findings that lose half of them, or jump by more
            than `merge_m`, are candidates again.
        confirm_disagreement: Its bearings may point past it by no more than this, root mean square over groups of
            pulses, in the deviations that they should have. That is 1 for sources, and was 1.5 at most of 35 in
            cluttered yards when they were confirmed; of echoes of an interferer that moves, 1.4 to 1.9 (measured).
        confirm_detection_rate: Near it and in sight of it, where there is a map, the finding must have been detected in
            this share of the seconds in which anything was, from the start: multipath from one reflector arrives in
            few places. Confirmed findings of less than half of it are candidates again. Seconds with pulses too weak
            for the finding, and with none of its own, do not count.
        ghost_detection_rate: A candidate with a smaller share is a ghost.
        ghost_observed_s: The share counts against a candidate once it is of so many seconds at least.
        ghost_silent_s: A candidate from which nothing came in so many seconds near it and in sight of it, one after the
            other, is a ghost as well, or discharges no more; pulses that come from there later bring it back under
            the same id.
        ghost_semi_major_m: The share counts against a candidate whose 95 % ellipse is no longer than this: else the
            candidate may be elsewhere.
        least_range_m: A finding that is known as well as confirmed ones, and nearer than this to where the middle of
            the array has been, is a ghost: the robot stood there.
        merge_m: Findings nearer to each other than this are one.
    """

    solver: Literal["joint", "bearings"] = "joint"
    credibility: CredibilityRules = field(default_factory=CredibilityRules)
    assignment: AssignmentRules = field(default_factory=AssignmentRules)
    birth_pulses: int = 6
    birth_s: float = 10.0
    birth_arc_rad: float = np.radians(8.0)
    birth_by_crossing: bool = False
    refit_s: float = 1.0
    max_pulses: int = 120
    confirm_aperture_rad: float = np.radians(45.0)
    confirm_semi_major_m: float = 0.5
    confirm_range_m: float = 8.0
    confirm_pulses: int = 20
    confirm_disagreement: float = 1.5
    confirm_detection_rate: float = 0.3
    ghost_detection_rate: float = 0.1
    ghost_observed_s: int = 5
    ghost_silent_s: int = 15
    ghost_semi_major_m: float = 2.0
    least_range_m: float = 0.3
    merge_m: float = 1.0

    @property
    def planned_aperture_rad(self) -> float:
        """Over which lines of sight spread where it is for a plan to say."""
        return APERTURE_MARGIN * self.confirm_aperture_rad
