"""What the lidar saw and the plan does not show, remembered for a while."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.robot_models.sensors import LIDAR_BEAMS

FloatArray = NDArray[np.float64]

SEEN_WITHIN_M = 2.5
"""Nearer beams count (assumed): further out, the error of the heading moves what they meet."""

EXPLAINED_M = 0.2
"""What stands this close to equipment or fence is that (assumed): three deviations of pose and range."""

PLACE_M = 0.1
"""Places are told apart to this length (assumed), half the radius of a small robot."""

REMEMBERED_S = 60.0
"""How long a place counts as occupied after it was last seen so (assumed): time to drive round it."""

_BEAM_RAD = 2.0 * np.pi * np.arange(LIDAR_BEAMS) / LIDAR_BEAMS


class SeenObstacles:
    """Places that are occupied though the plan shows them free, and when each was last seen so."""

    def __init__(self) -> None:
        self._last_seen_s: dict[tuple[int, int], float] = {}
        self._shown: frozenset[tuple[int, int]] = frozenset()
        self._map: SiteMap | None = None

    def look(self, lidar_m: NDArray[np.floating], pose: FloatArray, time_s: float, plan: SiteMap) -> None:
        """Note what the beams (LIDAR_BEAMS,), metres, met around a believed pose (3,) and `plan` does not explain."""
        near = lidar_m < SEEN_WITHIN_M
        bearing = pose[2] + _BEAM_RAD[near]
        points = pose[:2] + lidar_m[near, np.newaxis] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
        self.note(points[plan.yard.clearance(points) > EXPLAINED_M], time_s)

    def note(self, points_m: FloatArray, time_s: float) -> None:
        """Remember points (n, 2), world frame, and forget what was last seen long ago."""
        for x, y in np.round(points_m / PLACE_M).astype(int).tolist():
            self._last_seen_s[x, y] = time_s
        kept = {place: seen_s for place, seen_s in self._last_seen_s.items() if time_s - seen_s < REMEMBERED_S}
        self._last_seen_s = kept

    def on(self, plan: SiteMap) -> SiteMap:
        """The plan with what is remembered; the same object as long as nothing changes."""
        places = frozenset(self._last_seen_s)
        if self._map is None or places != self._shown:
            occupied_m = PLACE_M * np.array(sorted(places), dtype=np.float64).reshape(-1, 2)
            self._map = plan.with_obstacles(occupied_m) if places else plan
            self._shown = places
        return self._map
