"""Gymnasium environments and the scenarios that configure them."""

from pdpatrol.envs.scenario import Scenario, ScenarioError, load_scenario, shipped_scenarios

__all__ = ["Scenario", "ScenarioError", "load_scenario", "shipped_scenarios"]
