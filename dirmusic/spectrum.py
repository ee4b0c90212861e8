"""Noise subspace and pseudo-spectrum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def noise_subspace(covariance: FloatArray, n_sources: int = 1) -> FloatArray:
    """Eigenvectors of the n_elements - n_sources smallest eigenvalues, as columns.

    Args:
        covariance: Strength covariance, shape (..., n_elements, n_elements), V^2.
        n_sources: Sources assumed present, in [1, n_elements - 1].

    Returns:
        Orthonormal columns, shape (..., n_elements, n_elements - n_sources).

    Raises:
        ValueError: If the covariance is not square or finite, or no noise subspace is left.

    References:
        Dir-MUSIC, eq. (8)-(14).
    """
    n_elements = covariance.shape[-1]
    if covariance.ndim < 2 or covariance.shape[-2] != n_elements:
        raise ValueError(f"`covariance` must have shape (..., n_elements, n_elements), got {covariance.shape}")
    if not np.isfinite(covariance).all():
        raise ValueError("`covariance` must be finite; drop the broken record or channel first")
    if not 1 <= n_sources < n_elements:
        raise ValueError(
            f"`n_sources` must be in [1, {n_elements - 1}] for {n_elements} elements, got {n_sources}: "
            "the noise subspace has n_elements - n_sources dimensions and needs at least one"
        )
    _, vectors = np.linalg.eigh(covariance)  # eigenvalues ascending
    return vectors[..., : n_elements - n_sources]


def pseudo_spectrum(covariance: FloatArray, gain: FloatArray, n_sources: int = 1) -> FloatArray:
    r"""Score every candidate azimuth by how little of its gain lies in the noise subspace.

    MUSIC steers with phase; Dir-MUSIC steers with gain, so it needs neither coherent sampling nor half-wave spacing.

    .. math:: P(\theta) = 1 / \lVert E_n^T g(\theta) \rVert^2

    Args:
        covariance: Strength covariance, shape (..., n_elements, n_elements), V^2.
        gain: Element gains per candidate azimuth, shape (n_elements, n_angles), unitless.
        n_sources: Sources assumed present, in [1, n_elements - 1].

    Returns:
        Pseudo-spectrum, shape (..., n_angles), unitless. It ranks azimuths; its height is no power. Infinite where
        the fit is exact.

    Raises:
        ValueError: If shapes disagree or no noise subspace is left.

    References:
        Dir-MUSIC, eq. (13)-(15), as printed: `gain` is not normalised.
    """
    if gain.ndim != 2 or gain.shape[0] != covariance.shape[-1]:
        raise ValueError(
            f"`gain` must have shape ({covariance.shape[-1]}, n_angles) to match `covariance`, got {gain.shape}. "
            "Rows are antenna elements in the order the strengths were recorded."
        )
    projection = np.swapaxes(noise_subspace(covariance, n_sources), -1, -2) @ gain
    with np.errstate(divide="ignore"):
        return 1.0 / np.square(projection).sum(axis=-2)
