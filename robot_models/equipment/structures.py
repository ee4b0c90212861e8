"""Busbars, gantries, transformers, gas-insulated switchgear and walls, with sizes for each voltage level.

Each function builds a piece for a length along its x axis and a voltage level.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pdpatrol.robot_models.equipment.assembly import Assembly, Site
from pdpatrol.robot_models.equipment.poles import POST
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv
from pdpatrol.robot_models.yard.solids import Solid


class Sizes(NamedTuple):
    """Sizes of the structures of one voltage level, metres. All are assumed, and typical of this level.

    Attributes:
        busbar_m: Height of the lower side of busbar tubes, clear of a pantograph below by the phase clearance.
        tube_m: Diameter of the tubes.
        gantry_m: Height of the beam of a gantry.
        leg_m: Width of the legs and beam of a gantry.
        tank_m: Length, width and height of the tank of a power transformer: 40, 200 and 350 MVA.
        reactor_m: The same of a shunt reactor: 30, 50 and 100 Mvar.
        bushing_m: Height of the insulator of a high-voltage bushing, from the turret to the cap.
        bushing_spacing_m: Distance between the high-voltage bushings.
        turret_m: Height of the turret below a bushing.
        conservator_m: Diameter of the conservator.
        gis_m: Width and height of gas-insulated switchgear.
    """

    busbar_m: float
    tube_m: float
    gantry_m: float
    leg_m: float
    tank_m: tuple[float, float, float]
    reactor_m: tuple[float, float, float]
    bushing_m: float
    bushing_spacing_m: float
    turret_m: float
    conservator_m: float
    gis_m: tuple[float, float]


SIZES: dict[Kv, Sizes] = {
    110: Sizes(6.0, 0.1, 8.0, 0.5, (5.4, 2.2, 2.9), (4.2, 2.2, 2.9), 1.4, 1.6, 0.5, 0.8, (1.2, 2.6)),
    220: Sizes(8.4, 0.16, 12.5, 0.8, (8.0, 3.0, 3.8), (7.6, 2.8, 3.7), 2.5, 2.7, 0.8, 1.1, (1.7, 3.2)),
    400: Sizes(11.8, 0.25, 18.0, 1.2, (11.2, 3.4, 4.4), (10.8, 3.2, 4.3), 3.7, 4.9, 1.0, 1.3, (2.6, 3.8)),
}
"""Sizes of every level. Caps of bushings are 5.0, 7.4 and 9.4 m high."""

PHASES = (-1.0, 0.0, 1.0)


def busbar(length_m: float, kv: Kv) -> Assembly:
    """Build a busbar: three tubes along x, on posts near both ends and at most a bay apart.

    The candidate sites are at the feet of the post insulators, and at the clamps of the tubes.
    """
    level, size = VOLTAGES[kv], SIZES[kv]
    foot_m, top_m, width_m = size.busbar_m - level.post_m, size.busbar_m + size.tube_m, 0.3 * size.leg_m + 0.2
    parts: dict[str, Solid] = {}
    sites: dict[str, Site] = {}
    radius_m = POST.radius_m[list(VOLTAGES).index(kv)]
    n_rows = max(2, int(np.ceil((length_m - 1.0) / level.bay_width_m - 1e-6)) + 1)
    for row, x in enumerate(np.linspace(0.5 - 0.5 * length_m, 0.5 * length_m - 0.5, n_rows).tolist(), start=1):
        for phase, share in enumerate(PHASES, start=1):
            y, name = share * level.spacing_m, f"{row}_{phase}"
            parts[f"column_{name}"] = Solid(centre_m=(x, y), footprint_m=(width_m, width_m), top_m=foot_m)
            parts[f"post_{name}"] = Solid(centre_m=(x, y), radius_m=radius_m, bottom_m=foot_m, top_m=size.busbar_m)
            sites[f"post_{name}"] = (x, y + radius_m, foot_m + 0.08 * level.post_m)
            sites[f"clamp_{name}"] = (x, y + 0.5 * size.tube_m, size.busbar_m + 0.5 * size.tube_m)
    insulators = frozenset(name for name in parts if name.startswith("post"))
    tubes = {
        f"tube_{phase}": Solid(top_m, size.busbar_m, (0.0, share * level.spacing_m), (length_m, size.tube_m))
        for phase, share in enumerate(PHASES, start=1)
    }
    return Assembly(parts | tubes, sites, frozenset(tubes), insulators)


def gantry(length_m: float, kv: Kv) -> Assembly:
    """Build a gantry: a lattice beam along x on legs at most a bay apart, from which conductors are strung.

    The candidate sites are at the fittings of the insulator strings on the beam.
    """
    level, size = VOLTAGES[kv], SIZES[kv]
    half_m, depth_m = 0.5 * (length_m - size.leg_m), 0.8 * size.leg_m
    n_spans = max(1, int(np.ceil(2.0 * half_m / level.bay_width_m - 1e-6)))
    legs_m = np.linspace(-half_m, half_m, n_spans + 1).tolist()
    bottom_m = size.gantry_m - depth_m
    parts = {
        f"leg_{number}": Solid(bottom_m, centre_m=(x, 0.0), footprint_m=(size.leg_m, size.leg_m))
        for number, x in enumerate(legs_m, start=1)
    }
    parts["beam"] = Solid(size.gantry_m, bottom_m, footprint_m=(length_m, depth_m))
    middles_m = [0.5 * (left + right) for left, right in pairwise(legs_m)]
    sites: dict[str, Site] = {
        f"string_{span}_{phase}": (x + share * level.spacing_m, 0.5 * depth_m, bottom_m + 0.2 * depth_m)
        for span, x in enumerate(middles_m, start=1)
        for phase, share in enumerate(PHASES, start=1)
    }
    return Assembly(parts, sites)


def power_transformer(length_m: float, kv: Kv) -> Assembly:
    """Build a transformer: tank along x, high-voltage bushings at y > 0, low-voltage bushings at y < 0.

    The candidate sites are at the feet and caps of the high-voltage bushings, at the tap changer and at a flange of the
    tank.
    """
    size, half_m = SIZES[kv], 0.5 * length_m
    _, width_m, height_m = size.tank_m
    tank = _oil_tank(length_m, width_m, height_m, kv)
    parts: dict[str, Solid] = {
        "tap_changer": Solid(0.8 * height_m, 0.6, (half_m + 0.35, 0.0), (0.7, 1.2)),
    }
    for number, share in enumerate(PHASES, start=1):
        centre_m = (0.5 * share * size.bushing_spacing_m, -0.42 * width_m)
        parts[f"lv_bushing_{number}"] = Solid(
            height_m + 0.35 * size.bushing_m, height_m, centre_m, radius_m=0.08 + 0.02 * size.turret_m
        )
    bushings = frozenset(name for name in parts if name.startswith("lv"))
    sites: dict[str, Site] = {"tap_changer": (half_m + 0.7, 0.2, 0.5 * height_m)}
    return tank.joined(Assembly(parts, sites, insulators=bushings))


def shunt_reactor(length_m: float, kv: Kv) -> Assembly:
    """Build a shunt reactor: tank along x with high-voltage bushings, without a low-voltage side.

    The candidate sites are at the feet and caps of the bushings, and at a flange of the tank.
    """
    _, width_m, height_m = SIZES[kv].reactor_m
    return _oil_tank(length_m, width_m, height_m, kv)


def _oil_tank(length_m: float, width_m: float, height_m: float, kv: Kv) -> Assembly:
    """Build a tank with radiators, a conservator at y < 0, and high-voltage bushings at y > 0."""
    size, half_m = SIZES[kv], 0.5 * length_m
    radiator_y_m, conservator_y_m = 0.5 * width_m + 0.6, -0.5 * width_m - 0.4
    above_m = height_m + 0.4
    parts = {
        "tank": Solid(height_m, footprint_m=(length_m, width_m)),
        "radiators_left": Solid(0.9 * height_m, 0.5, (0.0, radiator_y_m), (0.8 * length_m, 1.0)),
        "radiators_right": Solid(0.9 * height_m, 0.5, (0.0, -radiator_y_m), (0.8 * length_m, 1.0)),
        "conservator_legs": Solid(above_m, 0.9 * height_m, (0.0, conservator_y_m), (0.5 * length_m, 0.2)),
        "conservator": Solid(
            above_m + size.conservator_m, above_m, (0.0, conservator_y_m), (0.6 * length_m, size.conservator_m)
        ),
    }
    bushings = _bushings(size.bushing_spacing_m, 0.3 * width_m, height_m, kv)
    flange: Site = (-half_m, 0.2 * width_m, 0.4 * height_m)
    return Assembly(parts, {"tank_end": flange}).joined(bushings)


def _bushings(spacing_m: float, y: float, bottom_m: float, kv: Kv) -> Assembly:
    """Build three high-voltage bushings on turrets along x."""
    size = SIZES[kv]
    radius_m = 0.11 + 0.03 * size.bushing_m
    foot_m = bottom_m + size.turret_m
    top_m = foot_m + size.bushing_m
    parts: dict[str, Solid] = {}
    sites: dict[str, Site] = {}
    for number, share in enumerate(PHASES, start=1):
        x = share * spacing_m
        parts[f"turret_{number}"] = Solid(foot_m, bottom_m, (x, y), radius_m=1.3 * radius_m)
        parts[f"hv_bushing_{number}"] = Solid(top_m, foot_m, (x, y), radius_m=radius_m)
        parts[f"cap_{number}"] = Solid(top_m + 0.25, top_m, (x, y), radius_m=radius_m)
        sites[f"hv_bushing_{number}"] = (x, y + radius_m, foot_m + 0.15 * size.bushing_m)
        sites[f"cap_{number}"] = (x, y + radius_m, top_m + 0.12)
    caps = frozenset(name for name in parts if name.startswith("cap"))
    return Assembly(parts, sites, caps, frozenset(name for name in parts if name.startswith("hv")))


def gis_outdoor(length_m: float, kv: Kv) -> Assembly:
    """Build a bay of gas-insulated switchgear along y, with ducts along x to three bushings in air.

    The candidate sites are at the spacers between gas compartments, whose seals let the waves out, and at the bushings.
    """
    level, size = VOLTAGES[kv], SIZES[kv]
    width_m, height_m = size.gis_m
    duct_m, y = 2.3 + 0.2 * size.turret_m, 0.5 * length_m + 0.4 * width_m
    across_m = 2.0 * level.spacing_m + 0.8 * width_m
    bushings = _bushings(level.spacing_m, y, duct_m + 0.4 * width_m, kv)
    parts = {
        "enclosure": Solid(height_m, 0.3, (0.0, 0.0), (width_m, length_m)),
        "base": Solid(0.3, footprint_m=(width_m, 0.9 * length_m)),
        "cubicle": Solid(2.2, centre_m=(0.0, -0.5 * length_m - 0.4), footprint_m=(width_m, 0.8)),
        "duct": Solid(duct_m + 0.4 * width_m, duct_m, (0.0, y), (across_m, 0.8 * width_m)),
    }
    for number, share in ((1, -1.0), (2, 1.0)):
        centre_m = (share * level.spacing_m, y)
        parts[f"leg_{number}"] = Solid(duct_m, centre_m=centre_m, footprint_m=(0.3, 0.3))
    sites: dict[str, Site] = {
        "spacer_1": (0.5 * width_m, -0.25 * length_m, 1.4),
        "spacer_2": (0.5 * width_m, 0.2 * length_m, 1.4),
        "duct_joint": (0.4 * across_m, y + 0.4 * width_m, duct_m + 0.2 * width_m),
    }
    return Assembly(parts, sites).joined(bushings)


def fire_wall(length_m: float, kv: Kv) -> Assembly:
    """Build a fire wall along x, higher than the conservators of the transformers on both sides (IEC 61936-1)."""
    size = SIZES[kv]
    top_m = size.tank_m[2] + 0.4 + size.conservator_m + 0.3
    return Assembly({"wall": Solid(round(top_m, 2), footprint_m=(length_m, 0.3))}, {})


def building(length_m: float) -> Assembly:
    """Build a single-storey building, 8 m deep, for control, protection and auxiliaries."""
    return Assembly({"walls": Solid(4.0, footprint_m=(length_m, 8.0))}, {})


def cable_trench_cover(length_m: float) -> Assembly:
    """Build the covers of a cable trench, laid on its edges: too high for the robot to climb."""
    return Assembly({"covers": Solid(0.12, footprint_m=(length_m, 0.7))}, {})
