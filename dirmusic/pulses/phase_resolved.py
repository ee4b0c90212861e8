"""Typical phase-resolved patterns of the kinds of discharge, and classification of a pattern.

Simulated discharges deviate from the typical patterns; `pdpatrol.sensing` draws the deviations.
"""

from dataclasses import astuple, dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

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


CORONA_IN_BOTH = (
    Cluster(share=0.6, centre_deg=270, width_deg=14, spread_db=0.7),
    Cluster(share=0.4, centre_deg=90, width_deg=14, level_db=3.0, spread_db=0.7),
)
"""Corona well above its inception voltage: fewer and larger pulses around the positive crest, too. Assumed."""

IN_ONE: dict[KindName, float] = {"corona": 0.6, "void": 0.1, "surface": 0.15, "floating": 0.35}
"""Prior probability that a kind discharges in one half cycle only. Assumed; between half and twice these values the
confidence of a clear pattern changes by less than 0.1."""

PATTERNS = [
    (kind, clusters, np.log(0.9 * probability / len(KINDS)))
    for kind, typical in KINDS.items()
    for clusters, probability in (
        ((replace(typical[0], share=1.0),), IN_ONE[kind]),
        (CORONA_IN_BOTH if kind == "corona" else typical, 1.0 - IN_ONE[kind]),
    )
]
"""Kind, clusters and logarithm of the prior probability of each pattern, in one half cycle and in both. The remaining
10 % are unknown patterns."""

DEVIATION = np.array([[np.radians(9.0)], [0.4], [2.5], [0.5]])
"""Standard deviations between defects of one kind: centre (rad), log width, level (dB) and log spread of a cluster.
Assumed, about twice those of the simulated discharges. They determine the confidence, which must also hold for
patterns with heavy tails and skew."""

PRECISION, IS_COMMON = DEVIATION**-2.0, np.array([[1.0], [0.0], [1.0], [0.0]])
"""Precision of each parameter, and 1 for those with a shift that all clusters share: centre and level."""

SHARE_PULSES = 6.0
"""Number of pulses that the typical shares of clusters are worth (concentration of a Dirichlet prior). Assumed."""

STRAY, STRAY_DENSITY = 0.05, 1.0 / (2 * np.pi * 40.0)
"""Share of stray pulses from noise and other sources, and their density: uniform in phase and over 40 dB. Assumed."""

LEAST_SPREAD_DB = 0.05
"""Smallest standard deviation of levels of pulses at any phase, such as those of an interferer. Assumed; noise makes it
larger."""

KERNELS, OTHER_PENALTY = ((np.radians(9.0), 2.0), (np.radians(6.0), 1.0)), 7.0
"""Widths, in rad and dB, of two kernel densities that stand for any other pattern, such as two kinds together, and the
logarithm by which their free shape is penalised. Assumed: a quarter of such pairs is taken for one kind, and 4 % of
atypical defects for unknown; at 12 it is a third and 2 %."""

LEAST_PULSES, MOST_PULSES = 20, 60
"""Smallest number of pulses that are classified, and number of pulses, evenly chosen, that are used. More pulses are
not independent evidence, because fading and pulses of other sources disturb each pattern differently. Assumed; with
100, one in ten kinds in missions is stated wrongly at more than 90 %."""


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


