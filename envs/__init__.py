"""The Gymnasium face of the testbed. Importing it registers `PDPatrol-v0`."""

import gymnasium

from envs.scenario import Scenario, ScenarioError, load_scenario, shipped_scenarios

__all__ = ["Scenario", "ScenarioError", "load_scenario", "shipped_scenarios"]

gymnasium.register(
    id="PDPatrol-v0", entry_point="envs.patrol_env:PatrolEnv", vector_entry_point="envs.vector_env:PatrolVectorEnv"
)
