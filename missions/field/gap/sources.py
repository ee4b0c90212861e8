"""Sources of a recording: the sites of the yard, and the findings elsewhere, that explain its pulses best.

A site is compared by a simulation of the whole drive, so that pulses on reflected and diffracted paths count for their
source, and no pulse is left out because the pose at which it was recorded is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dirmusic import Finding
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.pulse_pool import choose_evenly
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.scenario import position_error
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.gap.noise_free import NoiseFreeDrive, World

SITE_STD_M, NEAR_SITE_M, OFF_SITE = 1e-3, 1.0, 4.0
"""Standard deviation of the position of a source at a site: next to metal, levels change within centimetres. And
distances from a site, in metres and in standard deviations of a finding, up to which a source may be at either
(assumed)."""

MISMATCH = 0.3
"""Distance between strengths of unit norm from which on a simulated source does not explain a pulse (assumed): a
bearing that is about 8 degrees off."""

NOISE_STD = 3.0
"""Number of standard deviations of the noise that are added to it."""

LEAST_SHARE, BETTER, AMBIGUOUS = 0.05, 0.3, 0.1
"""Least share of the pulses that agree better with a further source than with the others, and by how much; and
difference up to which a pulse may be of either (assumed)."""

MAX_STEPS, MAX_PULSES = 120, 20_000
"""Largest numbers of poses and pulses by which sources are chosen, evenly spread (assumed)."""

Place = tuple[FloatArray, FloatArray]
"""Position of a source, shape (3,), and its covariance, shape (3, 3)."""


@dataclass(frozen=True, kw_only=True)
class RecordedSource:
    """Source of a recording.

    Attributes:
        name: Its site, or the number of its finding.
        places: Places at which it may be.
    """

    name: str
    places: Sequence[Place]


class SourcePulses(NamedTuple):
    """Pulses of a recording with their sources, n pulses.

    Attributes:
        sources: The sources.
        pulse: Row of each pulse in the recording, shape (n,).
        source: Number of its source, shape (n,).
    """

    sources: tuple[RecordedSource, ...]
    pulse: IntArray
    source: IntArray


def choose_sources(data: FieldData, scenario: Scenario, findings: Sequence[Finding]) -> SourcePulses:
    """Choose the sources that explain the strength ratios of a recording, one after the other.

    Args:
        data: The recording.
        scenario: Yard, array and receiver as they are believed.
        findings: Findings of the recording.

    Returns:
        The sources, and the pulses at some of the poses that are of one of them for certain.
    """
    steps = choose_evenly(np.unique(data.step), MAX_STEPS)
    pulse = choose_evenly(np.flatnonzero(np.isin(data.step, steps)), MAX_PULSES)
    tried = _hypotheses(scenario, findings)
    model_v = _simulate(scenario, np.array([source.places[0][0] for source in tried]), data.pose[steps])
    strengths_v, variance_v2 = data.pulses.strengths_v[pulse], data.pulses.variance_v2[pulse].sum(axis=1)
    step, agreement = np.searchsorted(steps, data.step[pulse]), np.zeros((pulse.size, len(tried)))
    for of_axis in model_v:
        agreement = np.maximum(agreement, agreements(strengths_v, of_axis[step], variance_v2))
    chosen, best = list[int](), np.zeros(pulse.size)
    while len(chosen) < len(tried):
        k = int(np.maximum(agreement, best[:, np.newaxis]).sum(axis=0).argmax())
        if np.count_nonzero(agreement[:, k] > best + BETTER) < LEAST_SHARE * pulse.size:
            break
        chosen.append(k)
        best = np.maximum(best, agreement[:, k])
    second, first = np.sort(np.column_stack([np.zeros((pulse.size, 2)), agreement[:, chosen]]), axis=1)[:, -2:].T
    is_certain = first > second + AMBIGUOUS
    source = agreement[:, chosen].argmax(axis=1) if chosen else np.zeros(pulse.size)
    sources = tuple(tried[k] for k in chosen)
    return SourcePulses(sources, pulse[is_certain], source[is_certain].astype(np.intp))


def agreements(strengths_v: FloatArray, model_v: FloatArray, variance_v2: FloatArray) -> FloatArray:
    """Return how well simulated strength ratios agree with those of pulses, from 0 to 1, shape (n, n_models).

    Args:
        strengths_v: Strengths of the pulses, shape (n, n_elements).
        model_v: Simulated strengths at the pose of each, shape (n, n_models, n_elements); NaN where nothing arrives.
        variance_v2: Sum of the noise variances of the strengths of each pulse, shape (n,).
    """
    level2 = np.square(strengths_v).sum(axis=1)
    unit = strengths_v / np.sqrt(level2)[:, np.newaxis]
    expected = model_v / np.linalg.norm(model_v, axis=2, keepdims=True)
    apart2 = 2.0 - 2.0 * np.einsum("ne,nme->nm", unit, expected)
    limit2 = MISMATCH**2 + NOISE_STD**2 * variance_v2 / level2
    return np.nan_to_num(np.maximum(1.0 - apart2 / limit2[:, np.newaxis], 0.0))


def _simulate(scenario: Scenario, positions_m: FloatArray, pose: FloatArray) -> FloatArray:
    """Return the strengths that sources of three polarisations cause, shape (3, n_steps, n_sources, n_elements)."""
    n_steps, n_sources = len(pose), len(positions_m)
    step, source = (number.ravel() for number in np.indices((n_steps, n_sources)))
    drive = NoiseFreeDrive(scenario=scenario, step=step, source=source)
    strengths = [
        drive.strengths(
            pose,
            World(
                positions_m=positions_m,
                axes=np.tile(axis, (n_sources, 1)),
                pointing_rad=np.zeros(scenario.array.n_channels),
                beam_width=1.0,
                ground=scenario.radio.ground,
            ),
        )
        for axis in np.eye(3)
    ]
    return np.array(strengths).reshape(3, n_steps, n_sources, -1)


def _hypotheses(scenario: Scenario, findings: Sequence[Finding]) -> list[RecordedSource]:
    """Return a source at each site of the yard, and at each confirmed finding outside equipment away from sites.

    A source at a site may also be at a site or such a finding nearby.
    """
    yard, exact_m2, result = scenario.known_yard, SITE_STD_M**2 * np.eye(3), list[RecordedSource]()
    at_sites: dict[str, Place] = {name: (yard.site_position(name), exact_m2) for name in yard.site_names()}
    at_findings: dict[str, Place] = {
        f"finding {finding.id}": (finding.position_m, finding.covariance_m2)
        for finding in findings
        if finding.state == "confirmed" and position_error(yard, finding.position_m) is None
    }
    is_at_site = set[str]()
    for name, site in at_sites.items():
        near = {
            other: place for other, place in (at_sites | at_findings).items() if other != name and is_near(site, place)
        }
        is_at_site |= near.keys()
        result.append(RecordedSource(name=name, places=(site, *near.values())))
    elsewhere = {name: place for name, place in at_findings.items() if name not in is_at_site}
    return result + [RecordedSource(name=name, places=(place,)) for name, place in elsewhere.items()]


def is_near(site: Place, place: Place) -> bool:
    """Return whether ratios or the covariance of a place hardly distinguish it from a site."""
    off_m = place[0] - site[0]
    return bool(np.linalg.norm(off_m) < NEAR_SITE_M or off_m @ np.linalg.solve(place[1], off_m) < OFF_SITE**2)
