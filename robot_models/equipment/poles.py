"""Single-phase and three-phase apparatus: poles of solids on top of one another, with a size for each voltage level.

`APPARATUS` is the table of all sizes. In the frame of a piece, the poles stand along x, and the current flows along y.
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from pdpatrol.robot_models.equipment.assembly import Assembly, Site
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv
from pdpatrol.robot_models.yard.solids import Solid

PerLevel = tuple[float, float, float]
"""One length for each of 110, 220 and 400 kV, metres."""

Role = Literal["earthed", "insulator", "live"]
"""What a solid is: on earth potential, an insulator, or on high voltage."""

NONE: PerLevel = (0.0, 0.0, 0.0)


class Layer(NamedTuple):
    """Solid of a pole, on top of the layer before; a layer of no height is left out.

    Attributes:
        part: Name.
        role: Role in the apparatus.
        height_m: Height.
        width_m: Side length of a square box; 0 for a cylinder.
        radius_m: Radius of a cylinder; 0 for a box.
        along_m: Length along the current, if it differs from the width.
    """

    part: str
    role: Role
    height_m: PerLevel
    width_m: PerLevel = NONE
    radius_m: PerLevel = NONE
    along_m: PerLevel = NONE


class SiteOn(NamedTuple):
    """Place of a discharge site on a layer.

    Attributes:
        part: Name of the layer; that of a post has a letter, as in `insulator_a`.
        share: Height above the bottom of the layer, as a share of its height.
        side: Side on which it lies: 1 towards x > 0, 2 towards y > 0, and -1 and -2 on the opposite sides.
    """

    part: str
    share: float
    side: Literal[1, 2, -1, -2] = 2


class Apparatus(NamedTuple):
    """Shape of an apparatus.

    Attributes:
        title: Description in a few words.
        source: Where the dimensions come from.
        layers: Solids of a pole, or of each of its posts, from the ground up.
        sites: Discharge sites by name.
        n_poles: Number of poles: 1 or 3.
        posts_m: Distance of the outer posts from the middle, along the current; 0 for a single post.
        has_middle_post: True if a third post stands between the outer posts.
        blade: Live bar on top of the posts, along the current; its length is that between the posts.
        drive: True if each pole has a drive box on its column.
    """

    title: str
    source: str
    layers: tuple[Layer, ...]
    sites: Mapping[str, SiteOn]
    n_poles: Literal[1, 3] = 1
    posts_m: PerLevel = NONE
    has_middle_post: bool = False
    blade: Layer | None = None
    drive: bool = False


COLUMN = Layer("column", "earthed", (2.5, 2.5, 2.6), width_m=(0.3, 0.35, 0.4))
"""Steel support. Its height keeps the insulator 2.25 m above ground, and live parts at N + 2.25 m (IEC 61936-1)."""

POST = Layer("insulator", "insulator", (1.22, 2.3, 3.15), radius_m=(0.1, 0.12, 0.15))
"""Post insulator: C4-550, C4-1050 and C4-1425 of IEC 60273."""

TYPICAL = "typical of catalogues, rounded (assumed)"

APPARATUS: dict[str, Apparatus] = {
    "cable_sealing_end": Apparatus(
        "outdoor termination of a cable",
        TYPICAL,
        (
            Layer("column", "earthed", (2.2, 2.2, 2.3), width_m=(0.5, 0.6, 0.7)),
            Layer("entrance", "earthed", (0.3, 0.3, 0.4), radius_m=(0.22, 0.3, 0.38)),
            Layer("insulator", "insulator", (1.5, 2.6, 3.8), radius_m=(0.18, 0.25, 0.32)),
            Layer("cap", "live", (0.2, 0.25, 0.3), radius_m=(0.12, 0.25, 0.45)),
        ),
        {
            "screen": SiteOn("entrance", 0.4),
            "stress_cone": SiteOn("insulator", 0.15),
            "cap": SiteOn("cap", 0.5),
        },
    ),
    "capacitive_voltage_transformer": Apparatus(
        "capacitor divider on an electromagnetic unit",
        TYPICAL,
        (
            Layer("column", "earthed", (1.9, 1.9, 2.0), width_m=(0.3, 0.35, 0.4)),
            Layer("tank", "earthed", (0.6, 0.7, 0.8), width_m=(0.6, 0.7, 0.8)),
            Layer("insulator", "insulator", (1.4, 2.5, 3.7), radius_m=(0.17, 0.2, 0.24)),
            Layer("cap", "live", (0.15, 0.2, 0.25), radius_m=(0.2, 0.25, 0.5)),
        ),
        {
            "tank": SiteOn("tank", 0.5, 1),
            "foot": SiteOn("insulator", 0.06),
            "unit_joint": SiteOn("insulator", 0.5),
            "cap": SiteOn("cap", 0.5),
        },
    ),
    "circuit_breaker": Apparatus(
        "live-tank breaker",
        TYPICAL + "; support insulators as in IEC 60273",
        (
            Layer("column", "earthed", (2.5, 2.5, 2.6), width_m=(0.4, 0.4, 0.5)),
            Layer("insulator", "insulator", (1.22, 2.3, 3.3), radius_m=(0.14, 0.16, 0.2)),
            Layer("flange", "live", (0.2, 0.25, 0.3), radius_m=(0.2, 0.25, 0.3)),
            Layer("chamber", "live", (1.3, 2.1, 0.0), radius_m=(0.16, 0.18, 0.0)),
            Layer("chamber", "live", (0.0, 0.0, 0.5), width_m=(0.0, 0.0, 0.45), along_m=(0.0, 0.0, 4.0)),
        ),
        {"foot": SiteOn("insulator", 0.08), "flange": SiteOn("flange", 0.5, -2), "drive": SiteOn("drive", 0.5, -2)},
        n_poles=3,
        drive=True,
    ),
    "current_transformer": Apparatus(
        "top-core current transformer",
        TYPICAL,
        (
            Layer("column", "earthed", (2.1, 2.1, 2.1), width_m=(0.35, 0.4, 0.45)),
            Layer("box", "earthed", (0.4, 0.4, 0.5), width_m=(0.5, 0.6, 0.7)),
            Layer("insulator", "insulator", (1.3, 2.4, 3.4), radius_m=(0.16, 0.2, 0.25)),
            Layer("head", "live", (0.7, 0.9, 1.1), radius_m=(0.34, 0.42, 0.5)),
        ),
        {
            "terminal_box": SiteOn("box", 0.5, 1),
            "foot": SiteOn("insulator", 0.08),
            "head": SiteOn("head", 0.3),
        },
    ),
    "disconnector_centre_break": Apparatus(
        "two rotating posts per pole, contact in the middle",
        "IEC 60273 for the posts; distance of the posts assumed",
        (COLUMN, POST, Layer("head", "live", (0.15, 0.2, 0.25), radius_m=(0.12, 0.15, 0.18))),
        {
            "foot_a": SiteOn("insulator_a", 0.08, -2),
            "foot_b": SiteOn("insulator_b", 0.08),
            "contact": SiteOn("blade", 0.5, 1),
        },
        n_poles=3,
        posts_m=(0.8, 1.45, 2.3),
        blade=Layer("blade", "live", (0.1, 0.12, 0.15), width_m=(0.1, 0.12, 0.15)),
    ),
    "disconnector_double_break": Apparatus(
        "rotating middle post per pole, a contact at each end",
        "IEC 60273 for the posts; distance of the posts assumed",
        (COLUMN, POST, Layer("head", "live", (0.15, 0.2, 0.25), radius_m=(0.12, 0.15, 0.18))),
        {
            "foot": SiteOn("insulator_b", 0.08, 1),
            "contact_a": SiteOn("head_a", 0.5, -2),
            "contact_b": SiteOn("head_c", 0.5, 2),
        },
        n_poles=3,
        posts_m=(1.2, 2.1, 3.2),
        has_middle_post=True,
        blade=Layer("blade", "live", (0.1, 0.12, 0.15), width_m=(0.1, 0.12, 0.15)),
    ),
    "disconnector_pantograph": Apparatus(
        "one pole below its busbar, drawn open",
        "IEC 60273 for the post; the folded arms are assumed",
        (COLUMN, POST, Layer("arms", "live", (0.7, 1.0, 1.2), width_m=(0.3, 0.4, 0.5))),
        {"foot": SiteOn("insulator", 0.08), "arms": SiteOn("arms", 0.25, 1)},
    ),
    "line_trap": Apparatus(
        "coil of power line carrier on a post",
        TYPICAL + "; post as in IEC 60273",
        (COLUMN, POST, Layer("coil", "live", (1.2, 1.5, 1.8), radius_m=(0.5, 0.65, 0.75))),
        {"foot": SiteOn("insulator", 0.08), "coil_end": SiteOn("coil", 0.08), "terminal": SiteOn("coil", 0.92, -2)},
    ),
    "post_insulator": Apparatus(
        "post insulator on a column",
        "IEC 60273: C4-550, C4-1050, C4-1425",
        (COLUMN, POST, Layer("cap", "live", (0.12, 0.15, 0.2), radius_m=(0.1, 0.12, 0.15))),
        {"foot": SiteOn("insulator", 0.08), "cap": SiteOn("cap", 0.5)},
    ),
    "surge_arrester": Apparatus(
        "metal-oxide arrester; a disc stands for the grading ring",
        TYPICAL,
        (
            Layer("column", "earthed", (2.5, 2.5, 2.6), width_m=(0.3, 0.35, 0.4)),
            Layer("insulator", "insulator", (1.3, 2.4, 3.6), radius_m=(0.12, 0.14, 0.16)),
            Layer("ring", "live", (0.1, 0.12, 0.15), radius_m=(0.15, 0.45, 0.75)),
        ),
        {"foot": SiteOn("insulator", 0.05), "ring": SiteOn("ring", 0.5)},
    ),
    "voltage_transformer": Apparatus(
        "inductive voltage transformer",
        TYPICAL,
        (
            Layer("column", "earthed", (1.9, 1.9, 2.0), width_m=(0.35, 0.4, 0.45)),
            Layer("tank", "earthed", (0.7, 0.9, 1.0), radius_m=(0.34, 0.42, 0.5)),
            Layer("insulator", "insulator", (1.4, 2.5, 3.6), radius_m=(0.16, 0.2, 0.24)),
            Layer("cap", "live", (0.2, 0.25, 0.3), radius_m=(0.2, 0.25, 0.45)),
        ),
        {"tank": SiteOn("tank", 0.5, 1), "foot": SiteOn("insulator", 0.08), "cap": SiteOn("cap", 0.5)},
    ),
}
"""Every apparatus by kind."""

DRIVE_SIZE_M = (0.7, 0.5)
"""Length and depth of a drive box (assumed)."""


def build_apparatus(kind: str, kv: Kv) -> Assembly:
    """Build an apparatus of `APPARATUS` for a voltage level."""
    shape, level = APPARATUS[kind], list(VOLTAGES).index(kv)
    spacing_m = VOLTAGES[kv].spacing_m
    built = Assembly({}, {})
    for number, x in enumerate((-spacing_m, 0.0, spacing_m) if shape.n_poles == 3 else (0.0,), start=1):
        pole = _pole(shape, level, x)
        built = built.joined(pole.renamed(f"_{number}") if shape.n_poles == 3 else pole)
    return built


def _pole(shape: Apparatus, level: int, x: float) -> Assembly:
    """Build one pole with its middle at (x, 0)."""
    off_m, parts, roles = shape.posts_m[level], dict[str, Solid](), dict[str, Role]()
    posts = {"": 0.0}
    if off_m:
        posts = {"_a": -off_m, "_b": 0.0, "_c": off_m} if shape.has_middle_post else {"_a": -off_m, "_b": off_m}
    for letter, y in posts.items():
        bottom_m = 0.0
        for layer in shape.layers:
            if layer.height_m[level]:
                solid = _solid(layer, level, (x, y), bottom_m)
                parts[layer.part + letter], roles[layer.part + letter] = solid, layer.role
                bottom_m = solid.top_m
        if shape.drive:
            centre_m = (x, y - 0.5 * (shape.layers[0].width_m[level] + DRIVE_SIZE_M[1]))
            parts["drive"] = Solid(centre_m=centre_m, footprint_m=DRIVE_SIZE_M, bottom_m=0.7, top_m=1.8)
            roles["drive"] = "earthed"
    if shape.blade is not None:
        blade = shape.blade._replace(along_m=(2.0 * off_m,) * 3)
        head = next(solid for name, solid in parts.items() if name.startswith("head"))
        parts["blade"] = _solid(blade, level, (x, 0.0), head.bottom_m)
        roles["blade"] = "live"
    sites = {name: _on_surface(parts[at.part], at) for name, at in shape.sites.items()}
    named = {role: frozenset(name for name, own in roles.items() if own == role) for role in ("live", "insulator")}
    return Assembly(parts, sites, named["live"], named["insulator"])


def _solid(layer: Layer, level: int, centre_m: tuple[float, float], bottom_m: float) -> Solid:
    """Build the solid of a layer."""
    width_m = layer.width_m[level]
    return Solid(
        top_m=round(bottom_m + layer.height_m[level], 3),
        bottom_m=bottom_m,
        centre_m=centre_m,
        footprint_m=(width_m, layer.along_m[level] or width_m),
        radius_m=layer.radius_m[level],
    )


def _on_surface(solid: Solid, at: SiteOn) -> Site:
    """Return the position of a site on a side of a solid."""
    x, y = solid.centre_m
    sign, axis = (1.0 if at.side > 0 else -1.0), abs(at.side) - 1
    reach_m = sign * (solid.radius_m or 0.5 * solid.footprint_m[axis])
    z = solid.bottom_m + at.share * (solid.top_m - solid.bottom_m)
    return (x + reach_m, y, z) if axis == 0 else (x, y + reach_m, z)
