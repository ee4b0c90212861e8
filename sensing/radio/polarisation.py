"""The electric field along a ray, in compiled functions: as it is radiated, mirrored, bent, and received.

Fields are relative to what an isotropic source of linear polarisation radiates: a direct ray has length 1. Waves go as
exp(j (omega t - k r)).
"""

from __future__ import annotations

import cmath
from typing import NamedTuple

from dirmusic.compiled import compiled
from pdpatrol.sensing.radio.diffraction.fresnel import Mirror, WedgeCoefficients
from pdpatrol.sensing.radio.materials import FREQUENCY_GHZ, LOSS_FACTOR, Substance
from pdpatrol.sensing.radio.vectors import Vector, across

CONDUCTS_SPM = 1e6
"""Conductivity from which on a material mirrors all, as Fresnel's coefficients do within 0.001 up to 80 deg."""


class Emitter(NamedTuple):
    """A source that radiates.

    Attributes:
        at: Its place.
        axis: Its linear polarisation, a unit vector.
    """

    at: Vector
    axis: Vector


class Field(NamedTuple):
    """Complex amplitudes of an electric field along the axes of the world frame."""

    x: complex
    y: complex
    z: complex


@compiled
def along(field: Field, direction: Vector) -> complex:
    """Component of a field along a direction."""
    return field.x * direction.x + field.y * direction.y + field.z * direction.z


@compiled
def radiated(axis: Vector, ray: Vector) -> Field:
    """Field of length 1 that a source polarised along an axis sends along a ray.

    Along the axis itself a dipole would send nothing; here what is sent in all directions is alike, by assumption.
    """
    sideways = across(axis, ray)  # at right angles to both
    lengthways = across(ray, sideways)
    return Field(complex(lengthways.x), complex(lengthways.y), complex(lengthways.z))


@compiled
def received(field: Field, ray: Vector) -> complex:
    """What an antenna of right-handed circular polarisation makes of a field that comes along a ray.

    Of linear polarisation of length 1 it has the magnitude 1, whatever the direction of the field: half its power,
    which the measured gain of the antenna has in it.
    """
    level = across(ray, Vector(0.0, 0.0, 1.0))
    upright = across(level, ray)
    return along(field, level) + 1j * along(field, upright)


@compiled
def fresnel(cosine: float, permittivity: float, conductivity_spm: float) -> Mirror:
    """Reflection coefficients of a smooth half-space (ITU-R P.2040-3, eq. (37)).

    Args:
        cosine: Of the angle between ray and normal, in [0, 1].
        permittivity: Real part, relative to vacuum.
        conductivity_spm: Conductivity, S/m.
    """
    inside = permittivity - 1j * LOSS_FACTOR * conductivity_spm / FREQUENCY_GHZ
    root = cmath.sqrt(inside - (1.0 - cosine * cosine))
    return Mirror((cosine - root) / (cosine + root), (inside * cosine - root) / (inside * cosine + root))


@compiled
def face_mirror(cosine: float, of: Substance) -> Mirror:
    """Reflection coefficients of a face that is made of a substance; of a ray at an angle as above."""
    if of.conductivity_spm >= CONDUCTS_SPM:
        return Mirror(complex(-of.flat_share), complex(of.flat_share))
    smooth = fresnel(cosine, of.permittivity, of.conductivity_spm)
    return Mirror(of.flat_share * smooth.across, of.flat_share * smooth.within)


@compiled
def mirrored(field: Field, ray: Vector, leaving: Vector, normal: Vector, mirror: Mirror) -> Field:
    """Field behind a mirror.

    Args:
        field: That arrives.
        ray: Along which it arrives.
        leaving: Along which it leaves.
        normal: Of the mirror, towards the side where both are.
        mirror: Its coefficients.
    """
    sideways = across(ray, normal)
    before, behind = across(ray, sideways), across(leaving, sideways)
    s, p = mirror.across * along(field, sideways), mirror.within * along(field, before)
    return Field(
        s * sideways.x + p * behind.x,
        s * sideways.y + p * behind.y,
        s * sideways.z + p * behind.z,
    )


@compiled
def bent(field: Field, ray: Vector, leaving: Vector, edge: Vector, wedge: WedgeCoefficients) -> Field:
    """Field behind an edge, before it spreads; arguments as of `mirrored`, with the direction of the edge.

    References:
        Kouyoumjian and Pathak 1974, eq. (23), in coordinates fixed to the edge.
    """
    sideways, leaves_sideways = across(ray, edge), across(edge, leaving)
    before, behind = across(sideways, ray), across(leaves_sideways, leaving)
    soft, hard = -wedge.soft * along(field, before), -wedge.hard * along(field, sideways)
    return Field(
        soft * behind.x + hard * leaves_sideways.x,
        soft * behind.y + hard * leaves_sideways.y,
        soft * behind.z + hard * leaves_sideways.z,
    )
