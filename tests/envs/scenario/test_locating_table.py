"""The table [locating]: every rule can be set, in degrees where the rule is in radians, within bounds."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from dirmusic.locating.rules import AssignmentRules, CredibilityRules, LocatingRules
from pdpatrol.envs import ScenarioError, load_scenario
from pdpatrol.envs.scenario.locating import LocatingConfig

RULES = {
    field.name: (nested, getattr(rules(), field.name))
    for nested, rules in (("", LocatingRules), ("credibility", CredibilityRules), ("assignment", AssignmentRules))
    for field in fields(rules)
    if field.name not in {"credibility", "assignment"}
}
"""Name of the nested record and default of every rule."""


def key_of(rule: str) -> str:
    return f"{rule.removesuffix('_rad')}_deg" if rule.endswith("_rad") else rule


def test_every_rule_and_nothing_else_can_be_set() -> None:
    assert {key_of(rule) for rule in RULES} | {"locator", "calibration"} == set(LocatingConfig.model_fields)
    assert LocatingConfig().rules() == LocatingRules()


@pytest.mark.parametrize("rule", sorted(set(RULES) - {"solver"}))
def test_setting_a_rule_changes_that_rule_alone(rule: str) -> None:
    _, default = RULES[rule]
    value: Any = (not default) if isinstance(default, bool) else default + (1 if isinstance(default, int) else 0.01)
    given = np.degrees(value).item() if rule.endswith("_rad") else value
    rules = LocatingConfig.model_validate({key_of(rule): given}).rules()
    values = {name: getattr(getattr(rules, part) if part else rules, name) for name, (part, _) in RULES.items()}
    assert {name for name, (_, before) in RULES.items() if values[name] != before} == {rule}
    assert values[rule] == pytest.approx(value)


@pytest.mark.parametrize("rule", sorted(set(RULES) - {"solver", "initiation_by_crossing"}))
def test_rule_has_bounds(rule: str) -> None:
    for value in (-1, 1e300, float("nan"), "x"):
        with pytest.raises(ScenarioError, match=rf"locating\.{key_of(rule)}: must .*, got "):
            load_scenario("one_source", {f"locating.{key_of(rule)}": value})


def test_solver_and_user_locator_can_be_named() -> None:
    config = LocatingConfig.model_validate({"solver": "bearings", "locator": "my_file.py:MyLocator"})
    assert config.rules() == LocatingRules(solver="bearings")
