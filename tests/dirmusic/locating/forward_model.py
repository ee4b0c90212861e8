"""Strengths of an array in NumPy, written from the formulas alone, and surveys of sources with a drawn nature."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist
from scipy.special import ndtr

from dirmusic import ArrayModel, ElementErrors, ElementSpread, GainManifold, PoseError
from dirmusic.array.pattern import TabulatedPattern
from dirmusic.arrays import FloatArray
from dirmusic.locating.joint_fit import LEVEL_PRIOR_DB, MULTIPATH_APART_M, ErrorLevels, JointEstimate, JointFit
from dirmusic.locating.measurement import LEAST_UNEXPLAINED, MULTIPATH_M, N_HARMONICS, PooledPulses
from dirmusic.locating.pulse_pool import Groups

BOARD_RAD = np.radians(90.0 - 60.0 * np.arange(6))
BOARDS_M = np.column_stack([0.12 * np.cos(BOARD_RAD), 0.12 * np.sin(BOARD_RAD), np.full(6, 0.6)])
LOBE_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
LOBE = TabulatedPattern(LOBE_RAD, 0.08 + 0.9 * np.exp(2.4 * (np.cos(LOBE_RAD) - 1.0)) + 0.02 * np.sin(LOBE_RAD))
"""Smooth beam with a width of 85 degrees, not quite symmetric."""

ARRAY = ArrayModel(
    manifold=GainManifold(LOBE, BOARD_RAD),
    positions_m=BOARDS_M,
    spread=ElementSpread(gain=0.05, pointing_rad=np.radians(2.0)),
)
POSE_ERROR = PoseError(position_m=0.03, heading_rad=np.radians(0.5), correlation_s=1.0)
START = ErrorLevels(unexplained=0.02, pattern=0.02)
GRAVEL, WET_SOIL = 3.5, 24.0
"""Relative permittivities at 1.75 GHz."""

K_PER_M = 2 * np.pi * np.linspace(1.4e9, 2.2e9, 17) / 299_792_458.0


@dataclass(frozen=True, kw_only=True)
class Nature:
    """True properties of one array, in its mount above the ground."""

    widening: float = 0.0
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    errors: ElementErrors = ElementErrors.none(6)  # noqa: RUF009 - immutable
    terms: FloatArray | None = None
    permittivity: float = 1.0
    """Relative permittivity of the ground, which does not reflect if this is 1."""
    gain_of_direction: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    """Gain of every element towards azimuth and elevation, both (n, 6), instead of `LOBE`."""


def sights(pose: FloatArray, place_m: FloatArray, array: ArrayModel) -> FloatArray:
    """Return the vectors from the elements to places (n, 3) in the array frame at poses (n, 3), shape (3, n, 6)."""
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    east, north = (place_m[:, :2] - pose[:, :2]).T
    level = np.array([cos * east + sin * north, cos * north - sin * east, place_m[:, 2]])
    return level[:, :, np.newaxis] - array.positions_m.T[:, np.newaxis]


def gains(vector: FloatArray, array: ArrayModel, nature: Nature) -> FloatArray:
    """Return the gains (n, 6) towards vectors (3, n, 6)."""
    manifold, (ahead, left, up) = array.manifold, vector
    about_x, about_y = nature.tilt_rad
    turned = np.array([ahead + about_y * up, left - about_x * up, up + about_x * left - about_y * ahead])
    x, y, z = turned / np.linalg.norm(turned, axis=0)
    off = np.arctan2(y, x) - manifold.boresights_rad - nature.errors.pointing_rad
    if nature.gain_of_direction is not None:
        return nature.gain_of_direction(off, np.arcsin(z))
    rise, level = manifold.boresight_elevations_rad, np.hypot(x, y)
    axis, side = np.cos(rise) * level * np.cos(off) + np.sin(rise) * z, level * np.sin(off)
    psi = np.arccos(axis)
    share = 0.5 * (1.0 + side / np.sin(psi))
    at = psi - nature.widening * (1.654 * np.sin(psi) - 0.4135 * np.sin(2.0 * psi))
    gain = share * manifold.pattern(at) + (1.0 - share) * manifold.pattern(-at)
    if nature.terms is not None:
        parts = nature.terms.reshape(3, N_HARMONICS, 2)
        harmonic = off[..., np.newaxis] * np.arange(1, N_HARMONICS + 1)
        in_plane = [np.cos(harmonic) @ part[:, 0] + np.sin(harmonic) @ part[:, 1] for part in parts]
        gain = gain + in_plane[0] + z * in_plane[1] + z**2 * in_plane[2]
    return gain


def reflection(vector: FloatArray, below: FloatArray, permittivity: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Fresnel coefficients of the ground, perpendicular and parallel, and the excess path; each (n, 6)."""
    length_m, reflected_m = np.linalg.norm(vector, axis=0), np.linalg.norm(below, axis=0)
    cosine = -below[2] / reflected_m
    root = np.sqrt(permittivity - 1.0 + cosine**2)
    spreading = length_m / reflected_m
    perpendicular = (cosine - root) / (cosine + root)
    parallel = (permittivity * cosine - root) / (permittivity * cosine + root)
    return spreading * perpendicular, spreading * parallel, reflected_m - length_m


