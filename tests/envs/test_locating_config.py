"""The table [locating] of a scenario: every rule can be set, in the units of the edge, within bounds."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dirmusic.locating.rules import AssignmentRules, CredibilityRules, LocatingRules
from pdpatrol.envs.scenario.loader import SHIPPED, ScenarioError, load_scenario
from pdpatrol.envs.scenario.locating import LocatingConfig

NESTED = {"credibility", "assignment"}
RULES = {
    field.name: (nested, getattr(rules(), field.name))
    for nested, rules in (("", LocatingRules), ("credibility", CredibilityRules), ("assignment", AssignmentRules))
    for field in fields(rules)
    if field.name not in NESTED
}
"""Every rule: where it is nested, and its default."""


def key_of(rule: str) -> str:
    """The name of a rule in a scenario file, where angles are in degrees."""
    return f"{rule.removesuffix('_rad')}_deg" if rule.endswith("_rad") else rule


def faults_of(tmp_path: Path, table: str) -> tuple[str, ...]:
    path = tmp_path / "yard.toml"
    path.write_text(f"{(SHIPPED / 'one_source.toml').read_text()}\n[locating]\n{table}\n")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    return tuple(caught.value.faults)


def test_without_keys_the_rules_are_the_defaults() -> None:
    assert LocatingConfig().rules() == LocatingRules()
    assert load_scenario("one_source").locating == LocatingConfig()


def test_every_rule_and_nothing_else_can_be_set() -> None:
    assert {key_of(rule) for rule in RULES} | {"locator", "calibration"} == set(LocatingConfig.model_fields)


@pytest.mark.parametrize("rule", sorted(set(RULES) - {"solver"}))
def test_a_rule_that_is_set_is_the_one_that_changes(rule: str) -> None:
    nested, default = RULES[rule]
    value: Any = (not default) if isinstance(default, bool) else default + (1 if isinstance(default, int) else 0.01)
    given = np.degrees(value).item() if rule.endswith("_rad") else value
    rules = LocatingConfig.model_validate({key_of(rule): given}).rules()
    changed = {
        name
        for name, (inside, before) in RULES.items()
        if getattr(getattr(rules, inside) if inside else rules, name) != before
    }
    assert changed == {rule}
    assert getattr(getattr(rules, nested) if nested else rules, rule) == pytest.approx(value)


@pytest.mark.parametrize("rule", sorted(set(RULES) - {"solver", "birth_by_crossing"}))
def test_no_rule_takes_less_than_nothing_or_without_end(rule: str, tmp_path: Path) -> None:
    for value in ("-1", "1e300", "nan", '"x"'):
        (fault,) = faults_of(tmp_path, f"{key_of(rule)} = {value}")
        assert f"yard.toml: locating.{key_of(rule)}: got " in fault


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ('solver = "strengths"', "locating.solver: got 'strengths'; input should be 'joint' or 'bearings'"),
        ('locator = "MyLocator"', "locating.locator: no Locator `MyLocator`; allowed is code of your own"),
        ("max_std_rad = 0.1", "locating.max_std_rad: unknown key; allowed are solver, locator, calibration"),
    ],
)
def test_what_is_no_rule_is_refused_in_one_line(table: str, fault: str, tmp_path: Path) -> None:
    (line,) = faults_of(tmp_path, table)
    assert fault in line


def test_the_fix_and_a_locator_of_ones_own_can_be_named() -> None:
    config = LocatingConfig.model_validate({"solver": "bearings", "locator": "my_file.py:MyLocator"})
    assert config.rules() == LocatingRules(solver="bearings")
