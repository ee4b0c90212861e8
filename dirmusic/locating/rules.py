"""Rules of the Locator: which pulses it uses, how often it fits, and when it confirms a finding.

All values are assumed. A scenario can set each of them in its table `[locating]`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True, kw_only=True)
class LocatingRules:
    """Conditions under which pulses are used and findings confirmed.

    Attributes:
        refit_s: Time between fits.
        refit_share: Time between fits as a share of the time since the first one, if that is longer. By default,
            nothing changes in the first ten minutes; later, the cost per second does not grow any more.
        max_pulses: Largest number of groups of pulses of one finding in a fit. The pulses of a group share a place, a
            heading and a direction.
        max_std_rad: Largest standard deviation of a direction that is used. False alarms from noise have a larger one.
        confirm_probability: Smallest existence probability of a confirmed finding.
        confirm_aperture_rad: Smallest angle over which the lines of sight to a confirmed finding must spread.
        confirm_semi_major_m: Largest semi-major axis of the 95 % ellipse of a confirmed finding.
        confirm_range_m: Horizontal distance within which routes and reports expect a source to be confirmed.
        merge_m: Distance within which two findings are merged.
    """

    refit_s: float = 1.0
    refit_share: float = 0.0016
    max_pulses: int = 120
    max_std_rad: float = radians(25.0)
    confirm_probability: float = 0.99
    confirm_aperture_rad: float = radians(45.0)
    confirm_semi_major_m: float = 0.5
    confirm_range_m: float = 8.0
    merge_m: float = 0.5

    @property
    def planned_aperture_rad(self) -> float:
        """Aperture that routes are planned for. Assumed: a third more than needed, because driven routes deviate."""
        return 4.0 / 3.0 * self.confirm_aperture_rad
