"""Oracle: the policy that knows the truth, as a yardstick for the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dirmusic import Finding
from pdpatrol.envs.patrol_env import Observation
from pdpatrol.missions.driving.collision_guard import CollisionGuard
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.protocol import Action, time_of
from pdpatrol.missions.policies.seek import Seek
from pdpatrol.missions.record.events import Phase

FloatArray = NDArray[np.float64]

DONE_WITHIN_M = 1.0
"""A confirmed finding this near to a source is taken for that source (assumed)."""


class Oracle:
    """Given the true positions of the sources: views each from several sides and goes home."""

    def __init__(self) -> None:
        self.phase = Phase("oracle")
        self.unreachable: tuple[int, ...] = ()
        self._seek = CollisionGuard(Seek(route_first=False))
        self._sources_m: list[FloatArray] = []

    def reveal(self, truth: dict[str, Any]) -> None:
        """Take in the true positions of the sources."""
        self._sources_m = [np.asarray(source["position_m"]) for source in truth["sources"]]

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """As `Seek`, with the truth for candidates until the Locator has confirmed something there."""
        confirmed = [f.position_m for f in findings if f.state == "confirmed"]
        known = [
            Finding(
                id=index + 1,
                state="candidate",
                position_m=position,
                covariance_m2=np.eye(3) * 1e-4,
                n_bearings=0,
                first_detected_s=0.0,
                last_detected_s=time_of(observation),
                confirmed_s=None,
                aperture_rad=0.0,
                nearest_m=np.inf,
                level_db=np.nan,
            )
            for index, position in enumerate(self._sources_m)
            if all(np.hypot(*(position - other)[:2]) > DONE_WITHIN_M for other in confirmed)
        ]
        action = self._seek(observation, known, site_map)
        self.phase, self.unreachable = self._seek.phase, self._seek.unreachable
        return action
