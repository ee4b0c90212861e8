"""Typical phase-resolved patterns of the kinds of discharge, and classification of a pattern.

Simulated discharges deviate from the typical patterns; `pdpatrol.sensing` draws the deviations.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np
import scipy  # its submodules are loaded when they are first used
from numpy.typing import ArrayLike

from dirmusic.angles import difference
from dirmusic.arrays import FloatArray

KindName = Literal["corona", "void", "surface", "floating"]


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Cluster of pulses around one phase of the mains.

    Attributes:
        share: Share of all pulses.
        centre_deg: Mean phase, relative to the sine of the voltage across the defect, in [0, 360).
        width_deg: Standard deviation of the phase.
        level_db: Level of the pulses relative to the typical level of the kind.
        spread_db: Standard deviation of the level.
    """

    share: float
    centre_deg: float
    width_deg: float
    level_db: float = 0.0
    spread_db: float

    @property
    def polarity(self) -> int:
        """Sign of the pulses, which is that of the voltage across the defect."""
        return 1 if self.centre_deg < 180.0 else -1


KINDS: dict[KindName, tuple[Cluster, ...]] = {
    "corona": (Cluster(share=1.0, centre_deg=270, width_deg=14, spread_db=0.7),),
    "void": (
        Cluster(share=0.5, centre_deg=45, width_deg=20, spread_db=3.0),
        Cluster(share=0.5, centre_deg=225, width_deg=20, spread_db=3.0),
    ),
    "surface": (
        Cluster(share=0.4, centre_deg=55, width_deg=28, level_db=4.0, spread_db=4.0),
        Cluster(share=0.6, centre_deg=235, width_deg=28, level_db=-4.0, spread_db=4.0),
    ),
    "floating": (
        Cluster(share=0.5, centre_deg=60, width_deg=7, spread_db=0.7),
        Cluster(share=0.5, centre_deg=240, width_deg=7, spread_db=0.7),
    ),
}
"""Clusters of each kind of discharge.

Corona at a point: one half cycle, around the crest, equal levels. Void: equal clusters in both half cycles, at rising
voltage, spread levels. Surface: wide clusters in both half cycles, with different levels and numbers of pulses.
Floating metal: both half cycles, a few degrees wide, equal levels.

References:
    CIGRE TB 226, "Knowledge rules for partial discharge diagnosis in service", 2003, for the shapes; the numbers are
    assumed.
"""


