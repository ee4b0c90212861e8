"""Noise subspace, pseudo-spectrum and its peaks, and estimation of the number of sources."""

import numpy as np

from dirmusic.angles import wrap
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.compiled import compiled
from dirmusic.pulses.strengths import dot


def noise_subspace(covariance: FloatArray, n_sources: int = 1) -> FloatArray:
    """Return the eigenvectors of the n_elements - n_sources smallest eigenvalues, as columns.

    Args:
        covariance: Strength covariance, shape (..., n_elements, n_elements), V^2.
        n_sources: Sources assumed present, in [1, n_elements - 1].

    Returns:
        Orthonormal columns, shape (..., n_elements, n_elements - n_sources).

    Raises:
        ValueError: If the covariance is not square or finite, or the noise subspace is empty.

    References:
        Dir-MUSIC, eq. (8)-(14).
    """
    n_elements = check_covariance(covariance)
    if not 1 <= n_sources < n_elements:
        raise ValueError(
            f"`n_sources` must be in [1, {n_elements - 1}] for {n_elements} elements, got {n_sources}: "
            "the noise subspace has n_elements - n_sources dimensions and needs at least one"
        )
    _, vectors = np.linalg.eigh(covariance)  # eigenvalues ascending
    return vectors[..., : n_elements - n_sources]


def pseudo_spectrum(covariance: FloatArray, gain: FloatArray, n_sources: int = 1) -> FloatArray:
    r"""Compute the pseudo-spectrum, which is large where the gain is nearly orthogonal to the noise subspace.

    MUSIC uses phases; Dir-MUSIC uses gains, and needs neither coherent sampling nor half-wavelength spacing.

    .. math:: P(\theta) = 1 / \lVert E_n^T g(\theta) \rVert^2

    Args:
        covariance: Strength covariance, shape (..., n_elements, n_elements), V^2.
        gain: Gains of the elements towards each candidate azimuth, shape (n_elements, n_angles), unitless.
        n_sources: Sources assumed present, in [1, n_elements - 1].

    Returns:
        Pseudo-spectrum, shape (..., n_angles), unitless; infinite where the fit is exact. It ranks azimuths, but its
        height is not a power.

    Raises:
        ValueError: If shapes disagree or the noise subspace is empty.

    References:
        Dir-MUSIC, eq. (13)-(15), as printed, that is, without normalising `gain`.
    """
    if gain.ndim != 2 or gain.shape[0] != covariance.shape[-1]:
        raise ValueError(
            f"`gain` must have shape ({covariance.shape[-1]}, n_angles) to match `covariance`, got {gain.shape}. "
            "Rows are antenna elements in the order the strengths were recorded."
        )
    projection = np.swapaxes(noise_subspace(covariance, n_sources), -1, -2) @ gain
    with np.errstate(divide="ignore"):
        return 1.0 / np.square(projection).sum(axis=-2)


@compiled
def pulse_spectrum(strengths: FloatArray, unit_gain: FloatArray) -> FloatArray:
    r"""Compute the pseudo-spectrum of single pulses in closed form.

    .. math:: P(\theta) = 1 / (1 - (g(\theta)^T a)^2 / \lVert a \rVert^2), \quad \lVert g(\theta) \rVert = 1

    Args:
        strengths: Strengths, shape (n_pulses, n_elements).
        unit_gain: Gains towards each candidate azimuth scaled to unit norm, shape (n_pulses, n_elements, n_angles).

    Returns:
        Pseudo-spectra, shape (n_pulses, n_angles), in [1, 1e12]; zeros for a pulse without strength.

    References:
        Dir-MUSIC, eq. (15), for a gain of unit norm.
    """
    n_pulses, n, n_angles = unit_gain.shape
    spectrum = np.zeros((n_pulses, n_angles))
    for k in range(n_pulses):
        energy = dot(strengths[k], strengths[k])
        if energy == 0.0:
            continue
        for e in range(n):
            for j in range(n_angles):
                spectrum[k, j] += strengths[k, e] * unit_gain[k, e, j]
        for j in range(n_angles):
            spectrum[k, j] = 1.0 / max(1.0 - spectrum[k, j] * spectrum[k, j] / energy, 1e-12)
    return spectrum