def classify(phase_rad: FloatArray, level_db: FloatArray) -> PhasePattern:
    r"""Classify a phase-resolved pattern of unknown phase shift and level.

    Each kind is a mixture of clusters, normally distributed in phase and level, and a few stray pulses. It is described
    by the distribution of its parameters over defects, and its evidence is the likelihood integrated over them
    (Laplace's approximation). The alternatives are a uniform phase with a normally distributed level, and any other
    pattern, whose density at each pulse is estimated from the other pulses by kernels.

    Args:
        phase_rad: Phase of the mains at each pulse, shape (n,).
        level_db: Level of each pulse corrected for range and gain, dB relative to any reference, shape (n,).

    Returns:
        The classification. The kind is "unknown" if there are fewer than `LEAST_PULSES` pulses, or if an alternative is
        the most probable.
    """
    if phase_rad.size < LEAST_PULSES:
        return PhasePattern(kind="unknown", confidence=1.0, shift_rad=0.0)
    some = np.linspace(0, phase_rad.size - 1, min(phase_rad.size, MOST_PULSES)).astype(np.intp)
    phase, level = phase_rad[some], level_db[some]
    level = level - np.median(level)
    fits = [_evidence(phase, level, clusters) for _, clusters, _ in PATTERNS]
    unknown = np.logaddexp(_uniform(phase, level), _other(phase, level)) + np.log(0.05)
    evidence = np.array([*(fit + prior for (fit, _), (*_, prior) in zip(fits, PATTERNS, strict=True)), unknown])
    weight = np.exp(evidence - np.logaddexp.reduce(evidence))
    probability = {kind: float(weight[2 * k : 2 * k + 2].sum()) for k, kind in enumerate((*KINDS, "unknown"))}
    kind = max(probability, key=lambda name: probability[name])
    return PhasePattern(
        kind=kind, confidence=probability[kind], shift_rad=fits[int(evidence[:-1].argmax())][1] % (2 * np.pi)
    )


def _uniform(phase: FloatArray, level: FloatArray) -> float:
    """Return the log evidence of a uniform phase and a normally distributed level of unknown mean within 24 dB.

    Mean and spread are of all pulses, or of most pulses with a few stray ones.
    """
    evidence = list[float]()
    deviation_db = 1.4826 * float(np.median(np.abs(level - np.median(level))))  # of a normal distribution
    for mean, spread, stray in ((level.mean(), level.std(), 0.0), (np.median(level), deviation_db, STRAY)):
        spread_db = max(float(spread), LEAST_SPREAD_DB)
        density = np.exp(-0.5 * np.square((level - mean) / spread_db)) / (spread_db * (2 * np.pi) ** 1.5)
        log_density = np.log((1 - stray) * density + stray * STRAY_DENSITY)
        evidence.append(float(log_density.sum() + np.log(spread_db / 24.0 / phase.size)))
    return float(np.logaddexp.reduce(evidence))


def _other(phase: FloatArray, level: FloatArray) -> float:
    """Return the log evidence of any other pattern: kernel density of each pulse from all others."""
    evidence = list[float]()
    for width_rad, spread_db in KERNELS:
        off = np.square(difference(phase, phase[:, np.newaxis]) / width_rad)
        kernel = np.exp(-0.5 * (off + np.square((level - level[:, np.newaxis]) / spread_db)))
        density = (kernel.sum(axis=0) - 1.0) / ((phase.size - 1) * 2 * np.pi * width_rad * spread_db)
        evidence.append(float(np.log((1 - STRAY) * density + STRAY * STRAY_DENSITY).sum()))
    return float(np.logaddexp.reduce(evidence)) - OTHER_PENALTY


def _log_densities(phase: FloatArray, level: FloatArray, parameters: FloatArray, share: FloatArray) -> FloatArray:
    """Compute the log density of each pulse in each cluster, and as a stray pulse, shape (n_clusters + 1, ..., n).

    Args:
        phase: Shape (n,).
        level: Shape (n,).
        parameters: Centre, log width, level and log spread of each cluster, shape (4, n_clusters, ...).
        share: Share of each cluster, shape (n_clusters, ...).
    """
    centre, log_width, middle, log_spread = parameters[..., np.newaxis]
    off = np.square(difference(phase, centre) / np.exp(log_width)) + np.square((level - middle) / np.exp(log_spread))
    scale = np.log((1 - STRAY) * share[..., np.newaxis] / (2 * np.pi)) - log_width - log_spread
    stray = np.full((1, *off.shape[1:]), np.log(STRAY * STRAY_DENSITY))
    return np.concatenate([scale - 0.5 * off, stray])