SHIFTS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Phase shifts to search: it is not known which phase conductor discharges."""

OFFSETS_DB = np.arange(-12.0, 12.5, 1.5)
"""Levels of the kind to search, relative to the median of the pattern."""

STRAY_DENSITY = 0.03 / (2 * np.pi * 40.0)
"""Density of stray pulses from noise and other sources. Assumed: 3 % of all pulses, uniform in phase and over 40 dB of
level."""

LEAST_PULSES = 20
"""Smallest number of pulses that are classified."""

LEAST_EXPLAINED = 0.88
"""Smallest share of pulses that the clusters of a kind must explain; otherwise the kind is unknown. Assumed."""


@dataclass(frozen=True, kw_only=True)
class PhasePattern:
    """Result of a classification.

    Attributes:
        kind: Most likely kind, or "unknown".
        confidence: Probability of `kind` among all kinds and "unknown", in [0, 1].
        shift_rad: Phase by which the pattern leads the pattern of the likeliest kind in `KINDS`, in [0, 2 pi).
    """

    kind: KindName | str
    confidence: float
    shift_rad: float


def classify(phase_rad: ArrayLike, level_db: ArrayLike) -> PhasePattern:
    r"""Classify a phase-resolved pattern of unknown phase shift and level.

    Each kind is a mixture of clusters, normally distributed in phase and level, and a few stray pulses. The alternative
    is a uniform phase and a normally distributed level. The likelihoods at the best shift and level are tempered,
    because no defect matches the typical pattern exactly.

    Args:
        phase_rad: Phase of the mains at each pulse, shape (n,).
        level_db: Level of each pulse corrected for range and gain, dB relative to any reference, shape (n,).

    Returns:
        The classification. The kind is "unknown" if there are fewer than `LEAST_PULSES` pulses, if no kind explains
        enough of them, or if the phase is uniform.

    Raises:
        ValueError: If shapes disagree or a value is not finite.
    """
    phase, level = np.asarray(phase_rad, dtype=np.float64), np.asarray(level_db, dtype=np.float64)
    if phase.ndim != 1 or phase.shape != level.shape:
        raise ValueError(f"`phase_rad` and `level_db` must both have shape (n,), got {phase.shape} and {level.shape}")
    if not (np.isfinite(phase).all() and np.isfinite(level).all()):
        raise ValueError("`phase_rad` and `level_db` must be finite")
    if phase.size < LEAST_PULSES:
        return PhasePattern(kind="unknown", confidence=1.0, shift_rad=0.0)
    if phase.size > 100:  # more pulses do not help: the variation within each kind limits the result, not the noise
        some = np.linspace(0, phase.size - 1, 100).astype(np.intp)
        phase, level = phase[some], level[some]
    level = level - np.median(level)
    spread_db = max(float(level.std()), 0.5)
    of_uniform = -0.5 * np.square((level - level.mean()) / spread_db) - np.log(spread_db * (2 * np.pi) ** 1.5)
    densities: dict[KindName, FloatArray] = {
        kind: _densities(phase, level, clusters) for kind, clusters in KINDS.items()
    }
    fits: dict[KindName, _Fit] = {kind: _best(density) for kind, density in densities.items()}
    evidence = np.array([*(fit.log_likelihood for fit in fits.values()), of_uniform.sum()])
    independent_pulses = 12  # assumed: further pulses are not independent evidence, since every pattern is atypical
    weight = np.exp((evidence - evidence.max()) * min(1.0, independent_pulses / phase.size))
    weight /= weight.sum()
    kind = list(KINDS)[int(weight[:-1].argmax())]
    fit, probability = fits[kind], float(weight[:-1].max())
    explained = float((fit.density / (fit.density + STRAY_DENSITY)).mean())
    gain = _gain_of_a_second_kind(kind, densities, fits) / phase.size
    mixed = scipy.special.expit((gain - 0.17) / 0.04)  # probability of a mixture of two kinds; assumed
    confidence = probability * (1.0 - mixed) * min(1.0, explained / LEAST_EXPLAINED)
    name = kind if mixed < 0.5 and explained >= LEAST_EXPLAINED and probability > weight[-1] else "unknown"
    return PhasePattern(
        kind=name,
        confidence=confidence if name == kind else 1.0 - confidence,
        shift_rad=fit.shift_rad,
    )


class _Fit(NamedTuple):
    """Fit of a kind at its best shift and level, with the density of each pulse, shape (n,), without stray pulses."""

    log_likelihood: float
    shift_rad: float
    density: FloatArray


def _densities(phase: FloatArray, level: FloatArray, clusters: tuple[Cluster, ...]) -> FloatArray:
    """Compute the density of each pulse for every shift and level of a kind, shape (n_shifts, n_offsets, n)."""
    off = difference(phase, SHIFTS_RAD[:, np.newaxis])  # (n_shifts, n)
    above = level - OFFSETS_DB[:, np.newaxis]  # (n_offsets, n)
    density = np.zeros((SHIFTS_RAD.size, OFFSETS_DB.size, phase.size))
    for cluster in clusters:
        # assumed: clusters are widened by the variation between defects of one kind, which determines the confidence
        width, spread = np.radians(np.hypot(1.2 * cluster.width_deg, 7.0)), np.hypot(cluster.spread_db, 1.2)
        in_phase = np.exp(-0.5 * np.square(difference(off, np.radians(cluster.centre_deg)) / width)) / width
        in_level = np.exp(-0.5 * np.square((above - cluster.level_db) / spread)) / spread
        density += cluster.share / (2 * np.pi) * in_phase[:, np.newaxis] * in_level
    return 0.97 * density


def _best(density: FloatArray, other: FloatArray | float = 0.0) -> _Fit:
    """Find the best shift and level of a density, alone or in a mixture with another density."""
    likelihood = np.log(density + other + STRAY_DENSITY).sum(axis=-1)
    shift, offset = np.unravel_index(int(likelihood.argmax()), likelihood.shape)
    return _Fit(float(likelihood[shift, offset]), float(SHIFTS_RAD[shift]), density[shift, offset])


def _gain_of_a_second_kind(kind: KindName, densities: dict[KindName, FloatArray], fits: dict[KindName, _Fit]) -> float:
    """Compute the gain in log likelihood when half of the pulses are of another kind, for the best pair of kinds."""
    best = -np.inf
    for pair in combinations(KINDS, 2):
        one, two = sorted(pair, key=lambda name: -fits[name].log_likelihood)
        held = fits[one]
        for _ in range(2):  # fit the two kinds in turn, twice
            second = _best(0.5 * densities[two], 0.5 * held.density)
            held = _best(0.5 * densities[one], second.density)
            held = held._replace(density=2 * held.density)
        best = max(best, held.log_likelihood)
    return best - fits[kind].log_likelihood
