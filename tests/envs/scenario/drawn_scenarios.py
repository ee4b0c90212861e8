"""Scenarios with random invalid or extreme values, as plain data and as TOML."""

import json
import math
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from datetime import date
from typing import Any

import numpy as np
from hypothesis import strategies as st

from pdpatrol.envs.scenario import SHIPPED, shipped_scenarios

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
    "nature": {
        "array": {"beam_width_scale": 1.05, "mount_yaw_deg": 1.0, "mount_tilt_deg": -2.0},
        "pose_sensor": {"heading_std_deg": 1.0, "frame_offset_m": [0.1, 0.0], "heading_bias_deg": 0.5},
        "receiver": {"faults": [{"channel": 2, "kind": "gain_drift", "gain_db": -6.0, "start_s": 1.0}]},
    },
    "sources": [
        {"name": "one", "sites": ["tank/*"], "kind": "void", "conductor_deg": 120.0, "active_s": [0.0, 100.0]},
        {"name": "gun", "position_m": [16.0, 12.0, 2.0], "n_shots": 20, "first_shot_s": 1.0, "pulse_rate_hz": 5.0},
        {"name": "any", "anywhere_at_m": 1.5, "duty_s": [5.0, 2.0],
         "changes": [{"at_s": 4.0, "amplitude_db": 3.0, "kind": "corona"}, {"at_s": 9.0, "pulse_rate_hz": 0.0}]},
    ],
    "interferers": [{"name": "tram", "position_m": [40.0, 8.0, 5.0], "path_m": [[40.0, -8.0, 5.0], [30.0, -9.0, 5.0]],
                     "speed_mps": 9.0, "amplitude_v": 4.0, "burst_s": 1e-6}],
    "carriers": [{"name": "gsm", "frequency_hz": 9.48e8, "amplitude_v": 0.02, "bearing_deg": 37.0}],
    "task": {"time_limit_s": 20.0},
}  # fmt: skip
"""A small scenario with every kind of table."""

SHIPPED_TABLES = tuple(tomllib.loads((SHIPPED / f"{name}.toml").read_text("utf-8")) for name in shipped_scenarios())

HOSTILE = (
    1e308, -1e308, 5e-324, -5e-324, -0.0, math.nan, math.inf, -math.inf, 1e-300, -1.0, 0.0, 1e9, 10**400, -(10**400),
    2**63, -1, 0, 1, True, "", "a\nb", "\x00", "../../evil", "/etc/passwd", "[bold]x[/nope]", "\u202e\ud7ff",
    "x" * 5000, "none.xml", "tank/*", "all", "planned", [], [[]], [1.0], [1e300, 1e300], ["x"] * 300, {},
    {"a": {"b": [1]}}, {"shape": "cone"}, {"\n": 1}, [{}] * 100, [3],
)  # fmt: skip


@st.composite
def mutated(draw: st.DrawFn, tables: st.SearchStrategy[dict[str, Any]]) -> dict[str, Any]:
    """Draw a scenario with up to three values replaced, removed or added."""
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


def everywhere(table: object) -> Iterator[tuple[Any, Any]]:
    """Yield each table or array with each of its keys."""
    pairs = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, inner in pairs:
        yield table, key
        yield from everywhere(inner)


def as_toml(table: dict[str, Any]) -> str:
    return "\n".join(f"{json.dumps(key)} = {inline(value)}" for key, value in table.items())


def inline(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {inline(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(inline, value))}]"
    if isinstance(value, float | np.floating):
        return repr(float(value))
    if isinstance(value, date):
        return value.isoformat()
    return json.dumps(value)
