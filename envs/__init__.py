"""Gymnasium environments of the testbed and their scenarios."""

from pdpatrol.envs.scenario import Scenario, ScenarioError, load_scenario, shipped_scenarios

__all__ = ["Scenario", "ScenarioError", "load_scenario", "shipped_scenarios"]
