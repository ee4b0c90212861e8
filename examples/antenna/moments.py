"""Method of moments: wires of a helical antenna and of its plate, and the far field they radiate."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import PyNEC
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

ETA_OHM = 376.730313
"""Wave impedance of free space."""
FINE_DEG = 2.5
"""Step of the directions that are computed; tables have every n-th."""


@dataclass(frozen=True, kw_only=True)
class Helix:
    """An axial-mode helix wound right-handed on a square plate, and the ring it may stand in.

    Circumference, pitch and turns are those of the textbook for 1.75 GHz: about one wavelength, 12 to 14 degrees, more
    than three (Kraus, Antennas, 1988, ch. 7). A pin leads from the plate, straight below the axis, to the
    winding; it is fed where it meets the winding.
    """

    turns: int = 4
    circumference_m: float = 0.171
    pitch_deg: float = 13.0
    wire_radius_m: float = 0.75e-3
    """Half of the thickness of winding and pin (assumed)."""
    pin_m: float = 0.012
    """Length of the pin (assumed)."""
    plate_m: float = 0.13
    """Side of the plate (assumed); a grid of wires as thick as conducts like a sheet: circumference = spacing."""
    ring_radius_m: float = 0.12
    """From the middle of the ring to each plate; `ring_radius_m` of pdpatrol's array."""
    load_ohm: float = 140.0
    """What the others in the ring end in (assumed): the input resistance of the textbook, 140 ohm * C / wavelength."""


class Mesh(NamedTuple):
    """How finely wires are cut; `cells` is even, one side of the plate."""

    per_turn: int = 52
    cells: int = 20
    pin: int = 6

    def coarser(self) -> Mesh:
        """Every segment twice as long."""
        return Mesh(self.per_turn // 2, self.cells // 2, self.pin // 2)


class Pattern(NamedTuple):
    """Far field at one frequency, as amplitude gain: root of directivity if nothing ends in loads.

    Attributes:
        right: Right-handed circular part, shape (73, 144): elevation from 90 down, azimuth from 0 up, `FINE_DEG` each.
        left: Left-handed circular part, alike.
        balance: Radiated power and that in the loads, over that fed in; 1 if the solution is exact.
        impedance_ohm: At the feed.
        coupled: Share of the accepted power that ends in the other elements' loads.
        n_segments: Unknowns of the solution.
    """

    right: FloatArray
    left: FloatArray
    balance: float
    impedance_ohm: complex
    coupled: float
    n_segments: int

    @property
    def both(self) -> FloatArray:
        """Both parts: sqrt(2) times what a linear wave makes, as root mean square over its polarisation's direction."""
        return np.hypot(self.right, self.left)


def add_element(geometry: PyNEC.c_geometry, helix: Helix, mesh: Mesh) -> int:
    """Wires of one element whose plate stands at x = ring radius, fed pin first; how many segments that makes."""
    spacing_m, radius_m = helix.plate_m / mesh.cells, helix.circumference_m / (2 * np.pi)
    turn = np.arange(helix.turns * mesh.per_turn + 1) / mesh.per_turn
    angle, advance_m = 2 * np.pi * turn - np.pi / 2, helix.circumference_m * np.tan(np.radians(helix.pitch_deg))
    x_m = helix.ring_radius_m + helix.pin_m + advance_m * turn
    winding_m = np.column_stack([x_m, radius_m * np.cos(angle), radius_m * np.sin(angle)])
    foot_m = np.array([helix.ring_radius_m, 0.0, -spacing_m * round(radius_m / spacing_m)])  # a knot of the grid
    pin_m = foot_m + (winding_m[0] - foot_m) * np.linspace(0.0, 1.0, mesh.pin + 1)[:, None]
    lines = [(pin_m, helix.wire_radius_m), (winding_m, helix.wire_radius_m)]
    along_m = spacing_m * (np.arange(mesh.cells + 1) - mesh.cells / 2)
    for across_m in along_m:
        plate_x, other = np.full_like(along_m, helix.ring_radius_m), np.full_like(along_m, across_m)
        lines += [
            (np.column_stack([plate_x, *way]), spacing_m / (2 * np.pi)) for way in ((along_m, other), (other, along_m))
        ]
    for points_m, thickness_m in lines:
        for start, end in pairwise(points_m):
            geometry.wire(0, 1, *start.tolist(), *end.tolist(), float(thickness_m), 1.0, 1.0)
    return sum(len(points_m) - 1 for points_m, _ in lines)


def solve(helix: Helix, mesh: Mesh, frequency_ghz: float, n_elements: int) -> Pattern:
    """The pattern of one element, alone or the first of a ring.

    In the ring each has a load in series, the fed one too: so it stays symmetric and is solved by sixths. The load of
    the fed one lowers its current and changes no pattern; its power is taken off what is fed in.
    """
    context = PyNEC.nec_context()
    geometry = context.get_geometry()
    n_segments = add_element(geometry, helix, mesh)
    if n_elements > 1:
        geometry.generate_cylindrical_structure(0, n_elements)
    context.geometry_complete(0)
    context.gn_card(-1, 0, 0, 0, 0, 0, 0, 0)
    feeds = mesh.pin + n_segments * np.arange(n_elements)
    load_ohm = helix.load_ohm if n_elements > 1 else 0.0
    for feed in feeds.tolist() if load_ohm else []:
        context.ld_card(4, 0, feed, feed, load_ohm, 0.0, 0.0)
    context.fr_card(0, 1, 1e3 * frequency_ghz, 0.0)
    context.ex_card(0, 0, mesh.pin, 0, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    n_theta, n_phi = round(180 / FINE_DEG) + 1, round(360 / FINE_DEG)
    context.rp_card(0, n_theta, n_phi, 0, 0, 0, 0, 0.0, 0.0, FINE_DEG, FINE_DEG, 0.0, 0.0)
    field = context.get_radiation_pattern(0)
    theta, phi = (np.array(e).reshape(n_phi, n_theta).T for e in (field.get_e_theta(), field.get_e_phi()))
    currents_a = np.array(context.get_structure_currents(0).get_current())[feeds - 1]
    return _pattern(theta, phi, currents_a, load_ohm, n_segments * n_elements)


def _pattern(theta: ComplexArray, phi: ComplexArray, currents_a: ComplexArray, load_ohm: float, n: int) -> Pattern:
    """Gains of the far field (V) for 1 V at the first feed: E_right = (E_theta + j E_phi) / sqrt 2, exp(j omega t)."""
    right, left = np.abs(theta + 1j * phi) / np.sqrt(2.0), np.abs(theta - 1j * phi) / np.sqrt(2.0)
    for part in (right, left):
        part[[0, -1]] = part[[0, -1], :1]  # at a pole, every azimuth is one direction
    ring_sr = np.sin(np.radians(FINE_DEG) * np.arange(len(right))) * np.radians(FINE_DEG) ** 2
    radiated_w = float(ring_sr @ (right**2 + left**2).sum(axis=1)) / (2 * ETA_OHM)
    loads_w = 0.5 * load_ohm * np.abs(currents_a) ** 2
    fed_w = 0.5 * float(currents_a[0].real) - float(loads_w[0])
    accepted_w = radiated_w + float(loads_w[1:].sum())
    scale = np.sqrt(4 * np.pi / (2 * ETA_OHM * accepted_w))
    return Pattern(
        right=scale * right,
        left=scale * left,
        balance=accepted_w / fed_w,
        impedance_ohm=complex(1.0 / currents_a[0] - load_ohm),
        coupled=float(loads_w[1:].sum()) / accepted_w,
        n_segments=n,
    )
