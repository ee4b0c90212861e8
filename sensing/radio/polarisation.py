"""Electric field along a ray in compiled functions: radiated, reflected, diffracted and received.

Fields are relative to that of an isotropic, linearly polarised source: the field of a direct ray has length 1. Waves
vary as exp(j (omega t - k r)).
"""

from __future__ import annotations

import cmath
from typing import NamedTuple

from dirmusic.compiled import compiled_inner
from pdpatrol.sensing.radio.geometry import UP, Vector, normal_to
from pdpatrol.sensing.radio.materials import FREQUENCY_GHZ, LOSS_FACTOR, Material

CONDUCTOR_SPM = 1e6
"""Conductivity from which on a material counts as a perfect conductor; Fresnel's coefficients then differ from that by
less than 0.001 up to 80 degrees."""


class Emitter(NamedTuple):
    """Source that radiates.

    Attributes:
        at: Position.
        axis: Direction of its linear polarisation, a unit vector.
    """

    at: Vector
    axis: Vector


class Field(NamedTuple):
    """Complex amplitudes of an electric field along the axes of the world frame."""

    x: complex
    y: complex
    z: complex


class Reflection(NamedTuple):
    """Reflection coefficients of the electric field.

    Attributes:
        perpendicular: Coefficient of the component perpendicular to the plane of incidence.
        parallel: Coefficient of the component in that plane.
    """

    perpendicular: complex
    parallel: complex


@compiled_inner
def component(field: Field, direction: Vector) -> complex:
    """Return the component of a field along a direction."""
    return field.x * direction.x + field.y * direction.y + field.z * direction.z


@compiled_inner
def superpose(first: complex, first_axis: Vector, second: complex, second_axis: Vector) -> Field:
    """Return the field with two components along two axes."""
    return Field(
        first * first_axis.x + second * second_axis.x,
        first * first_axis.y + second * second_axis.y,
        first * first_axis.z + second * second_axis.z,
    )


@compiled_inner
def radiated(axis: Vector, ray: Vector) -> Field:
    """Return the field, of length 1, that a source polarised along an axis radiates along a ray.

    Assumed: radiation is equal in all directions; a dipole would not radiate along its axis.
    """
    transverse = normal_to(ray, normal_to(axis, ray))
    return Field(complex(transverse.x), complex(transverse.y), complex(transverse.z))


@compiled_inner
def received(field: Field, ray: Vector) -> complex:
    """Return the signal of an antenna with right-handed circular polarisation in a field that arrives along a ray.

    For linear polarisation of length 1 its magnitude is 1 in every direction of the field: half of the power, which the
    measured gain of the antenna includes.
    """
    horizontal = normal_to(ray, UP)
    return component(field, horizontal) + 1j * component(field, normal_to(horizontal, ray))


@compiled_inner
def fresnel(cosine: float, permittivity: float, conductivity_spm: float) -> Reflection:
    """Return the reflection coefficients of a smooth half-space: ITU-R P.2040-3, eq. (37).

    Args:
        cosine: Cosine of the angle between ray and normal, in [0, 1].
        permittivity: Real part, relative to vacuum.
        conductivity_spm: Conductivity, S/m.
    """
    inside = permittivity - 1j * LOSS_FACTOR * conductivity_spm / FREQUENCY_GHZ
    root = cmath.sqrt(inside - (1.0 - cosine * cosine))
    return Reflection((cosine - root) / (cosine + root), (inside * cosine - root) / (inside * cosine + root))


@compiled_inner
def face_reflection(cosine: float, material: Material) -> Reflection:
    """Return the reflection coefficients of a face; its roughness scatters a share of the wave."""
    share = material.flat_share
    if material.conductivity_spm >= CONDUCTOR_SPM:
        return Reflection(complex(-share), complex(share))
    smooth = fresnel(cosine, material.permittivity, material.conductivity_spm)
    return Reflection(share * smooth.perpendicular, share * smooth.parallel)


@compiled_inner
def reflected(field: Field, arriving: Vector, leaving: Vector, normal: Vector, reflection: Reflection) -> Field:
    """Return the field behind a mirror.

    Args:
        field: Field that arrives.
        arriving: Unit vector of the arriving ray.
        leaving: Unit vector of the leaving ray.
        normal: Normal of the mirror, towards the rays.
        reflection: Coefficients of the mirror.
    """
    across = normal_to(arriving, normal)
    perpendicular = reflection.perpendicular * component(field, across)
    parallel = reflection.parallel * component(field, normal_to(arriving, across))
    return superpose(perpendicular, across, parallel, normal_to(leaving, across))


@compiled_inner
def diffracted(field: Field, arriving: Vector, leaving: Vector, edge: Vector, soft: complex, hard: complex) -> Field:
    """Return the field behind an edge, before it spreads: Kouyoumjian and Pathak 1974, eq. (23).

    Args:
        field: Field that arrives.
        arriving: Unit vector of the arriving ray.
        leaving: Unit vector of the leaving ray.
        edge: Unit vector along the edge.
        soft: Diffraction coefficient of the field along the edge.
        hard: Diffraction coefficient of the field across the edge.
    """
    across, across_behind = normal_to(arriving, edge), normal_to(edge, leaving)
    along = -soft * component(field, normal_to(across, arriving))
    return superpose(along, normal_to(across_behind, leaving), -hard * component(field, across), across_behind)
