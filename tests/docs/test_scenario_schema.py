"""The published schema of scenario files is that of the models, accepts what ships, and refuses what is broken."""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest

from pdpatrol.envs.scenario import ScenarioError, load_scenario
from pdpatrol.envs.scenario.loader import scenario_schema, schema_text
from tests.docs.site import ROOT

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


def test_the_published_schema_is_that_of_the_models_and_a_valid_one() -> None:
    assert PUBLISHED.read_text(encoding="utf-8") == schema_text(), "run docs/schemas/make_schema.py"
    jsonschema.Draft202012Validator.check_schema(scenario_schema())


def test_it_accepts_every_scenario_that_ships() -> None:
    assert len(SHIPPED) > 200
    refused = {
        file.name: error.message for file in SHIPPED if (error := next(ACCEPTS.iter_errors(in_json(file)), None))
    }
    assert refused == {}


def replaced(before: str, after: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert before in text
        return text.replace(before, after, 1)

    return change


BROKEN = {
    "a table that is none": lambda text: text + "\n[reciever]\nnoise_v = 1e-3\n",
    "a key that is none": lambda text: text + "\n[receiver]\nnoise = 1e-3\n",
    "no route": replaced("[route]", "[campaign]"),
    "a size in words": replaced("size_m = [40.0, 30.0]", 'size_m = "large"'),
    "a size of three numbers": replaced("size_m = [40.0, 30.0]", "size_m = [40.0, 30.0, 5.0]"),
    "a place of one number": replaced("dock_m = [3.0, 3.0]", "dock_m = [3.0]"),
    "a shape that is none": replaced('shape = "box"', 'shape = "sphere"'),
    "a negative height": replaced("height_m = 3.2", "height_m = -3.2"),
    "a kind of discharge that is none": replaced('kind = "void"', 'kind = "thunder"'),
    "a gain error beyond all bounds": replaced("gain_error = 0.05", "gain_error = 5.0"),
    "more elements than an array may have": replaced("gain_error = 0.05", "n_elements = 40"),
    "a date that is none": lambda text: text + '\n[campaign]\nnumber = 1\nbegins = "in March"\n',
    "a fault of a channel that is none": lambda text: (
        text + '\n[receiver]\nfaults = [{ channel = 1, kind = "tired" }]\n'
    ),
    "a latitude beyond the pole": lambda text: text + "\n[georeference]\nlatitude_deg = 95.0\nlongitude_deg = 0.0\n",
}


@pytest.mark.parametrize("name", BROKEN)
def test_schema_and_loader_refuse_what_is_broken(name: str, tmp_path: Path) -> None:
    file = tmp_path / "yard.toml"
    file.write_text(
        BROKEN[name]((ROOT / "envs/scenarios/one_source.toml").read_text(encoding="utf-8")), encoding="utf-8"
    )
    assert not ACCEPTS.is_valid(in_json(file))
    with pytest.raises(ScenarioError):
        load_scenario(file)


def test_the_line_for_editors_that_the_docs_tell_leads_to_the_schema() -> None:
    page = (ROOT / "docs" / "schemas" / "scenario.md").read_text(encoding="utf-8")
    (line,) = [line for line in page.splitlines() if line.startswith("#:schema ")]
    assert (ROOT / line.removeprefix("#:schema ")) == PUBLISHED