def share_in_gate(vector: FloatArray, below: FloatArray) -> FloatArray:
    """Return the share of the energy of the ground wave that arrives before the end of the gate, shape (n, 6)."""
    late_m = np.linalg.norm(below, axis=0) - np.linalg.norm(vector, axis=0).min(axis=-1, keepdims=True)
    return ndtr((0.83 - late_m) / 0.17)


def image_of(place_m: FloatArray) -> FloatArray:
    return place_m * [1.0, 1.0, -1.0]


def ground_effect(
    pose: FloatArray, place_m: FloatArray, array: ArrayModel, permittivity: float
) -> tuple[FloatArray, FloatArray]:
    """Return the share of energy that the ground wave adds within the gate for equal gains, and its coherent amplitude.

    Both have the shape (n, 6).
    """
    vector, below = sights(pose, place_m, array), sights(pose, image_of(place_m), array)
    perpendicular, parallel, excess_m = reflection(vector, below, permittivity)
    power, coherence = 0.5 * (perpendicular**2 + parallel**2), np.exp(-0.5 * (excess_m / 0.3) ** 2)
    power *= share_in_gate(vector, below)
    return power * (1.0 - 0.5 * coherence**2), np.sqrt(power) * coherence


def ground_phase(pose: FloatArray, place_m: FloatArray, array: ArrayModel) -> FloatArray:
    """Return the phase of the ground wave behind the direct one at 0.167 m wavelength, up to a constant; (n, 6)."""
    below, direct = (np.linalg.norm(sights(pose, at_m, array), axis=0) for at_m in (image_of(place_m), place_m))
    return 2.0 * np.pi / 0.167 * (below - direct)


def modelled(
    pose: FloatArray, place_m: FloatArray, array: ArrayModel, nature: Nature, power: FloatArray | None = None
) -> FloatArray:
    """Return the strengths (n, 6) of pulses of amplitude 1 that the model expects; `power` fixes the ground wave."""
    vector, manifold, errors = sights(pose, place_m, array), array.manifold, nature.errors
    direct, image = gains(vector, array, nature), gains(sights(pose, image_of(place_m), array), array, nature)
    power = ground_effect(pose, place_m, array, nature.permittivity)[0] if power is None else power
    energy = power * (image / direct) ** 2
    with_errors = (1.0 + errors.gain) * (manifold.gain_factors * direct + manifold.gain_offsets) + errors.offset
    return np.sqrt(1.0 + energy) / np.linalg.norm(vector, axis=0) * with_errors


