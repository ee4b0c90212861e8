"""Policy for missions: drive by the network that `train.py` has trained, until a discharge is confirmed.

uv run --extra rl pdpatrol run examples/learning/open_yard.toml --policy examples/learning/trained.py:Trained
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from stable_baselines3 import PPO

from dirmusic import Finding
from pdpatrol.envs.patrol_env import Observation, PatrolEnv
from pdpatrol.envs.wrappers import Flattener, bearings_only, bearings_only_space
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.protocol import Action
from pdpatrol.missions.record.events import Phase

MODEL = Path("runs/learning/model.zip")
"""Network to use, relative to the folder in which the command runs."""


class Trained:
    """Policy that gives the observations of training to the network, and drives by the mean of its actions."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.phase = Phase("trained policy")
        self._network = PPO.load(MODEL, device="cpu")
        env = PatrolEnv(Path(__file__).with_name("open_yard.toml"))
        self._flatten = Flattener(bearings_only_space(env.observation_space))

    def __call__(self, observation: Observation, findings: Sequence[Finding], site_map: SiteMap) -> Action | None:
        """Return forward speed and yaw rate in [-1, 1], or None when a discharge is confirmed."""
        if any(finding.state == "confirmed" for finding in findings):
            return None
        action, _ = self._network.predict(self._flatten(bearings_only(observation)), deterministic=True)
        return action
