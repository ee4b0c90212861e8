"""Scenarios drawn from the schema, bounds and all, and hostile changes to them, as plain data and as TOML."""

import json
import math
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, TypeAlias

import numpy as np
from hypothesis import strategies as st

from pdpatrol.envs.scenario import SHIPPED, Scenario, shipped_scenarios

Value: TypeAlias = Any
"""As TOML has it."""

SCHEMA = Scenario.model_json_schema()

SMALL: dict[str, Any] = {
    "yard": {
        "size_m": [20.0, 16.0],
        "equipment": [
            {"name": "tank", "kind": "power_transformer", "shape": "box", "position_m": [10.0, 9.0], "yaw_deg": 0.0,
             "footprint_m": [3.0, 2.0], "height_m": 2.5, "sites": {"south": [0.0, -1.0, 1.2]}},
            {"name": "ct", "kind": "current_transformer", "shape": "cylinder", "position_m": [5.0, 11.0],
             "radius_m": 0.35, "height_m": 2.5, "yaw_deg": 0.0, "sites": {"head": [0.0, -0.35, 2.1]}},
            {"name": "bb", "kind": "busbar", "length_m": 8.0, "position_m": [12.0, 13.5], "yaw_deg": 0.0},
        ],
    },
    "map": {"missing": ["ct"], "moved": [{"name": "tank", "by_m": [0.3, -0.2]}]},
    "route": {"dock_m": [3.0, 3.0], "dock_yaw_deg": 0.0, "waypoints_m": [[10.0, 5.0], [16.0, 8.0]]},
    "array": {"n_elements": 6, "gain_error": 0.05},
    "receiver": {"faults": [{"channel": 2, "kind": "gain_drift", "gain_db": -6.0, "start_s": 1.0}]},
    "sources": [
        {"name": "one", "sites": ["tank/*"], "kind": "void", "conductor_deg": 120.0, "active_s": [0.0, 100.0]},
        {"name": "gun", "position_m": [16.0, 12.0, 2.0], "n_shots": 20, "first_shot_s": 1.0, "pulse_rate_hz": 5.0},
        {"name": "any", "anywhere_at_m": 1.5},
    ],
    "interferers": [{"name": "tram", "position_m": [40.0, 8.0, 5.0], "moves_to_m": [40.0, -8.0, 5.0],
                     "speed_mps": 9.0, "amplitude_v": 4.0, "burst_s": 1e-6}],
    "carriers": [{"name": "gsm", "frequency_hz": 9.48e8, "amplitude_v": 0.02, "bearing_deg": 37.0}],
    "task": {"time_limit_s": 20.0},
}  # fmt: skip
"""A small scenario with something of everything."""

SHIPPED_TABLES = tuple(tomllib.loads((SHIPPED / f"{name}.toml").read_text("utf-8")) for name in shipped_scenarios())

HOSTILE = (
    1e308, -1e308, 5e-324, -5e-324, -0.0, math.nan, math.inf, -math.inf, 1e-300, -1.0, 0.0, 1e9, 10**400, -(10**400),
    2**63, -1, 0, 1, True, "", "a\nb", "\x00", "../../evil", "/etc/passwd", "[bold]x[/nope]", "\u202e\ud7ff",
    "x" * 5000, "none.xml", "tank/*", "all", "planned", [], [[]], [1.0], [1e300, 1e300], ["x"] * 300, {},
    {"a": {"b": [1]}}, {"shape": "cone"}, {"\n": 1}, [{}] * 100, [3],
)  # fmt: skip

FILES = {"model", "pattern", "true_pattern", "locator", "method", "calibration"}
"""Keys that name files or code: drawn from the hostile values alone."""


WHOLE = {"yard", "map", "route", "sources", "name", "equipment", "extra", "sites"}
"""Keys that hardly make sense drawn as a whole: what is in them is drawn."""


def keys_of(schema: dict[str, Any]) -> dict[str, Any]:
    """Schemas of the keys of a table; none if it is no table."""
    found = resolved(schema)
    for option in found.get("anyOf", found.get("oneOf", ())):
        if keys := keys_of(option):
            return keys
    return found.get("properties", {})


def resolved(schema: dict[str, Any]) -> dict[str, Any]:
    reference = schema.get("$ref")
    return SCHEMA["$defs"][reference.rpartition("/")[2]] if reference else schema


