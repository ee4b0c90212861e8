"""What a mission is told: one TOML file, its model, its checks and its loader."""

from pdpatrol.envs.scenario.base import ScenarioError
from pdpatrol.envs.scenario.loader import SHIPPED, load_scenario, restore_scenario, shipped_scenarios
from pdpatrol.envs.scenario.scenario import Scenario

__all__ = ["SHIPPED", "Scenario", "ScenarioError", "load_scenario", "restore_scenario", "shipped_scenarios"]
