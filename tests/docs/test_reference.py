"""The reference pages are those of the schema of scenarios and of the command line."""

import re
import runpy
from typing import Any

import pytest

from pdpatrol.envs.scenario.loader import scenario_schema
from pdpatrol.missions.cli import COMMANDS
from tests.docs.site import ROOT

DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def made() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "make_reference.py"))["PAGES"]


def page(name: str) -> str:
    return (DOCS / "reference" / name).read_text(encoding="utf-8")


def test_page_of_keys_is_that_of_the_schema(made: dict[str, Any]) -> None:
    assert page("scenario_keys.md") == made["scenario_keys.md"](), "run docs/make_reference.py"


def test_every_key_of_a_scenario_has_a_description() -> None:
    schema = scenario_schema()
    tables = {"Scenario": schema, **schema["$defs"]}
    keys = [(name, key, value) for name, table in tables.items() for key, value in table["properties"].items()]
    assert [(name, key) for name, key, value in keys if "$ref" not in value and not value.get("description")] == []
    assert [name for name, table in tables.items() if not table.get("description")] == []
    receiver = page("scenario_keys.md").partition("## `[receiver]` { #receiver }")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", receiver, re.MULTILINE) == list(tables["ReceiverConfig"]["properties"])
    assert re.search(r"^\| `noise_v` \| .* \| V \| `0.001` \| 1e-09 to 1000 \|$", receiver, re.MULTILINE)


@pytest.mark.whole
def test_page_of_commands_has_the_help_of_every_command(made: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("COLUMNS", "NO_COLOR", "TERM"):
        monkeypatch.setenv(name, "")  # restored after the page has set them
    assert page("commands.md") == made["commands.md"](), "run docs/make_reference.py"
    assert re.findall("^## (.*)$", page("commands.md"), re.MULTILINE) == list(COMMANDS)
    breaks = "line breaks of docstrings stay before lines that do not begin with a letter"
    assert re.findall(r"^(?:`(?!``)|\[).*$", page("commands.md"), re.MULTILINE) == [], breaks
