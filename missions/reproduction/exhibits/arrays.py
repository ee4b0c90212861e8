"""Figures 5 and 7: errors of the manifold, and the number of elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic import GainManifold, UniformOffsets
from pdpatrol.missions.reproduction import protocol
from pdpatrol.missions.reproduction.exhibit import Campaign, Exhibit, Measured, Row, accuracy_row, directions, published
from pdpatrol.missions.reproduction.methods import GATE_SAMPLES, by_gated_covariance, by_paper, error_deg
from pdpatrol.missions.reproduction.prediction import Prediction
from pdpatrol.missions.reproduction.protocol import GRID_DEG, N_RECORD

FloatArray = NDArray[np.float64]

DRAWS = 10
"""Covariances by their exact law cost little: the paper's method has so many trials for each one of the best."""


def manifold_errors(campaign: Campaign) -> Exhibit:
    """Figure 5: a fresh error U(-D, D) on each element and trial."""
    printed = published()["fig5"]
    known = dict(
        zip(
            printed["uniform_half_width"],
            zip(printed["accuracy_percent"], printed["error_std_deg"], strict=True),
            strict=True,
        )
    )
    rows: list[Row] = []
    for cell, half_width in enumerate((0.025, 0.05, 0.075, 0.1)):
        by_paper_deg, best_deg = _with_offsets(campaign, 5, cell, 6, half_width, printed["snr_db"])
        accuracy, spread = known.get(half_width, (None, None))
        rows.append(accuracy_row(f"D = {half_width}", accuracy, by_paper_deg, best_deg))
        rows.append(
            Row(
                label=f"D = {half_width}, spread",
                paper=spread,
                paper_method=Measured.spread(by_paper_deg),
                best_method=Measured.spread(np.round(best_deg)),
                unrounded=Measured.spread(best_deg),
                predicted=Prediction.of_spread(by_paper_deg),
                unit="deg",
            )
        )
    return Exhibit(
        name="fig5",
        title="Fig. 5: accuracy (%) under errors U(-D, D) of the manifold, 10 dB",
        rows=tuple(rows),
        notes=(
            "best: the mean of the posterior over a uniform error of known width, from a gate that holds the pulse",
            "the paper's text says the standard deviation is about 0 and does not change: it means the mean error",
        ),
    )


def element_counts(campaign: Campaign) -> Exhibit:
    """Figure 7: rings of one to ten elements, with manifold errors."""
    printed = published()["fig7"]
    rows: list[Row] = []
    for cell, (n_elements, paper) in enumerate(zip(printed["n_elements"], printed["accuracy_percent"], strict=True)):
        errors = _with_offsets(campaign, 7, cell, n_elements, printed["uniform_half_width"], printed["snr_db"])
        rows.append(accuracy_row(f"N = {n_elements}", paper, *errors))
    return Exhibit(
        name="fig7",
        title="Fig. 7: accuracy (%) over the number of elements, U(-0.05, 0.05), 10 dB",
        rows=tuple(rows),
        notes=(
            "paper: 2, 4, 6 and 8 elements are worked back from 86.06 and the printed relative increases",
            "one element leaves no noise subspace: the first grid angle wins always, right for 5 of 360 directions",
            "two elements are ambiguous: they hear 53 and 338 degrees alike",
        ),
    )


def _with_offsets(
    campaign: Campaign, exhibit: int, cell: int, n_elements: int, half_width: float, snr_db: float
) -> tuple[FloatArray, FloatArray]:
    """Errors in degrees of the paper's method and of the best, an array of its own for each trial."""
    rng = campaign.rng(exhibit, cell)
    manifold = ring(n_elements)
    grid = gain_of(n_elements, GRID_DEG.astype(np.float64))
    prior = UniformOffsets(half_width=half_width)
    paper: list[FloatArray] = []
    best: list[FloatArray] = []
    for n in campaign.chunks():
        true_deg = directions(DRAWS * n, rng)
        gain = gain_of(n_elements, true_deg).T + rng.uniform(-half_width, half_width, (DRAWS * n, n_elements))
        rho = protocol.energy_to_noise_of(gain, snr_db)
        signal = (gain * np.sqrt(rho)[:, np.newaxis])[..., np.newaxis]
        by_paper_deg = by_paper(protocol.draw_covariances(signal, N_RECORD, rng), grid)
        best_deg = by_paper_deg[:n]
        if manifold is not None:
            gated = protocol.draw_covariances(signal[:n], GATE_SAMPLES, rng)
            best_deg = np.degrees(by_gated_covariance(gated, manifold, prior).azimuth_rad)
        paper.append(error_deg(by_paper_deg, true_deg))
        best.append(error_deg(best_deg, true_deg[:n]))
    return np.concatenate(paper), np.concatenate(best)


def ring(n_elements: int) -> GainManifold | None:
    """A ring of the paper's antennas; None for one alone, which the estimators refuse."""
    return GainManifold.ring(n_elements) if n_elements > 1 else None


def gain_of(n_elements: int, azimuth_deg: FloatArray) -> FloatArray:
    """Gains of a ring, one element alone included, shape (n_elements, *azimuth.shape)."""
    whole = GainManifold.ring(max(n_elements, 2))
    return whole.gain(np.radians(azimuth_deg))[:n_elements]
