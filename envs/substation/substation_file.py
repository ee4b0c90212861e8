"""Scenario file of a drawn substation, as TOML with comments for a reader."""

from collections.abc import Iterator

import numpy as np

from dirmusic.pulses.phase_resolved import KindName
from pdpatrol.envs.substation.substation import Point, Substation
from pdpatrol.robot_models.equipment.voltages import VOLTAGES
from pdpatrol.robot_models.yard.pieces import CatalogueEquipment

PATROL_MPS = 0.4
"""Mean speed from which the time limit is computed (assumed)."""

SOURCE_KINDS: dict[str, KindName] = {
    **dict.fromkeys(("cap", "ring", "arms", "clamp"), "corona"),
    **dict.fromkeys(("contact", "contact_a", "contact_b", "drive", "string", "terminal", "screen"), "floating"),
    **dict.fromkeys(("foot", "foot_a", "foot_b", "post", "unit_joint"), "surface"),
}
"""Kind of a discharge by the name of its site, without numbers; void on all others. Assumed: corona at edges on high
voltage, floating metal at loose contacts, surface discharges on dirty insulators, voids within housings."""

AMPLITUDES_V = (0.1, 0.6)
"""Range of the amplitudes of drawn discharges (assumed), evenly spread in decibels."""

RATES_HZ = (5.0, 40.0)
"""Range of their pulse rates (assumed)."""


def substation_text(substation: Substation, n_sources: int) -> str:
    """Return the scenario file of a substation, with discharges at sites that are drawn from its seed.

    Args:
        substation: The substation.
        n_sources: Number of discharges, at most 64.
    """
    return (
        "\n".join(
            [
                *_head(substation, n_sources),
                *_yard(substation),
                *_route(substation),
                "",
                "[array]",
                *_sources(substation, n_sources),
            ]
        )
        + "\n"
    )


def _head(substation: Substation, n_sources: int) -> Iterator[str]:
    drawn, level = substation.parameters, VOLTAGES[substation.parameters.kv]
    n_pieces = sum(len(bay.pieces) for bay in substation.bays)
    yield f"# {drawn.kv} kV substation, {drawn.scheme.replace('_', ' ')}, {drawn.n_bays} bays, {n_pieces} pieces"
    yield "#"
    options = f"--kv {drawn.kv} --scheme {drawn.scheme} --bays {drawn.n_bays} --seed {drawn.seed}"
    yield f"# Made by: pdpatrol generate {options} --sources {n_sources}"
    yield f"# Clearances: IEC 61936-1 for a lightning impulse of {level.impulse_kv} kV: {level.to_earth_m:g} m phase to"
    yield f"# earth, {level.to_phase_m:g} m phase to phase, live parts {level.live_height_m:g} m above ground and"
    yield f"# {level.to_fence_m:g} m from the fence, oil-filled pieces {level.fire_m:g} m apart or behind a fire wall."
    yield f"# Phases of a bay are {level.spacing_m:g} m apart, bays {level.bay_width_m:g} m wide."
    yield "#"
    yield "# Names: bay, then IEC 81346-2. qa breaker, qb disconnector, bc current transformer, ba voltage transformer,"
    yield "# ra line trap, fa surge arrester, xb cable end, ta transformer, rl reactor, ua gantry, ub post, wb busbar;"
    yield "# _l1 to _l3 are the phases of pieces of one phase."
    yield ""


def _yard(substation: Substation) -> Iterator[str]:
    yield "[yard]"
    yield f"size_m = [{substation.size_m[0]}, {substation.size_m[1]}]"
    yield "equipment = ["
    for bay in substation.bays:
        yield f"  # {bay.title}"
        yield from (f"  {_inline(piece)}," for piece in bay.pieces)
    yield "]"
    yield ""


def _inline(piece: CatalogueEquipment) -> str:
    x, y = piece.position_m
    keys = [f'name = "{piece.name}"', f'kind = "{piece.kind}"']
    keys += [] if piece.kv is None else [f"kv = {piece.kv}"]
    keys.append(f"position_m = [{x}, {y}]")
    keys += [f"yaw_deg = {piece.yaw_deg}"] if piece.yaw_deg else []
    keys += [] if piece.length_m is None else [f"length_m = {piece.length_m}"]
    return "{ " + ", ".join(keys) + " }"


def _route(substation: Substation) -> Iterator[str]:
    yield f"# {substation.route_length_m:.0f} m on the roads, whose middles run from and to:"
    yield from (f"#   {_point(start_m)} - {_point(end_m)}" for start_m, end_m in substation.roads_m)
    yield "[route]"
    yield f"dock_m = {_point(substation.dock_m)}"
    yield "waypoints_m = ["
    yield from (f"  {_point(stop_m)}," for stop_m in substation.waypoints_m)
    yield "]"
    yield ""
    yield "[task]"
    yield f"time_limit_s = {60.0 * np.ceil(substation.route_length_m / PATROL_MPS / 60.0)}"


def _point(place_m: Point) -> str:
    return f"[{place_m[0]}, {place_m[1]}]"


def _sources(substation: Substation, n_sources: int) -> Iterator[str]:
    rng = np.random.default_rng([substation.parameters.seed, 1])
    sites = substation.yard.site_names()
    for number, chosen in enumerate(rng.choice(len(sites), n_sources, replace=False).tolist(), start=1):
        name = sites[chosen]
        kind = SOURCE_KINDS.get(name.partition("/")[2].rstrip("_0123456789"), "void")
        yield ""
        yield "[[sources]]"
        yield f'name = "discharge_{number}"'
        yield f'sites = ["{name}"]'
        yield f'kind = "{kind}"'
        yield f"amplitude_v = {round(float(np.exp(rng.uniform(*np.log(AMPLITUDES_V)))), 3)}"
        yield f"pulse_rate_hz = {round(float(rng.uniform(*RATES_HZ)), 1)}"
