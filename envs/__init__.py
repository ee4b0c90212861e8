"""The Gymnasium face of the testbed. Importing it registers `PDPatrol-v0`."""

import gymnasium

from envs.scenario import Scenario, ScenarioError, load_scenario, shipped_scenarios

__all__ = ["Scenario", "ScenarioError", "load_scenario", "shipped_scenarios"]

gymnasium.register(
    id="PDPatrol-v0", entry_point="envs.patrol:PatrolEnv", vector_entry_point="envs.vector:PatrolVectorEnv"
)
