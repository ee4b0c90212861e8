"""Emitters at 462.7 MHz located by uncalibrated receivers on a campus: mhrafi66/wireless_localization_frs_uofu."""

from __future__ import annotations

import ast
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from pyproj import Transformer

from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.locating.level_fit import locate_level
from dirmusic.locating.level_model import LevelChannel, LevelModel, LevelRows
from dirmusic.locating.level_pair import locate_two_levels

EVERY = 5
N_EVALUATED = 1000
"""Every fifth sample in the order of time is evaluated, 1000 in all; all others calibrate the receivers."""

EVERY_PAIR = 4
N_SIDE = 14
NEAR_M = 300.0
"""Of two emitters at once, every fourth sample is evaluated, on a grid of 14 x 14 cells of about 200 m (assumed)."""

ABSENT_DB = -100.9
MARGIN_DB = 4.0
"""A level counts as signal if it exceeds its receiver's noise by this margin (assumed). The noise is the 5 % quantile
of a receiver's levels. With all levels, a fifth of the located emitters lie outside their ellipses."""

SHADOW_DB, SHADOW_LENGTH_M = 3.0, 300.0
"""Errors that receivers near each other share (assumed): hills and buildings."""

LEAST_RANGE_M = 20.0
"""Smallest range, of positions by GPS (assumed)."""


class Samples(NamedTuple):
    """Levels of all receivers, NaN where absent, shape (n, n_receivers); their positions and those of the emitters.

    Positions are in metres, shapes (n, n_receivers, 2) and (n, n_emitters, 2).
    """

    level_db: FloatArray
    receiver_m: FloatArray
    emitter_m: FloatArray

    def part(self, chosen: slice | BoolArray) -> Samples:
        """Return some of the samples."""
        return Samples(*(column[chosen] for column in self))


