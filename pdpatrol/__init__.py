"""Simulation of a robot that locates partial discharges; importing it registers the environment `PDPatrol-v0`."""

import gymnasium

gymnasium.register(
    id="PDPatrol-v0",
    entry_point="pdpatrol.envs.patrol_env:PatrolEnv",
    vector_entry_point="pdpatrol.envs.vector_env:PatrolVectorEnv",
)
