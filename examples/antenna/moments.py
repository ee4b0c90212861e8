"""Solve helical antennas by the method of moments: wires of helix and ground plate, and their far field."""

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
"""Step of the computed directions; tables contain every n-th direction."""


@dataclass(frozen=True, kw_only=True)
class Helix:
    """Right-handed axial-mode helix on a square plate, and the ring of such elements.

    Circumference, pitch and number of turns follow the textbook for 1.75 GHz: about one wavelength, 12 to 14 degrees,
    more than three turns (Kraus, Antennas, 1988, ch. 7). A pin leads from the plate, below the axis, to the winding,
    and is fed where it meets the winding.
    """

    turns: int = 4
    circumference_m: float = 0.171
    pitch_deg: float = 13.0
    wire_radius_m: float = 0.75e-3
    """Radius of winding and pin (assumed)."""
    pin_m: float = 0.012
    """Length of the pin (assumed)."""
    plate_m: float = 0.13
    """Side of the plate (assumed); its wire grid acts like a sheet when the wire circumference equals the spacing."""
    ring_radius_m: float = 0.12
    """Distance from the centre of the ring to each plate; `ring_radius_m` of pdpatrol's array."""
    load_ohm: float = 140.0
    """Load of the other elements (assumed): the textbook's input resistance, 140 ohm * circumference / wavelength."""


class Mesh(NamedTuple):
    """Number of segments per turn, cells per side of the plate (even), and segments of the pin."""

    per_turn: int = 52
    cells: int = 20
    pin: int = 6

    def coarser(self) -> Mesh:
        """Return the mesh with segments twice as long."""
        return Mesh(self.per_turn // 2, self.cells // 2, self.pin // 2)


class Pattern(NamedTuple):
    """Far field at one frequency, as amplitude gain: the root of the directivity if no power is lost in loads.

    Attributes:
        right: Right-handed circular part, shape (73, 144): elevation from 90 down, azimuth from 0 up, `FINE_DEG` each.
        left: Left-handed circular part, same shape.
        balance: Ratio of the power radiated and lost in loads to the power fed in; 1 if the solution is exact.
        impedance_ohm: Impedance at the feed.
        coupled: Fraction of the accepted power that is lost in the loads of the other elements.
        n_segments: Number of unknowns.
    """

    right: FloatArray
    left: FloatArray
    balance: float
    impedance_ohm: complex
    coupled: float
    n_segments: int

    @property
    def both(self) -> FloatArray:
        """Both parts: sqrt(2) times the RMS amplitude of a linear wave over the directions of its polarisation."""
        return np.hypot(self.right, self.left)


def add_element(geometry: PyNEC.c_geometry, helix: Helix, mesh: Mesh) -> int:
    """Add the wires of one element, fed pin first, with its plate at x = ring radius; return the number of segments."""
    spacing_m, radius_m = helix.plate_m / mesh.cells, helix.circumference_m / (2 * np.pi)
    turn = np.arange(helix.turns * mesh.per_turn + 1) / mesh.per_turn
    angle, advance_m = 2 * np.pi * turn - np.pi / 2, helix.circumference_m * np.tan(np.radians(helix.pitch_deg))
    x_m = helix.ring_radius_m + helix.pin_m + advance_m * turn
    winding_m = np.column_stack([x_m, radius_m * np.cos(angle), radius_m * np.sin(angle)])
    foot_m = np.array([helix.ring_radius_m, 0.0, -spacing_m * round(radius_m / spacing_m)])  # a node of the grid
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
    """Compute the pattern of one element, alone or as the first of a ring.

    In the ring every element has a load in series, the fed one included, so that the structure stays symmetric and one
    sixth of it is solved. The load of the fed element lowers its current but does not change the pattern; its power is
    subtracted from the power fed in.
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
    """Convert the far field (V), 1 V at the feed, to gains: E_right = (E_theta + j E_phi) / sqrt 2, exp(j omega t)."""
    right, left = np.abs(theta + 1j * phi) / np.sqrt(2.0), np.abs(theta - 1j * phi) / np.sqrt(2.0)
    for part in (right, left):
        part[[0, -1]] = part[[0, -1], :1]  # at a pole, all azimuths are the same direction
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
