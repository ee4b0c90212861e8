"""The table [locating]: every rule can be set, in degrees where the rule is in radians, within bounds."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs import ScenarioError, load_scenario
from pdpatrol.envs.scenario.locating import LocatingConfig

RULES = asdict(LocatingRules())


def key_of(rule: str) -> str:
    return f"{rule.removesuffix('_rad')}_deg" if rule.endswith("_rad") else rule


def test_every_rule_and_nothing_else_can_be_set() -> None:
    assert {key_of(rule) for rule in RULES} | {"locator", "calibration"} == set(LocatingConfig.model_fields)
    assert LocatingConfig().rules() == LocatingRules()


@pytest.mark.parametrize("rule", RULES)
def test_setting_a_rule_changes_that_rule_alone(rule: str) -> None:
    default = RULES[rule]
    value: Any = default + 1 if isinstance(default, int) else default + 0.01
    given = np.degrees(value).item() if rule.endswith("_rad") else value
    config = LocatingConfig.model_validate({key_of(rule): given, "locator": "my_file.py:MyLocator"})
    assert asdict(config.rules()) == RULES | {rule: pytest.approx(value)}


@pytest.mark.parametrize("rule", RULES)
def test_rule_has_bounds(rule: str) -> None:
    for value in (-1, 1e300, float("nan"), "x"):
        with pytest.raises(ScenarioError, match=rf"locating\.{key_of(rule)}: must .*, got "):
            load_scenario("one_source", {f"locating.{key_of(rule)}": value})
