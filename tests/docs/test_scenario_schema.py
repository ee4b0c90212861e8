"""The published schema of scenarios is made from the models, accepts all that ship, and refuses invalid ones."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from pdpatrol.envs.scenario import ScenarioError, load_scenario
from pdpatrol.envs.scenario.loader import schema_text
from tests.docs.site import ROOT
from tests.envs.helpers import write_yard

PUBLISHED = ROOT / "docs" / "schemas" / "scenario.schema.json"
ACCEPTS = jsonschema.Draft202012Validator(json.loads(PUBLISHED.read_text(encoding="utf-8")))
SHIPPED = sorted(
    file
    for folder in ("envs/scenarios", "examples")
    for file in (ROOT / folder).rglob("*.toml")
    if file.name != "suite.toml"
)


def in_json(file: Path) -> dict:
    """Read a TOML file the way an editor's validator does, with dates as strings."""
    return json.loads(json.dumps(tomllib.loads(file.read_text(encoding="utf-8")), default=str))


def test_published_schema_is_valid_and_made_from_the_models() -> None:
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text(), "run docs/schemas/make_schema.py"
    jsonschema.Draft202012Validator.check_schema(json.loads(schema_text()))


@pytest.mark.whole
def test_schema_accepts_every_scenario_that_ships() -> None:
    assert len(SHIPPED) > 200
    assert [file for file in SHIPPED if not ACCEPTS.is_valid(in_json(file))] == []


@pytest.mark.parametrize(
    ("before", "after"),
    [
        pytest.param("[route]", "[reciever]\nnoise_v = 1e-3\n\n[route]", id="unknown table"),
        pytest.param("[route]", "[receiver]\nnoise = 1e-3\n\n[route]", id="unknown key"),
        pytest.param("[route]", "[campaign]", id="no route"),
        pytest.param("size_m = [40.0, 30.0]", 'size_m = "large"', id="size in words"),
        pytest.param("dock_m = [3.0, 3.0]", "dock_m = [3.0]", id="place of one number"),
        pytest.param('shape = "box"', 'shape = "sphere"', id="unknown shape"),
        pytest.param("height_m = 3.2", "height_m = -3.2", id="negative height"),
        pytest.param("gain_error = 0.05", "gain_error = 5.0", id="gain error out of bounds"),
        pytest.param("[route]", '[campaign]\nnumber = 1\nbegins = "in March"\n\n[route]', id="date in words"),
        pytest.param(
            "[route]", '[receiver]\nfaults = [{ channel = 1, kind = "tired" }]\n\n[route]', id="unknown channel fault"
        ),
    ],
)
def test_schema_and_loader_refuse_an_invalid_scenario(before: str, after: str, tmp_path: Path) -> None:
    file = write_yard(tmp_path, "", (before, after))
    assert not ACCEPTS.is_valid(in_json(file))
    with pytest.raises(ScenarioError):
        load_scenario(file)
