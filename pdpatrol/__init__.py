"""Test a PD inspection robot in simulation; importing the package registers the environment `PDPatrol-v0`."""

import gymnasium

gymnasium.register(
    id="PDPatrol-v0",
    entry_point="pdpatrol.envs.patrol_env:PatrolEnv",
    vector_entry_point="pdpatrol.envs.vector_env:PatrolVectorEnv",
)