def simulated(
    pose: FloatArray, place_m: FloatArray, array: ArrayModel, nature: Nature, polarisation_rad: float
) -> FloatArray:
    """Return the strengths (n, 6) of a linearly polarised pulse and its ground wave in circularly polarised elements.

    The spectrum is flat over the band. The waves interfere with the phase of their excess path.
    """
    vector, below = sights(pose, place_m, array), sights(pose, image_of(place_m), array)
    direct, image = gains(vector, array, nature), gains(below, array, nature)
    perpendicular, parallel, excess_m = reflection(vector, below, nature.permittivity)
    cos, sin = np.cos(polarisation_rad), np.sin(polarisation_rad)
    wave = (perpendicular * cos + 1j * parallel * sin) / (cos + 1j * sin)
    wave *= np.sqrt(share_in_gate(vector, below))
    field = direct + image * wave * np.exp(-1j * np.multiply.outer(K_PER_M, excess_m))
    gain = np.sqrt(np.square(np.abs(field)).mean(axis=0)) * (1.0 + nature.errors.gain)
    return gain / np.linalg.norm(vector, axis=0)


def groups_from(
    pose: FloatArray, azimuth_rad: FloatArray, range_m: float, level_db: ArrayLike, time_s: ArrayLike = 0.0
) -> Groups:
    """Make groups of one pulse at poses (n, 3), from sources 0.9 m high with levels 1 m from them."""
    n, world_rad = azimuth_rad.size, azimuth_rad + pose[:, 2]
    towards = np.column_stack([np.cos(world_rad), np.sin(world_rad)])
    place_m = np.column_stack([pose[:, :2] + range_m * towards, np.full(n, 0.9)])
    strengths = modelled(pose, place_m, ARRAY, Nature(permittivity=GRAVEL))
    norm = np.linalg.norm(strengths, axis=-1)
    return Groups(
        time_s=np.zeros(n) + np.asarray(time_s, dtype=np.float64),
        pose=pose,
        place=np.arange(n),
        strengths=strengths / norm[:, np.newaxis],
        variance=np.full((n, 6), 1e-4),
        is_usable=np.ones((n, 6), dtype=np.bool_),
        level_db=np.asarray(level_db, dtype=np.float64) + 20.0 * np.log10(norm),
        azimuth_rad=azimuth_rad,
        std_rad=np.full(n, np.radians(2.0)),
        n_pulses=np.ones(n),
    )


def unexplained_error(pose: FloatArray, place_m: FloatArray, unexplained: float) -> FloatArray:
    """Return the relative error (n, 1) of the strengths of pulses from a place (3,)."""
    range_m = np.linalg.norm(place_m[:2] - pose[:, :2], axis=-1, keepdims=True)
    return np.hypot(LEAST_UNEXPLAINED, unexplained * range_m / (range_m + MULTIPATH_M))


def drawn_errors(rng: np.random.Generator, yaw_rad: float = 0.0) -> ElementErrors:
    """Draw errors of the elements by the spread of `ARRAY`, with a common yaw of the mount."""
    spread = ARRAY.spread
    return ElementErrors(
        gain=rng.normal(0.0, spread.gain, 6),
        pointing_rad=rng.normal(yaw_rad, spread.pointing_rad, 6),
        offset=np.zeros(6),
    )


def drive_past(rng: np.random.Generator, n: int = 40) -> FloatArray:
    """Draw poses on a drive around a corner near the origin, with headings that change slowly; shape (n, 3)."""
    along_m = np.linspace(-6.0, 6.0, n)
    at_m = np.column_stack([np.minimum(along_m, 0.0) + 2.0, np.maximum(along_m, 0.0) - 3.0])
    return np.column_stack([at_m, rng.uniform(-np.pi, np.pi) + np.linspace(0.0, rng.uniform(2.0, 5.0), n)])