def read_samples(folder: Path, name: str) -> Samples:
    """Read `single_tx.csv` or `two_tx.csv`; buses have positions of their own in each sample."""
    table = pd.read_csv(folder / name).sort_values("timestamp", kind="stable")
    known: dict[str, tuple[float, float] | None] = ast.literal_eval((folder / "location_coordinates.json").read_text())
    project = Transformer.from_crs("EPSG:4326", "EPSG:32612", always_xy=True)

    def to_metres(latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
        return np.stack(project.transform(longitude_deg, latitude_deg), axis=-1)

    levels: list[FloatArray] = []
    places: list[FloatArray] = []
    for receiver, place in known.items():
        moves = place is None
        levels.append(table[f"{receiver}_rss" if moves else receiver].to_numpy(np.float64))
        columns = (table[f"{receiver}_{axis}"].to_numpy(np.float64) for axis in "xy") if moves else np.array(place)
        places.append(np.broadcast_to(to_metres(*columns), (len(table), 2)))
    level_db, receiver_m = np.stack(levels, axis=1), np.stack(places, axis=1)
    labels = [label[:-8] for label in table if label.endswith("_x_coord")]
    emitters = [to_metres(*(table[f"{label}_{axis}_coord"].to_numpy(np.float64) for axis in "xy")) for label in labels]
    emitter_m = np.stack(emitters, axis=1)
    near = np.linalg.norm(receiver_m - emitter_m[0, 0], axis=-1) < 20e3  # a bus without a position is far away
    return Samples(np.where(near & (level_db > ABSENT_DB), level_db, np.nan), receiver_m, emitter_m)


class Calibration(NamedTuple):
    """Gain of each receiver at 1 m, noise, exponent, rms of the residuals, and that of the means of samples."""

    gain_db: FloatArray
    noise_db: FloatArray
    exponent: float
    error_db: float
    source_std_db: float


def calibrate(samples: Samples) -> Calibration:
    """Fit gains of all receivers and one exponent to samples of known emitters, by least squares."""
    n_receivers = samples.level_db.shape[1]
    columns = [each[np.isfinite(each)] for each in samples.level_db.T]
    noise_db = np.array([np.quantile(each, 0.05) if each.size else 0.0 for each in columns])
    sample, receiver = np.nonzero(samples.level_db > noise_db + MARGIN_DB)
    level_db = samples.level_db[sample, receiver]
    decades_db = _decades_db(samples.receiver_m - samples.emitter_m)[sample, receiver]
    design = np.column_stack([receiver[:, np.newaxis] == np.arange(n_receivers), -decades_db]).astype(np.float64)
    normal = design.T @ design + 1e-6 * np.eye(n_receivers + 1)
    *gain_db, exponent = np.linalg.solve(normal, design.T @ level_db)
    residual_db = level_db - design @ [*gain_db, exponent]
    count = np.maximum(np.bincount(sample), 1)
    mean_db = np.bincount(sample, residual_db) / count
    source_std_db = float(mean_db[count > 3].std())
    return Calibration(np.array(gain_db), noise_db, float(exponent), float(residual_db.std()), source_std_db)


class Survey(NamedTuple):
    """Calibrated receivers, and the box that holds the emitters of the calibration."""

    known: Calibration
    model: LevelModel
    low_m: FloatArray
    high_m: FloatArray

    @classmethod
    def of(cls, samples: Samples) -> Survey:
        """Calibrate all receivers with samples of known emitters."""
        known = calibrate(samples)
        model = LevelModel(
            tuple(LevelChannel(None, gain_db) for gain_db in known.gain_db.tolist()),
            source_std_db=known.source_std_db,
            exponent=known.exponent,
            exponent_std=0.3,
            white_db=known.error_db,
            shadow_db=SHADOW_DB,
            shadow_length_m=SHADOW_LENGTH_M,
            shadow_common=1.0,
            least_range_m=LEAST_RANGE_M,
        )
        box_m = samples.emitter_m[:, 0]
        return cls(known, model, box_m.min(axis=0) - 200.0, box_m.max(axis=0) + 200.0)

    def rows(self, level_db: FloatArray, receiver_m: FloatArray) -> LevelRows:
        """Return the levels of a sample that are above the noise; all levels where these are fewer than three."""
        used = np.flatnonzero(level_db > self.known.noise_db + MARGIN_DB)
        if used.size < 3:
            used = np.flatnonzero(np.isfinite(level_db))
        return LevelRows(level_db[used], receiver_m[used], np.zeros(used.size), used)


def evaluate(folder: Path) -> str:
    """Locate one emitter in each sample of the evaluated part, and describe the errors in a table."""
    samples = read_samples(folder, "single_tx.csv")
    is_evaluated = np.zeros(len(samples.level_db), dtype=np.bool_)
    is_evaluated[::EVERY][:N_EVALUATED] = True
    survey = Survey.of(samples.part(~is_evaluated))
    known_db = survey.known.gain_db[np.isfinite(samples.level_db).any(axis=0)]
    common = LevelChannel(None, float(known_db.mean()))
    equal = survey.model._replace(channels=(common,) * len(survey.model.channels), source_std_db=30.0)
    errors: dict[str, list[float]] = {"nearest receiver": [], "equal gains": [], "ours": []}
    found: list[tuple[bool, bool, float]] = []
    for level_db, receiver_m, (truth_m,) in zip(*samples.part(is_evaluated), strict=True):
        rows = survey.rows(level_db, receiver_m)
        ours = locate_level(rows, survey.model, survey.low_m, survey.high_m)
        simple = locate_level(rows, equal, survey.low_m, survey.high_m)
        found.append((ours.holds(truth_m), ours.is_located, ours.semi_major_m))
        positions_m = (rows.position_m[np.argmax(rows.level_db)], simple.position_m, ours.position_m)
        for each, position_m in zip(errors.values(), positions_m, strict=True):
            each.append(float(np.linalg.norm(position_m - truth_m)))
    inside, located, semi_major_m = np.array(found).T
    lines = [["method", "mean error (m)", "median (m)"], ["---"] * 3]
    lines += [[name, f"{np.mean(each):.0f}", f"{np.median(each):.0f}"] for name, each in errors.items()]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + (
        f"\n\n{100.0 * inside.mean():.1f} % of {inside.size} truths lie in their 95 % ellipses, "
        f"whose median long semi-axis is {np.median(semi_major_m):.0f} m. {located.sum():.0f} count as located; "
        f"{(located * (1 - inside)).sum():.0f} of these are outside their ellipses and **lost**."
    )


def evaluate_two(folder: Path) -> str:
    """Locate two emitters at once in every fourth sample, with the receivers calibrated by the samples of one."""
    survey = Survey.of(read_samples(folder, "single_tx.csv"))
    model = survey.model._replace(source_std_db=30.0)
    pairs = read_samples(folder, "two_tx.csv").part(slice(None, None, EVERY_PAIR))
    side = np.arange(N_SIDE) + 0.5
    cell_m = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) / N_SIDE * (survey.high_m - survey.low_m)
    near = np.zeros(2)
    for level_db, receiver_m, truth_m in zip(*pairs, strict=True):
        rows = survey.rows(level_db, receiver_m)
        strongest_m = rows.position_m[np.argsort(rows.level_db)[-2:]]
        for k, found_m in enumerate((locate_two_levels(rows, model, survey.low_m + cell_m).position_m, strongest_m)):
            off_m = np.linalg.norm(found_m[:, np.newaxis] - truth_m, axis=-1)
            near[k] += min(off_m.diagonal().max(), off_m[::-1].diagonal().max()) <= NEAR_M
    ours, simple = near / len(pairs.level_db)
    return (
        f"Two emitters at once, every {EVERY_PAIR}th sample, {len(pairs.level_db)} in all: both within {NEAR_M:.0f} m "
        f"in {100.0 * ours:.0f} %; the two receivers with the strongest levels are in {100.0 * simple:.0f} %."
    )


def _decades_db(off_m: FloatArray) -> FloatArray:
    """Compute 10 log10 of the range of offsets, shape (..., 2) to (...)."""
    return 10.0 * np.log10(np.maximum(np.linalg.norm(off_m, axis=-1), LEAST_RANGE_M))
