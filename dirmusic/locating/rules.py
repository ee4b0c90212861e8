"""Rules of the Locator: which pulses count, how they are associated, and what initiates and confirms a finding.

All values are assumed unless marked as measured. A scenario may set each of them in its table `[locating]`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np


@dataclass(frozen=True, kw_only=True)
class CredibilityRules:
    """Limits within which a pulse is consistent with one plane wave from one direction.

    Attributes:
        max_std_rad: Largest deviation that noise may add to that of the estimator's own method; triggers by noise have
            a much larger one.
        misfit_factor: Largest share of the energy that the direction may leave unexplained, as a multiple of what
            noise, the array's spread and `misfit_floor` explain.
        misfit_floor: Share of the energy that the far-field model of a perfect array leaves unexplained close by.
    """

    max_std_rad: float = np.radians(12.0)
    misfit_factor: float = 3.0
    misfit_floor: float = 0.05**2


@dataclass(frozen=True, kw_only=True)
class AssignmentRules:
    """Conditions under which a pulse is associated with a finding.

    The level of a pulse is its strength times its range to a finding. The level of a finding is that of its pulses on
    the direct path.

    Attributes:
        gate_sigmas: Largest offset of a bearing from a finding, in standard deviations.
        level_window_s: Pulses within this time and `level_arc_rad` are judged by their median strength.
        level_arc_rad: Width of the arc of bearings that share a median strength.
        obstruction_db: A pulse in a finding's gate this far below its level was diffracted around an obstacle.
        direct_path_db: A pulse in a confirmed finding's gate no further below its level than this came on the direct
            path, whatever the map says: an obstacle attenuates more.
        ghost_db: While the map obstructs a confirmed finding, pulses of any bearing that do not exceed its level by
            this much are its multipath, up to the number of direct pulses that are missing.
        bias_arc_rad: While a confirmed finding is in sight, pulses at its level whose bearing is off by less than this
            are its own, biased by a reflection within the gate. They are left out and initiate no candidate, up to the
            number of direct pulses that are missing.
        bias_db: Largest difference of level between such pulses and the finding.
        sight_loss_db: Largest attenuation on the direct path to a finding in sight: one insulator or a fence, not two.
        clear_loss_db: Attenuation above which other paths may be stronger than the direct one.
        surface_depth_m: A finding this far behind a surface is still in sight, because its position is not known
            better.
        edge_margin_m: A finding may be obstructed if it would be, this far to one side: map and poses are not known
            better.
        detection_range_m: Distance within which a finding in sight should be detected, or 1.25 times the smallest
            distance at which it was, if that is larger.
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


@dataclass(frozen=True, kw_only=True)
class LocatingRules:
    """Conditions under which pulses initiate a candidate, and under which it is confirmed.

    Attributes:
        solver: Quantities that positions are fitted to: `joint`, the strengths, together with the errors of the array;
            or `bearings`, the estimator's bearings and deviations alone.
        credibility: Which pulses count.
        assignment: How pulses are associated with findings.
        initiation_pulses: Number of unassigned pulses from one direction, within `initiation_s`, that initiate a
            candidate.
        initiation_s: Age up to which unassigned pulses can initiate a candidate.
        initiation_arc_rad: Half the arc that counts as one direction.
        initiation_by_crossing: Whether pulses whose lines of sight cross at one place initiate a candidate, too. It is
            meant for field data with a pulse or two from each pose; two sources have ghosts where their lines cross.
        refit_s: Time between fits.
        max_pulses: Number of pulses of one finding that a fit uses, each pooled from those of one place, heading and
            direction.
        confirm_aperture_rad: Smallest angle over which the lines of sight must spread.
        confirm_semi_major_m: Longest 95 % ellipse that is confirmed; 1.5 times that for a finding that was observed for
            long, with 40 times `confirm_pulses` over `planned_aperture_rad`.
        confirm_range_m: Distance on plan within which the finding must have been detected.
        confirm_pulses: Number of pulses that the finding must have. A confirmed finding that loses half of them, or
            moves by more than `merge_m` in one fit, is a candidate again.
        confirm_disagreement: Largest normalised disagreement of its bearings, see `confirmation.disagreement`. Measured
            when findings were confirmed in cluttered yards: at most 1.5 for 35 sources, 1.4 to 1.9 for multipath of an
            interferer that moves.
        confirm_detection_rate: Share of the seconds, near the finding and in sight of it, in which it must have been
            detected if anything was; multipath from one reflector arrives in few places. A confirmed finding below
            half of it is a candidate again. Seconds in which all of its pulses are too weak do not count. Without a
            map the rule is met.
        ghost_detection_rate: A candidate with a smaller share is a ghost.
        ghost_observed_s: Number of seconds from which on that share counts against a candidate.
        ghost_silent_s: A candidate from which no pulse came in this many seconds near it and in sight of it is a ghost,
            or has stopped; pulses that come from there later bring it back under the same id.
        ghost_semi_major_m: Longest 95 % ellipse of a candidate whose share counts against it; a candidate known less
            well may be elsewhere.
        least_range_m: A finding known as well as confirmed ones, and nearer than this to a place where the middle of
            the array was, is a ghost: the robot stood there.
        merge_m: Distance within which two findings are one.
    """

    solver: Literal["joint", "bearings"] = "joint"
    credibility: CredibilityRules = field(default_factory=CredibilityRules)
    assignment: AssignmentRules = field(default_factory=AssignmentRules)
    initiation_pulses: int = 6
    initiation_s: float = 10.0
    initiation_arc_rad: float = np.radians(8.0)
    initiation_by_crossing: bool = False
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
        """Aperture that routes are planned for: a third more than confirms, because driven routes differ (assumed)."""
        return 4.0 / 3.0 * self.confirm_aperture_rad
