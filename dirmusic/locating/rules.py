"""Rules of the Locator: which pulses count, how they are associated, and what initiates and confirms a finding.

All values are assumed unless marked as measured. A scenario can set each of them in its table `[locating]`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np


@dataclass(frozen=True, kw_only=True)
class CredibilityRules:
    """Limits within which a pulse is consistent with a single plane wave.

    Attributes:
        max_std_rad: Largest standard deviation that noise may add to that of the estimator's method. False alarms from
            noise have a much larger one.
        misfit_factor: Largest share of the energy that a plane wave may leave unexplained, as a multiple of the share
            expected from noise, the array's spread and `misfit_floor`.
        misfit_floor: Share of the energy of a nearby source that the far-field model of a perfect array leaves
            unexplained.
    """

    max_std_rad: float = np.radians(12.0)
    misfit_factor: float = 3.0
    misfit_floor: float = 0.05**2


@dataclass(frozen=True, kw_only=True)
class AssignmentRules:
    """Conditions under which a pulse is associated with a finding.

    The level of a pulse is its strength times its range to a finding. The level of a finding is the level of its direct
    pulses.

    Attributes:
        gate_sigmas: Largest offset of a bearing from a finding, in standard deviations.
        level_window_s: Length of the time windows. Pulses in one window and one arc of `level_arc_rad` share their
            median strength.
        level_arc_rad: Width of the arcs of bearings in which pulses share their median strength.
        obstruction_db: A pulse in the gate of a finding and this far below its level was diffracted around an obstacle.
        direct_path_db: A pulse in the gate of a confirmed finding and at most this far below its level came on the
            direct path, whatever the map says, because an obstacle attenuates more.
        ghost_db: While a confirmed finding is obstructed on the map, pulses from any direction that do not exceed its
            level by more than this are its multipath, up to the number of missing direct pulses.
        bias_arc_rad: While a confirmed finding is in sight, pulses that have its level and miss its bearing by less
            than this belong to it, biased by a reflection within the gate. They are not used and initiate no candidate,
            up to the number of missing direct pulses.
        bias_db: Largest difference in level between such pulses and the finding.
        sight_loss_db: Largest attenuation on the direct path to a finding in sight: that of one insulator or fence, not
            of two.
        clear_loss_db: Attenuation above which other paths may be stronger than the direct one.
        surface_depth_m: Depth behind a surface down to which a finding is still in sight, because its position is not
            known more precisely.
        edge_margin_m: Sideways offset for the test of obstruction: a finding may be obstructed if it would be at this
            distance to one side, because map and poses are not known more precisely.
        detection_range_m: Distance within which a finding in sight should be detected. 1.25 times the smallest distance
            at which it was detected is used if that is larger.
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
    """Conditions under which pulses initiate a candidate, and under which a candidate is confirmed or dropped.

    Attributes:
        solver: Quantities that positions are fitted to: `joint` fits the strengths and estimates the errors of the
            array as well; `bearings` fits only the estimator's bearings, weighted by their standard deviations.
        credibility: Rules for the pulses that count.
        assignment: Rules for the association of pulses with findings.
        initiation_pulses: Number of unassigned pulses from one direction, within `initiation_s`, that initiate a
            candidate.
        initiation_s: Age up to which unassigned pulses can initiate a candidate.
        initiation_arc_rad: Half the width of the arc that counts as one direction.
        initiation_by_crossing: Whether pulses whose lines of sight cross at one place also initiate a candidate. This
            is meant for field data with one or two pulses from each pose. Two sources can cause ghosts where their
            lines of sight cross.
        refit_s: Time between fits.
        max_pulses: Largest number of pulses of one finding in a fit, each averaged over the pulses that share a place,
            a heading and a direction.
        confirm_aperture_rad: Smallest angle over which the lines of sight must spread.
        confirm_semi_major_m: Largest semi-major axis of the 95 % ellipse of a confirmed finding. It is 1.5 times larger
            for a finding that was observed for long: 40 times `confirm_pulses` over `planned_aperture_rad`.
        confirm_range_m: Horizontal distance within which the finding must have been detected.
        confirm_pulses: Number of pulses that the finding must have. A confirmed finding that loses half of them, or
            moves by more than `merge_m` in one fit, becomes a candidate again.
        confirm_disagreement: Largest normalised disagreement of the bearings of the finding, see
            `confirmation.disagreement`. Measured when findings were confirmed in cluttered yards: at most 1.5 for 35
            sources, 1.4 to 1.9 for multipath of a moving interferer.
        confirm_detection_rate: Share of the seconds in which the finding must have been detected, out of those in which
            the robot was near the finding and in sight of it and detected anything. Multipath from one reflector
            arrives in few places. A confirmed finding below half of this rate becomes a candidate again. Seconds in
            which all of its pulses are too weak do not count. Without a map the condition is always met.
        ghost_detection_rate: A candidate with a smaller share of such seconds is a ghost.
        ghost_observed_s: Number of such seconds from which on the share counts against a candidate.
        ghost_silent_s: A candidate from which no pulse came in this many seconds near it and in sight of it is a ghost
            or has stopped. Later pulses from there restore it under the same id.
        ghost_semi_major_m: Largest semi-major axis of the 95 % ellipse of a candidate whose share counts against it. A
            candidate that is located less precisely may be elsewhere.
        least_range_m: A finding that is located as precisely as a confirmed one, and is closer than this to a place
            where the middle of the array was, is a ghost: the robot stood there.
        merge_m: Distance within which two findings are merged.
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
        """Aperture that routes are planned for. Assumed: a third more than needed, because driven routes deviate."""
        return 4.0 / 3.0 * self.confirm_aperture_rad
