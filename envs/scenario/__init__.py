"""Scenario files: definition of their tables, validation and loading."""

from pdpatrol.envs.scenario.base import ScenarioError
from pdpatrol.envs.scenario.loader import SHIPPED, check_content, load_scenario, restore_scenario, shipped_scenarios
from pdpatrol.envs.scenario.scenario import Scenario

__all__ = [
    "SHIPPED",
    "Scenario",
    "ScenarioError",
    "check_content",
    "load_scenario",
    "restore_scenario",
    "shipped_scenarios",
]
