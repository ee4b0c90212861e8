"""Tables 1 and 2 and figure 4: accuracy over the signal-to-noise ratio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dirmusic import GainManifold
from pdpatrol.missions.reproduction import protocol
from pdpatrol.missions.reproduction.exhibit import Campaign, Exhibit, Measured, Row, accuracy_row, directions, published
from pdpatrol.missions.reproduction.methods import FOUND_GATE_SAMPLES, by_gate, by_paper, error_deg
from pdpatrol.missions.reproduction.prediction import Prediction
from pdpatrol.missions.reproduction.protocol import GRID_DEG, N_RECORD

FloatArray = NDArray[np.float64]

NOISE_DRAWS = 40
"""Covariances by their exact law cost little: the paper's method has so many trials for each one of the best."""


def noise_tables(campaign: Campaign) -> tuple[Exhibit, Exhibit, Exhibit]:
    """Table 1 (six elements), figure 4 (its errors at -10 dB) and table 2 (four of the six)."""
    tables = (published()["table1"], published()["table2"])
    six = GainManifold.ring(6)
    manifolds = (six, six.take(range(4)))
    grids = tuple(manifold.gain(np.radians(GRID_DEG)) for manifold in manifolds)
    rows: tuple[list[Row], list[Row]] = ([], [])
    last: dict[str, FloatArray] = {}
    for cell, snr_db in enumerate(tables[0]["snr_db"]):
        rng = campaign.rng(1, cell)
        truths: dict[str, list[FloatArray]] = {"paper": [], "best": []}
        errors: dict[tuple[int, str], list[FloatArray]] = {(k, m): [] for k in (0, 1) for m in truths}
        for n in campaign.chunks():
            true_deg = directions(NOISE_DRAWS * n, rng)
            gain = six.gain(np.radians(true_deg)).T
            rho = protocol.energy_to_noise_of(gain, snr_db)
            covariance = protocol.draw_covariances((gain * np.sqrt(rho)[:, np.newaxis])[..., np.newaxis], N_RECORD, rng)
            records = protocol.draw_records(gain[:n], rho[:n], rng)
            truths["paper"].append(true_deg)
            truths["best"].append(true_deg[:n])
            for k, manifold in enumerate(manifolds):
                some = slice(manifold.n_elements)  # elements 5 and 6 are dropped after the noise is set by all six
                errors[k, "paper"].append(error_deg(by_paper(covariance[:, some, some], grids[k]), true_deg))
                errors[k, "best"].append(error_deg(by_gate(records[:, some], manifold), true_deg[:n]))
        done = {key: np.concatenate(parts) for key, parts in errors.items()}
        for k in (0, 1):
            paper = float(tables[k]["accuracy_percent"][cell])
            rows[k].append(accuracy_row(f"{snr_db} dB", paper, done[k, "paper"], done[k, "best"]))
        n = campaign.trials  # as many for both: a range grows with the trials
        last = {method: done[0, method][:n] for method in truths}
        last |= {f"true_{method}": np.concatenate(true_deg)[:n] for method, true_deg in truths.items()}
        last["all_by_paper"] = done[0, "paper"]
    gate = f"best: a gate of {FOUND_GATE_SAMPLES} samples found in the whole record, then maximum likelihood, no grid"
    scoring = "unrounded: the same bearings not rounded to the grid, so that 2 degrees are 2 and not 2.5"
    return (
        Exhibit(
            name="table1",
            title="Table 1: accuracy (%) over SNR, six elements",
            rows=tuple(rows[0]),
            notes=(gate, scoring),
        ),
        _figure4(last),
        Exhibit(name="table2", title="Table 2: accuracy (%) over SNR, elements 1 to 4 of the six", rows=tuple(rows[1])),
    )


def _figure4(last: dict[str, FloatArray]) -> Exhibit:
    printed = published()["fig4"]
    low, high = printed["error_range_deg"]
    spread = printed["error_spread_printed_as_variance"]

    def row(
        label: str,
        paper: float,
        measure: Callable[[FloatArray], Measured],
        predict: Callable[[FloatArray], Prediction],
    ) -> Row:
        return Row(
            label=label,
            paper=paper,
            paper_method=measure(last["paper"]),
            best_method=measure(np.round(last["best"])),
            predicted=predict(last["all_by_paper"]),
            unit="deg",
        )

    def mean(errors: FloatArray) -> Measured:
        margin = 1.96 * float(errors.std()) / np.sqrt(errors.size)
        middle = float(errors.mean())
        return Measured(value=middle, n=errors.size, low=middle - margin, high=middle + margin)

    return Exhibit(
        name="fig4",
        title="Fig. 4: errors at -10 dB, six elements",
        rows=(
            row("mean", printed["error_mean_deg"], mean, Prediction.of_mean),
            row("standard deviation", spread, Measured.spread, Prediction.of_spread),
            row("least", low, _extreme(np.min), Prediction.of_least),
            row("largest", high, _extreme(np.max), Prediction.of_largest),
        ),
        notes=(f"slip: the paper calls {spread} the variance; it is the standard deviation, in degrees",),
        data=last,
    )


def _extreme(pick: Callable[[FloatArray], float]) -> Callable[[FloatArray], Measured]:
    return lambda errors: Measured(value=float(pick(errors)), n=errors.size)
