"""Compiled functions for the electric field along a ray: radiated, reflected, diffracted and received.

Fields are relative to the field of an isotropic, linearly polarised source, so that the field of a direct ray has
length 1. Waves vary as exp(j (omega t - k r)).
"""

import cmath
from typing import NamedTuple

from dirmusic.compiled import compiled_inner
from pdpatrol.sensing.radio.geometry import UP, Vector, dot, normal_to
from pdpatrol.sensing.radio.materials import FREQUENCY_GHZ, LOSS_FACTOR, Material

CONDUCTOR_SPM = 1e6
"""Conductivity above which a material counts as a perfect conductor. The Fresnel coefficients then differ from those of
a perfect conductor by less than 0.001 up to an angle of 80 degrees."""


class Field(NamedTuple):
    """Complex amplitudes of an electric field along the axes of the world frame."""

    x: complex
    y: complex
    z: complex


class Reflection(NamedTuple):
    """Reflection coefficients of the electric field.

    Attributes:
        perpendicular: Coefficient of the component perpendicular to the plane of incidence.
        parallel: Coefficient of the component in the plane of incidence.
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
    """Return the signal of a right-hand circularly polarised antenna for a field that arrives along a ray.

    For a linearly polarised field of length 1 its magnitude is 1, whatever the direction of the field. The antenna
    receives only half of the power of such a field; its measured gain already includes this loss.
    """
    horizontal = normal_to(ray, UP)
    return component(field, horizontal) + 1j * component(field, normal_to(horizontal, ray))


@compiled_inner
def face_reflection(cosine: float, material: Material) -> Reflection:
    """Return the reflection coefficients of a face: ITU-R P.2040-3, eq. (37), reduced by the scattered share.

    Args:
        cosine: Cosine of the angle between ray and normal, in [0, 1].
        material: Material of the face.
    """
    share = material.flat_share
    if material.conductivity_spm >= CONDUCTOR_SPM:
        return Reflection(complex(-share), complex(share))
    inside = material.permittivity - 1j * LOSS_FACTOR * material.conductivity_spm / FREQUENCY_GHZ
    root = cmath.sqrt(inside - (1.0 - cosine * cosine))
    perpendicular, parallel = (cosine - root) / (cosine + root), (inside * cosine - root) / (inside * cosine + root)
    return Reflection(share * perpendicular, share * parallel)


@compiled_inner
def reflected(field: Field, arriving: Vector, leaving: Vector, normal: Vector, material: Material) -> Field:
    """Return the field after reflection by a mirror.

    Args:
        field: Incident field.
        arriving: Unit vector of the arriving ray.
        leaving: Unit vector of the leaving ray.
        normal: Normal of the mirror, on the side of the rays.
        material: Material of the mirror.
    """
    across, reflection = normal_to(arriving, normal), face_reflection(abs(dot(arriving, normal)), material)
    perpendicular = reflection.perpendicular * component(field, across)
    parallel = reflection.parallel * component(field, normal_to(arriving, across))
    return superpose(perpendicular, across, parallel, normal_to(leaving, across))


@compiled_inner
def diffracted(field: Field, arriving: Vector, leaving: Vector, edge: Vector, soft: complex, hard: complex) -> Field:
    """Return the field after diffraction by an edge, without spreading: Kouyoumjian and Pathak 1974, eq. (23).

    Args:
        field: Incident field.
        arriving: Unit vector of the arriving ray.
        leaving: Unit vector of the leaving ray.
        edge: Unit vector along the edge.
        soft: Diffraction coefficient of the field along the edge.
        hard: Diffraction coefficient of the field across the edge.
    """
    across, across_behind = normal_to(arriving, edge), normal_to(edge, leaving)
    along = -soft * component(field, normal_to(across, arriving))
    return superpose(along, normal_to(across_behind, leaving), -hard * component(field, across), across_behind)
