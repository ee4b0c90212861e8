"""Shapes of the equipment of a compact 110 kV yard, each built for a given length along its x axis.

All dimensions are assumed and are typical of this voltage class.
"""

from pdpatrol.robot_models.equipment.assembly import Assembly, Site
from pdpatrol.robot_models.yard.solids import Solid


def busbar(length_m: float) -> Assembly:
    """Build a busbar: tubes along x, supported near both ends and in the middle."""
    phases_m = (-1.6, 0.0, 1.6)
    parts: dict[str, Solid] = {}
    sites: dict[str, Site] = {}
    for frame, x in enumerate((-0.45 * length_m, 0.0, 0.45 * length_m), start=1):
        for side, y in {"right": -1.6, "left": 1.6}.items():
            parts[f"leg_{frame}_{side}"] = Solid(centre_m=(x, y), radius_m=0.12, top_m=2.6)
        parts[f"beam_{frame}"] = Solid(centre_m=(x, 0.0), footprint_m=(0.2, 3.6), bottom_m=2.6, top_m=2.8)
        for phase, y in enumerate(phases_m, start=1):
            parts[f"post_{frame}_{phase}"] = Solid(centre_m=(x, y), radius_m=0.1, bottom_m=2.8, top_m=4.0)
            sites[f"post_{frame}_{phase}"] = (x, y + 0.1, 3.7)
    for phase, y in enumerate(phases_m, start=1):
        parts[f"tube_{phase}"] = Solid(centre_m=(0.0, y), footprint_m=(length_m, 0.12), bottom_m=4.0, top_m=4.12)
    return Assembly(parts, sites)


def circuit_breaker(length_m: float) -> Assembly:
    """Build a live-tank circuit breaker: three poles along x, with the drive in front of the middle pole (y < 0).

    The candidate sites are at the flanges of the poles and at the drive.
    """
    parts = {
        "frame": Solid(footprint_m=(length_m, 0.4), top_m=1.6),
        "drive": Solid(centre_m=(0.0, -0.45), footprint_m=(0.9, 0.5), bottom_m=0.3, top_m=1.7),
    }
    sites: dict[str, Site] = {}
    for number, x in enumerate((-0.42 * length_m, 0.0, 0.42 * length_m), start=1):
        parts[f"pole_{number}"] = Solid(centre_m=(x, 0.0), radius_m=0.17, bottom_m=1.6, top_m=4.2)
        sites[f"pole_{number}"] = (x, 0.17, 1.8)
    sites["drive"] = (0.2, -0.7, 1.2)
    return Assembly(parts, sites)


def control_building(length_m: float) -> Assembly:
    """Build a single-storey control building with a doorstep."""
    return Assembly(
        parts={
            "walls": Solid(footprint_m=(length_m, 4.0), top_m=3.2),
            "step": Solid(centre_m=(0.0, -2.3), footprint_m=(1.6, 0.6), top_m=0.15),
        },
        sites={},
    )


def current_transformer(length_m: float) -> Assembly:
    """Build a top-core current transformer, with its head on top of the insulator.

    The candidate sites are at the head, at the foot of the insulator and at the terminal box.
    """
    return Assembly(
        parts={
            "column": Solid(footprint_m=(length_m, length_m), top_m=1.6),
            "insulator": Solid(radius_m=0.18, bottom_m=1.6, top_m=3.0),
            "head": Solid(radius_m=0.38, bottom_m=3.0, top_m=3.7),
        },
        sites={"head": (0.0, 0.38, 3.2), "foot": (0.0, -0.18, 1.75), "terminal_box": (0.5 * length_m, 0.0, 1.2)},
    )


def fence(length_m: float) -> Assembly:
    """Build a wire mesh fence inside the yard, as set up around a live bay during work on other bays."""
    return Assembly(parts={"mesh": Solid(footprint_m=(length_m, 0.06), top_m=1.8)}, sites={})