def drawn_place(rng: np.random.Generator) -> FloatArray:
    """Draw the place of a source, shape (3,), by the prior of the height."""
    height_m = 0.0
    while height_m < 0.2:
        height_m = rng.normal(1.5, 1.2)
    return np.array([*rng.uniform(-1.0, 1.0, 2), height_m])


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Pulses of one source, one for each pose, and the truth."""

    place_m: FloatArray
    true_pose: FloatArray
    pulses: PooledPulses
    level_db: FloatArray
    time_s: FloatArray
    nature: Nature

    def fit(
        self, array: ArrayModel = ARRAY, *, start_m: FloatArray | None = None, levels: ErrorLevels = START
    ) -> JointEstimate:
        """Locate the source, from a start next to it."""
        n = self.time_s.size
        source = np.zeros(n, dtype=np.intp)
        fit = JointFit(self.pulses, self.level_db, self.time_s, source, np.ones(n), array, POSE_ERROR)
        start_m = self.place_m + np.array([0.4, -0.3, 0.2]) if start_m is None else start_m
        return fit.solve(start_m[np.newaxis], None, levels, 4)


def survey(
    rng: np.random.Generator,
    nature: Nature,
    *,
    place_m: FloatArray | None = None,
    noise: float = 0.01,
    unexplained: float = 0.02,
    interferes: bool = False,
    array: ArrayModel = ARRAY,
    n: int = 40,
) -> Survey:
    """Draw a survey; `noise` is relative to the norm of a pulse, `unexplained` to each strength of a far source.

    Pulses from near each other share unexplained errors.
    """
    place_m, pose = drawn_place(rng) if place_m is None else place_m, drive_past(rng, n)
    error = np.array([POSE_ERROR.position_m, POSE_ERROR.position_m, POSE_ERROR.heading_rad])
    true_pose, places_m = pose + error * rng.normal(size=pose.shape), np.tile(place_m, (n, 1))
    if interferes:
        strengths = simulated(true_pose, places_m, array, nature, rng.uniform(0.0, np.pi))
    else:
        strengths = modelled(true_pose, places_m, array, nature)
    strengths = strengths / np.linalg.norm(strengths, axis=-1, keepdims=True)
    near = np.exp(-cdist(true_pose[:, :2], true_pose[:, :2]) / MULTIPATH_APART_M) + 1e-9 * np.eye(n)
    own = unexplained_error(true_pose, place_m, unexplained) * (np.linalg.cholesky(near) @ rng.normal(size=(n, 6)))
    strengths = strengths * (1.0 + own) + noise * rng.normal(size=(n, 6))
    norm = np.linalg.norm(strengths, axis=-1, keepdims=True)
    usable = np.ones((n, 6), dtype=np.bool_)
    pulses = PooledPulses(pose, strengths / norm, noise**2 / norm**2 * np.ones((n, 6)), usable, np.ones(n))
    level_db = rng.normal(*LEVEL_PRIOR_DB) - 20.0 * np.log10(np.linalg.norm(places_m - true_pose * [1, 1, 0], axis=-1))
    return Survey(
        place_m=place_m,
        true_pose=true_pose,
        pulses=pulses,
        level_db=level_db,
        time_s=np.arange(0.0, 20.0 * n, 20.0),
        nature=nature,
    )


def distorted(nature: Nature, i: int, step: float) -> Nature:
    """Change one state of the array, in the order of `measurement.predict`."""
    kinds, terms = (nature.errors.gain, nature.errors.pointing_rad, nature.errors.offset), nature.terms
    change = np.zeros(22 + 6 * N_HARMONICS)
    change[i] = step
    gain, pointing_rad, offset = (old + new for old, new in zip(kinds, change[4:22].reshape(3, 6), strict=True))
    return replace(
        nature,
        widening=nature.widening + change[0],
        tilt_rad=(nature.tilt_rad[0] + change[1], nature.tilt_rad[1] + change[2]),
        permittivity=float(np.exp(max(np.log(nature.permittivity) + change[3], 0.0))),
        errors=ElementErrors(gain=gain, pointing_rad=pointing_rad, offset=offset),
        terms=(np.zeros(6 * N_HARMONICS) if terms is None else terms) + change[22:],
    )
