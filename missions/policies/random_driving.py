"""Random: the floor under all other policies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dirmusic import Finding
from pdpatrol.envs.patrol_env import Observation
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.protocol import Action
from pdpatrol.missions.record.events import Phase

HOLD_STEPS = 10
"""How many steps an action is kept (assumed): one second."""


class Random:
    """Drive at random, without any care for what stands in the way."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.phase = Phase("random")
        self.unreachable: tuple[int, ...] = ()
        self._rng = rng
        self._action = np.zeros(2, dtype=np.float32)
        self._n = 0

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """An action drawn anew every `HOLD_STEPS` steps."""
        if self._n % HOLD_STEPS == 0:
            self._action = self._rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        self._n += 1
        return self._action