def gis_bay(length_m: float) -> Assembly:
    """Build a bay of outdoor gas-insulated switchgear along x, with the control cubicle at the end with x < 0.

    The candidate sites are at the spacers between gas compartments, whose seals let the waves out, at the cable end and
    at the middle breaker.
    """
    half = 0.5 * length_m
    parts = {
        "enclosure": Solid(footprint_m=(length_m, 1.4), bottom_m=0.3, top_m=2.0),
        "base": Solid(footprint_m=(length_m, 1.2), top_m=0.3),
        "cubicle": Solid(centre_m=(-half - 0.4, 0.0), footprint_m=(0.8, 1.4), top_m=2.3),
    }
    for number, x in enumerate((-0.3 * length_m, 0.0, 0.3 * length_m), start=1):
        parts[f"breaker_{number}"] = Solid(centre_m=(x, 0.0), radius_m=0.42, bottom_m=2.0, top_m=3.1)
    sites = {
        "spacer_1": (-0.15 * length_m, 0.7, 1.2),
        "spacer_2": (0.15 * length_m, 0.7, 1.2),
        "cable_end": (half, 0.2, 0.9),
        "breaker_2": (0.0, -0.42, 2.5),
    }
    return Assembly(parts, sites)


def kerb(length_m: float) -> Assembly:
    """Build the kerb of a path: too high for the robot to climb, and as high as its lidar."""
    return Assembly(parts={"stone": Solid(footprint_m=(length_m, 0.15), top_m=0.16)}, sites={})


def power_transformer(length_m: float) -> Assembly:
    """Build a transformer of about 40 MVA: tank along x, high-voltage side at y > 0, low-voltage side at y < 0.

    The candidate sites are at the high-voltage bushings, at the tap changer and at a flange at the end of the tank.
    """
    half = 0.5 * length_m
    parts = {
        "tank": Solid(footprint_m=(length_m, 2.2), top_m=2.8),
        "radiators_left": Solid(centre_m=(0.0, 1.55), footprint_m=(0.8 * length_m, 0.7), bottom_m=0.5, top_m=2.4),
        "radiators_right": Solid(centre_m=(0.0, -1.55), footprint_m=(0.8 * length_m, 0.7), bottom_m=0.5, top_m=2.4),
        "conservator": Solid(centre_m=(-half + 0.4, 0.0), footprint_m=(0.8, 2.2), bottom_m=3.2, top_m=4.0),
        "conservator_legs": Solid(centre_m=(-half + 0.4, 0.0), footprint_m=(0.2, 1.4), bottom_m=2.8, top_m=3.2),
        "tap_changer": Solid(centre_m=(half + 0.3, 0.0), footprint_m=(0.6, 1.0), bottom_m=0.6, top_m=2.2),
    }
    sites: dict[str, Site] = {}
    for number, x in enumerate((-1.4, 0.0, 1.4), start=1):
        parts[f"hv_bushing_{number}"] = Solid(centre_m=(x, 0.6), radius_m=0.18, bottom_m=2.8, top_m=4.4)
        parts[f"lv_bushing_{number}"] = Solid(centre_m=(x, -0.7), radius_m=0.1, bottom_m=2.8, top_m=3.4)
        sites[f"hv_bushing_{number}"] = (x, 0.78, 3.8)
    sites |= {"tap_changer": (half + 0.6, 0.2, 1.4), "tank_end": (-half, 0.5, 1.2)}
    return Assembly(parts, sites)


def voltage_transformer(length_m: float) -> Assembly:
    """Build a voltage transformer, with its tank below the insulator.

    The candidate sites are at the tank, at the foot of the insulator and at the terminal box.
    """
    return Assembly(
        parts={
            "column": Solid(footprint_m=(length_m, length_m), top_m=1.4),
            "tank": Solid(radius_m=0.36, bottom_m=1.4, top_m=2.1),
            "insulator": Solid(radius_m=0.16, bottom_m=2.1, top_m=3.6),
        },
        sites={"tank": (0.36, 0.0, 1.7), "foot": (0.0, 0.16, 2.25), "terminal_box": (-0.5 * length_m, 0.0, 1.0)},
    )