class _ClusterFit(NamedTuple):
    """Parameters of a pattern, shape (4, n_clusters), and share of each cluster, shape (n_clusters,).

    Attributes:
        parameters: Centre, log width, level and log spread.
        share: Share of the pulses that are not stray.
        weight: Share of the pulses in the information about each parameter; the rest is that of the prior.
        common: Shift and level that all clusters share, shape (4, 1).
    """

    parameters: FloatArray
    share: FloatArray
    weight: FloatArray
    common: FloatArray


def _refit(
    phase: FloatArray,
    level: FloatArray,
    parameters: FloatArray,
    share: FloatArray,
    typical: FloatArray,
    pseudo: FloatArray,
) -> _ClusterFit:
    """Make one step of expectation maximisation, with the prior of the kind.

    Each parameter is the mean of its estimate from the pulses and of its typical value, weighted by Fisher information
    and precision of the prior.
    """
    density = _log_densities(phase, level, parameters, share)
    own = np.exp(density - np.logaddexp.reduce(density))[:-1]
    n = own.sum(axis=-1) + 1e-9
    off = difference(phase, parameters[0][:, np.newaxis])
    step, middle = (own * off).sum(axis=-1) / n, own @ level / n
    squares = np.square(off - step[:, np.newaxis]), np.square(level - middle[:, np.newaxis])
    log_width, log_spread = (0.5 * np.log((own * square).sum(axis=-1) / n + 1e-6) for square in squares)
    estimate = np.array([parameters[0] + step, log_width, middle, log_spread])
    information = n * np.array(
        [np.exp(-2 * parameters[1]), np.full_like(n, 2.0), np.exp(-2 * parameters[3]), np.full_like(n, 2.0)]
    )
    weight = information / (information + PRECISION)
    common = (
        IS_COMMON * np.sum(weight * (estimate - typical), axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    )
    parameters = weight * estimate + (1.0 - weight) * (typical + common)
    return _ClusterFit(parameters, (n + pseudo) / (n + pseudo).sum(), weight, common)


def _evidence(phase: FloatArray, level: FloatArray, clusters: tuple[Cluster, ...]) -> tuple[float, float]:
    """Return the log evidence of a kind, integrated over its defects by Laplace's approximation, and the phase shift.

    The phase shift and level that all clusters share have flat priors, over one period and over 24 dB.
    """
    share, centre_deg, width_deg, level_db, spread_db = np.array([astuple(cluster) for cluster in clusters]).T
    # an uncertain phase reference and uncertain ranges widen all clusters; assumed, by 2 degrees and 1 dB
    log_width, log_spread = np.log(np.radians(np.hypot(width_deg, 2.0))), np.log(np.hypot(spread_db, 1.0))
    typical, pseudo = np.array([np.radians(centre_deg), log_width, level_db, log_spread]), SHARE_PULSES * share
    shifts, levels = np.meshgrid(np.radians(np.arange(0.0, 360.0, 15.0)), np.arange(-12.0, 12.5, 4.0))
    moves = IS_COMMON * np.array([shifts.ravel(), np.zeros(shifts.size), levels.ravel(), np.zeros(shifts.size)])
    starts = typical[..., np.newaxis] + moves[:, np.newaxis]
    density = np.logaddexp.reduce(_log_densities(phase, level, starts, share[:, np.newaxis]))
    fit = _refit(phase, level, starts[..., density.sum(axis=-1).argmax()], share, typical, pseudo)
    for _ in range(14):
        fit = _refit(phase, level, fit.parameters, fit.share, typical, pseudo)
    log_likelihood = np.logaddexp.reduce(_log_densities(phase, level, fit.parameters, fit.share)).sum()
    of_parameters = PRECISION * np.square(fit.parameters - typical - fit.common) - np.log1p(-fit.weight)
    precision = np.sum(PRECISION * fit.weight, axis=1)[[0, 2]]
    of_common = np.log(2 * np.pi / precision / np.square([2 * np.pi, 24.0]))
    evidence = log_likelihood - 0.5 * of_parameters.sum() + 0.5 * of_common.sum()
    return float(evidence), float(fit.common[0, 0])
