"""The two sides of every comparison: the paper's method to the letter, and the best that `dirmusic` has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic import (
    Bearings,
    GainManifold,
    bearings_from_covariance,
    cut_windows,
    pulse_start,
    sample_covariance,
)
from dirmusic.angles import difference
from dirmusic.array.element_errors import ManifoldPrior
from pdpatrol.missions.reproduction.protocol import GRID_DEG, ComplexArray

FloatArray = NDArray[np.float64]

GATE_SAMPLES = 60
"""3 ns: a pulse of 1 ns decay has 99.7 % of its energy in them."""

FOUND_GATE_SAMPLES = 80
"""A gate that is found from noisy data is a little longer: it starts some samples early or late."""

SUCCESS_DEG = 2
"""Success is an error of at most this, on the grid. The paper writes "less than"; its numbers say "at most"."""


def by_paper(covariance: FloatArray, gain: FloatArray) -> FloatArray:
    r"""Eq. (15) as printed, searched on the 1 degree grid; degrees, shape (n_trials,).

    With one source, what a gain has in the noise subspace is what it has not along the eigenvector of the signal:
    :math:`\lVert E_n^T g \rVert^2 = \lVert g \rVert^2 - (e_s^T g)^2`, several times faster than `pseudo_spectrum`.

    Args:
        covariance: Shape (n_trials, n_elements, n_elements).
        gain: The clean manifold on the grid, shape (n_elements, 360). With one element no noise subspace is left, the
            spectrum is constant, and the first grid angle wins.
    """
    if gain.shape[0] == 1:
        return np.full(covariance.shape[0], GRID_DEG[0], dtype=np.float64)
    _, vectors = np.linalg.eigh(covariance)
    null = np.square(gain).sum(axis=0) - np.square(vectors[..., -1] @ gain)
    return GRID_DEG[null.argmin(axis=-1)].astype(np.float64)


def by_phase(covariance: ComplexArray, steering: ComplexArray) -> FloatArray:
    """MUSIC on the phase manifold `steering` (360, n_elements), searched on the grid; degrees, shape (n_trials,)."""
    _, vectors = np.linalg.eigh(covariance)
    projection = steering.conj() @ vectors[..., :-1]
    return GRID_DEG[np.square(np.abs(projection)).sum(axis=-1).argmin(axis=-1)].astype(np.float64)


def by_gate(records: NDArray[np.float32], manifold: GainManifold) -> FloatArray:
    """Gate found from the data, then maximum likelihood off the grid; degrees, shape (n_trials,)."""
    gate = cut_windows(records, pulse_start(records, FOUND_GATE_SAMPLES), FOUND_GATE_SAMPLES)
    return np.degrees(bearings_from_covariance(sample_covariance(gate), manifold).azimuth_rad)


def by_gated_covariance(covariance: FloatArray, manifold: GainManifold, prior: ManifoldPrior | None = None) -> Bearings:
    """Maximum likelihood, or Bayes over the manifold, from covariances of gates in unit noise."""
    return bearings_from_covariance(covariance, manifold, n_snapshots=GATE_SAMPLES, noise_variance=1.0, prior=prior)


def error_deg(estimate_deg: FloatArray, true_deg: FloatArray) -> FloatArray:
    """Error the shorter way round, degrees."""
    return np.degrees(difference(np.radians(estimate_deg), np.radians(true_deg)))


def is_success(errors_deg: FloatArray) -> NDArray[np.bool_]:
    """The paper's scoring of integer truths: errors of estimates rounded to the grid, at most 2 degrees."""
    return np.abs(np.round(errors_deg)) <= SUCCESS_DEG