def drawn(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Values that a schema allows, its bounds often."""
    schema = resolved(schema)
    options = schema.get("anyOf", schema.get("oneOf"))
    if options is not None:
        return st.one_of([drawn(option) for option in options if option.get("type") != "null"])
    if "const" in schema or "enum" in schema:
        return st.sampled_from(schema.get("enum", [schema.get("const")]))
    kind = schema["type"]
    if kind in ("number", "integer"):
        low, high = schema["minimum"], schema["maximum"]
        if kind == "integer":
            return st.sampled_from([low, high]) | st.integers(low, high)
        inside = st.floats(low, high)
        if low >= 0.0:
            decades = st.floats(math.log(low or 1e-6), math.log(high))
            inside = decades.map(lambda decade: min(max(math.exp(decade), low), high))
        return st.sampled_from([low, high, -0.0 if low <= 0.0 else low]) | inside
    if kind == "boolean":
        return st.booleans()
    if kind == "string":
        return st.from_regex(schema["pattern"], fullmatch=True).map(lambda text: text[: schema["maxLength"]])
    if kind == "array":
        if "prefixItems" in schema:
            return st.tuples(*map(drawn, schema["prefixItems"])).map(list)
        return st.lists(drawn(schema["items"]), max_size=3)
    keys = schema.get("properties", {})
    required = {key: drawn(inner) for key, inner in keys.items() if key in schema.get("required", ())}
    optional = {key: drawn(inner) for key, inner in keys.items() if key not in {*required, *FILES}}
    return st.fixed_dictionaries(required, optional=optional)


def places(table: Value, schema: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, dict[str, Any]]]:
    """Each place of a table that a schema describes: what holds it, its key, and its schema."""
    if isinstance(table, dict):
        for key, inner in keys_of(schema).items():
            if key not in FILES:
                yield table, key, inner
                yield from places(table.get(key), inner)
    elif isinstance(table, list):
        found = resolved(schema)
        for option in found.get("anyOf", [found]):
            inner: dict[str, Any] = resolved(option).get("items", {})
            for item in table if inner else ():
                yield from places(item, with_shape(inner, item))


def with_shape(schema: dict[str, Any], item: Value) -> dict[str, Any]:
    """Of the shapes that a piece of equipment may have, its own."""
    mapping = {"box": "BoxEquipment", "cylinder": "CylinderEquipment"}
    if "oneOf" in schema and isinstance(item, dict):
        return {"$ref": f"#/$defs/{mapping.get(str(item.get('shape')), 'CatalogueEquipment')}"}
    return schema


@st.composite
def sensible(draw: st.DrawFn, tables: st.SearchStrategy[dict[str, Any]] = st.just(SMALL)) -> dict[str, Any]:  # noqa: B008
    """Tables with some of their keys set to what the schema allows there."""
    scenario = deepcopy(draw(tables))
    for _ in range(draw(st.integers(1, 3))):
        table, key, schema = draw(st.sampled_from([p for p in places(scenario, SCHEMA) if p[1] not in WHOLE]))
        table[key] = draw(drawn(schema))
    return scenario


@st.composite
def mutated(draw: st.DrawFn, tables: st.SearchStrategy[dict[str, Any]]) -> dict[str, Any]:
    """Tables in which something is replaced by what is hostile, is removed, or is added."""
    scenario = deepcopy(draw(tables))
    for _ in range(draw(st.integers(1, 3))):
        holder, key = draw(st.sampled_from(list(everywhere(scenario))))
        match draw(st.sampled_from(["replace", "remove", "add"])):
            case "remove":
                del holder[key]
            case "add" if isinstance(holder, dict):
                holder[draw(st.sampled_from(["\n", "x" * 200, "name", "a b", "[box]", "kind"]))] = draw(hostile())
            case _:
                holder[key] = draw(hostile())
        if not scenario:
            break
    return scenario


def hostile() -> st.SearchStrategy[Any]:
    return st.sampled_from(HOSTILE).map(deepcopy)


def everywhere(table: Value) -> Iterator[tuple[Any, Any]]:
    """Each place in tables and arrays: what holds it, and its key."""
    pairs = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, inner in pairs:
        yield table, key
        yield from everywhere(inner)


def as_toml(table: dict[str, Any]) -> str:
    return "\n".join(f"{json.dumps(key)} = {inline(value)}" for key, value in table.items())


def inline(value: Value) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inline(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(inline, value))}]"
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return json.dumps(value)
