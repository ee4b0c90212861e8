"""Synthetic inspection logs in free space, with discharges of known level and rate, and noise as the only error."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dirmusic import GainManifold
from dirmusic.pulses.phase_resolved import KindName
from pdpatrol.missions.campaign.inspection import InspectionLog
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.sensing import PulseTrain
from tests.missions.steps import append_step

HEIGHT_M = 0.6
STEP_S = 0.1
MANIFOLD = GainManifold.ring(6)
NOISE_V = 1e-3
"""Noise of the strengths; the weakest valid pulse is five times as strong, see `STD_RAD`."""

STD_RAD = np.radians(12.0) * 5.0
"""Standard deviation of a bearing, multiplied by the ratio of strength to noise."""


DAYS = ("2026-03-02", "2026-03-09", "2026-03-16", "2026-03-23", "2026-03-30", "2026-04-06")
PLACE = (10.0, 10.0, 1.6)


class SurveyedSource(NamedTuple):
    """Position, median level of the pulses, its spread, rate and kind of a discharge; no kind means equal pulses."""

    position_m: tuple[float, float, float]
    level_db: float = 0.0
    spread_db: float = 0.0
    rate_hz: float = 20.0
    kind: KindName | None = None


def along(start_m: tuple[float, float], end_m: tuple[float, float], speed_mps: float = 0.5) -> np.ndarray:
    """Return poses on a straight line, one step apart, shape (n, 3)."""
    n = round(float(np.hypot(*np.subtract(end_m, start_m))) / (speed_mps * STEP_S))
    path_m = np.linspace(start_m, end_m, n)
    heading = np.arctan2(*np.subtract(end_m, start_m)[::-1])
    return np.column_stack([path_m, np.full(n, heading)])


PAST = along((6.0, 7.0), (14.0, 7.0))
"""Drive past `PLACE`."""


def survey(
    poses: np.ndarray,
    *sources: SurveyedSource,
    day: str | None = DAYS[0],
    seed: int = 0,
    name: str = "survey",
    mains_hz: float = 50.0,
    unexplained_every: int = 0,
) -> MissionLog:
    """Return the log of a drive whose findings are the sources, with ids from 1 in their order.

    The phase of the mains is unknown if `mains_hz` is NaN. If `unexplained_every` is n > 0, every n-th pulse is of
    no finding.
    """
    meta = {
        "name": name,
        "seed": None,
        "policy": None,
        "date": day,
        "n_elements": 6,
        "array": {
            "boresights_rad": MANIFOLD.boresights_rad.tolist(),
            "positions_m": np.tile([0.0, 0.0, HEIGHT_M], (6, 1)).tolist(),
            "pattern": None,
        },
        "bounds_m": [[0.0, 0.0], [40.0, 30.0]],
    }
    log, rng = MissionLog(meta), np.random.default_rng(seed)
    trains = [s.kind and PulseTrain.of_kind(s.kind, 50.0, 0.0, rng).times(s.rate_hz) for s in sources]
    for k, pose in enumerate(poses):
        append_step(log, STEP_S * (k + 1), pose)
        for number, (source, train) in enumerate(zip(sources, trains, strict=True), start=1):
            path_m = np.array(source.position_m) - [pose[0], pose[1], HEIGHT_M]
            azimuth = float(np.arctan2(path_m[1], path_m[0]) - pose[2])
            elevation = np.full(1, np.arctan2(path_m[2], np.hypot(path_m[0], path_m[1])))
            gain = MANIFOLD.response_in_space(azimuth - MANIFOLD.boresights_rad, elevation).gain
            if train is None:
                times_s = amplitudes = np.ones(rng.poisson(source.rate_hz * STEP_S))
            else:
                _, times_s, amplitudes = train.draw(STEP_S * k, STEP_S, rng)
            for time_s, amplitude in zip(times_s, np.abs(amplitudes), strict=True):
                level_db = source.level_db + source.spread_db * rng.standard_normal()
                strengths_v = amplitude * 10 ** (level_db / 20) * gain / np.linalg.norm(path_m)
                strength_v = float(np.linalg.norm(strengths_v))
                if strength_v < 5.0 * NOISE_V:
                    continue
                pulse = log.n_rows("pulse")
                log.append(
                    "pulse", step=k, strengths_v=strengths_v, std_v=np.full_like(strengths_v, NOISE_V),
                    mains_phase_rad=2 * np.pi * mains_hz * time_s, is_clipped=False, is_used=True,
                )  # fmt: skip
                log.append(
                    "bearing", pulse=pulse, azimuth_rad=azimuth, bearing_rad=azimuth + pose[2],
                    std_rad=STD_RAD * NOISE_V / strength_v, total_std_rad=STD_RAD, elevation_rad=0.0,
                )  # fmt: skip
                is_unexplained = unexplained_every > 0 and pulse % unexplained_every == 0
                log.append("association", pulse=pulse, finding=0 if is_unexplained else number)
    for number, source in enumerate(sources, start=1):
        log.append(
            "finding", step=len(poses) - 1, id=number, position_m=np.array(source.position_m),
            covariance_m2=0.05**2 * np.eye(3), state="confirmed", existence=1.0, possibly_two=False,
            n_bearings=100, first_detected_s=0.0, confirmed_s=1.0, aperture_rad=1.0, level_db=source.level_db,
        )  # fmt: skip
    return log


def inspections(logs: Iterable[MissionLog]) -> list[InspectionLog]:
    """Return inspections without files."""
    return [InspectionLog.of(Path(f"runs/{log.meta['date']}"), log) for log in logs]


def growing(name: str = "survey") -> list[MissionLog]:
    """Return four weekly surveys that pass a discharge, which grows by 3 dB a week."""
    return [
        survey(PAST, SurveyedSource(PLACE, -20.0 + 3.0 * k, 2.0), day=day, seed=k, name=name)
        for k, day in enumerate(DAYS[:4])
    ]