def spectrum_peaks(spectrum: FloatArray, azimuths_rad: FloatArray, n_sources: int) -> FloatArray:
    """Find the azimuths of the highest peaks of a pseudo-spectrum, refined by fitting a parabola to its inverse.

    Two pulses that overlap in time are resolved if they are at least about 10, 15 or 30 degrees apart at 20, 10 or 0 dB
    SNR. This limit does not apply to pulses at different times: gate each one and estimate its bearing.

    Args:
        spectrum: Result of `pseudo_spectrum` for the same number of sources, shape (..., n_angles).
        azimuths_rad: Azimuths, evenly spaced over one turn, shape (n_angles,).
        n_sources: Number of peaks, >= 1.

    Returns:
        Azimuths, shape (..., n_sources), highest peak first; NaN where there are fewer peaks.

    Raises:
        ValueError: If the azimuths are not evenly spaced over one turn, or do not match the spectrum.
    """
    n_angles = azimuths_rad.size
    step_rad = 2 * np.pi / n_angles
    if azimuths_rad.shape != spectrum.shape[-1:] or not np.allclose(np.diff(azimuths_rad), step_rad, atol=1e-9):
        raise ValueError(
            f"`azimuths_rad` must be {spectrum.shape[-1]} even steps over one turn to match `spectrum`, got "
            f"shape {azimuths_rad.shape} from {azimuths_rad[:1]} to {azimuths_rad[-1:]}"
        )
    null = 1.0 / spectrum
    before, after = np.roll(null, 1, axis=-1), np.roll(null, -1, axis=-1)
    is_peak = (null < before) & (null <= after)
    depth = np.where(is_peak, null, np.inf)
    chosen = np.argsort(depth, axis=-1)[..., :n_sources]
    at, left, right = (np.take_along_axis(x, chosen, axis=-1) for x in (null, before, after))
    curvature = left + right - 2 * at
    shift = 0.5 * (left - right) / np.where(curvature > 0, curvature, np.inf)
    peaks = wrap(azimuths_rad[chosen] + shift * step_rad)
    return np.where(np.take_along_axis(is_peak, chosen, axis=-1), peaks, np.nan)


def source_count(covariance: FloatArray, n_snapshots: int) -> IntArray:
    r"""Estimate the number of sources in a record by minimum description length.

    .. math:: \hat k = \arg\min_k \; \frac{n (N - k)}{2} \ln \frac{\bar\lambda_k}{\tilde\lambda_k}
              + \frac{k (2 N - k + 1)}{4} \ln n

    with the arithmetic and the geometric mean of the N - k smallest eigenvalues. Akaike's criterion, which has 2 in
    place of :math:`\ln n`, finds one source too many in about one of six records.

    Args:
        covariance: Result of `sample_covariance` in white noise of equal variance in all channels, shape (..., N, N).
        n_snapshots: Number of samples from which it was computed, >= N.

    Returns:
        Number of sources, shape (...), in [0, N - 1].

    Raises:
        ValueError: If the covariance is not square or finite, or there are too few snapshots.

    References:
        Wax and Kailath, "Detection of signals by information theoretic criteria", 1985, with the number of free
        parameters of a real covariance.
    """
    n_elements = check_covariance(covariance)
    if n_snapshots < n_elements:
        raise ValueError(f"`n_snapshots` must be at least the {n_elements} elements, got {n_snapshots}")
    eigenvalues = np.linalg.eigvalsh(covariance)  # ascending
    eigenvalues = np.maximum(eigenvalues, 1e-15 * eigenvalues[..., -1:] + np.finfo(np.float64).tiny)
    counts = np.arange(n_elements)
    arithmetic = np.cumsum(eigenvalues, axis=-1) / (counts + 1)
    geometric = np.cumsum(np.log(eigenvalues), axis=-1) / (counts + 1)
    misfit = 0.5 * n_snapshots * (counts + 1) * (np.log(arithmetic) - geometric)  # of the counts + 1 smallest
    n_sources = n_elements - 1 - counts
    penalty = 0.25 * n_sources * (2 * n_elements - n_sources + 1) * np.log(n_snapshots)
    return n_elements - 1 - np.argmin(misfit + penalty, axis=-1)


def check_covariance(covariance: FloatArray) -> int:
    """Check that a covariance is square and finite, and return its number of elements."""
    n_elements = covariance.shape[-1]
    if covariance.ndim < 2 or covariance.shape[-2] != n_elements:
        raise ValueError(f"`covariance` must have shape (..., n_elements, n_elements), got {covariance.shape}")
    if not np.isfinite(covariance).all():
        raise ValueError("`covariance` must be finite; drop the broken record or channel first")
    return n_elements
