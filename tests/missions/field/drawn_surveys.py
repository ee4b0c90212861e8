"""Random surveys in random yards, with reflections and obstacles, and everyday mistakes in their tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from pyproj import Proj

from dirmusic import GaussianPattern
from dirmusic.angles import azimuth_of, wrap
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs.random_yard import random_source, random_yard
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.envs.scenario.sources import SourceConfig
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing import ArrayConfig, DischargeSource, HelicalArray, ReceiverConfig, Scene, level_transform
from pdpatrol.sensing.receiver.bank import listen_once

RECEIVER = ReceiverConfig()
PATHS = ("orbit", "route", "stops")
PLACE = ["time_s", "x_m", "y_m", "yaw_deg"]
STRENGTHS, DEVIATIONS = ([f"{kind}_{k}" for k in range(1, 7)] for kind in ("strength", "std"))


@dataclass(frozen=True, kw_only=True)
class DrawnSurvey:
    """Table of a survey, and how it was made.

    Attributes:
        table: Columns of the table.
        sources_m: Positions of the sources, shape (n_sources, 3).
        path: Kind of path: around the first source, along a route with the heading of travel, or stops with random
            headings.
        pattern: Angles, degrees, and gains, dB, of the pattern file; None without one.
    """

    table: pd.DataFrame
    sources_m: FloatArray
    path: str
    pattern: tuple[FloatArray, FloatArray] | None = None

    def write(self, folder: Path) -> tuple[Path, Path | None]:
        """Write the table, and the pattern if there is one; return their paths."""
        self.table.to_csv(folder / "t.csv", index=False)
        if self.pattern is None:
            return folder / "t.csv", None
        pd.DataFrame(dict(zip(("angle_deg", "gain_db"), self.pattern, strict=True))).to_csv(
            folder / "p.csv", index=False
        )
        return folder / "t.csv", folder / "p.csv"

    def changed(self, **columns: ArrayLike) -> DrawnSurvey:
        """Return the survey with other values in some columns."""
        return replace(self, table=self.table.assign(**columns))


def draw_survey(seed: int, *, n_sources: int = 1, n_poses: int | None = None) -> DrawnSurvey:
    """Draw a survey with 8 to 30 poses, or as many as stated, and one to six pulses of each source at each.

    Array and poses have the errors of their data sheets. Weak sources are not detected everywhere.
    """
    rng = np.random.default_rng([42, seed])
    yard = random_yard(rng, int(rng.integers(0, 7))).yard
    sources_m = np.array([position_of(random_source(yard, rng), yard) for _ in range(n_sources)])
    path = str(rng.choice(PATHS))
    poses = draw_poses(path, n_poses or int(rng.integers(8, 31)), sources_m[0], rng)
    n_pulses = int(rng.integers(1, 7))
    sources = [
        DischargeSource(
            name=f"source_{k}",
            position_m=place_m,
            amplitude_v=float(10 ** rng.uniform(-1.0, 0.0)),
            pulse_rate_hz=float(n_pulses),
            n_shots=n_pulses,
        )
        for k, place_m in enumerate(sources_m)
    ]
    array, scene = HelicalArray.draw(ArrayConfig(), rng), Scene(sources, surroundings_of(yard))
    rows: list[list[float]] = []
    for step, pose in enumerate(poses):
        detected = listen_once(RECEIVER, array, scene, rng, world_from_array=level_transform(pose), duration_s=1.0)
        pulses = detected.pulses.take(~detected.pulses.is_overdriven)
        measured = pose + rng.normal(0.0, [0.05, 0.05, np.radians(0.5)])
        place = [20.0 * step, *np.round(measured[:2], 3), round(float(np.degrees(wrap(measured[2]))), 2)]
        deviations = np.sqrt(pulses.variance_v2)
        rows += [[*place, *own, *std] for own, std in zip(pulses.strengths_v, deviations, strict=True)]
    return DrawnSurvey(
        table=pd.DataFrame(rows, columns=[*PLACE, *STRENGTHS, *DEVIATIONS]), sources_m=sources_m, path=path
    )


def position_of(source: SourceConfig, yard: Yard) -> FloatArray:
    """Return the position of a source, shape (3,)."""
    return yard.site_position(source.sites[0]) if source.position_m is None else np.array(source.position_m)


def draw_poses(path: str, n: int, source_m: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return true poses, shape (n, 3)."""
    if path == "orbit":
        angle = rng.uniform(0, 2 * np.pi) + np.linspace(0, rng.uniform(2.5, 6.3), n)
        radius_m = rng.uniform(2.5, 7.0) * (1.0 + 0.2 * np.sin(2 * angle + rng.uniform(0, 6.3)))
        places_m = source_m[:2] + rng.normal(0, 1.0, 2) + (radius_m * np.array([np.cos(angle), np.sin(angle)])).T
        yaw_rad = angle + 0.5 * np.pi + rng.normal(0, 0.2, n)
    elif path == "route":
        corners_m = source_m[:2] + rng.uniform(-9.0, 9.0, (int(rng.integers(3, 6)), 2))
        along_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners_m, axis=0), axis=1)))
        at_m = np.linspace(0.0, along_m[-1], n)
        places_m = np.column_stack([np.interp(at_m, along_m, corner_m) for corner_m in corners_m.T])
        leg = np.clip(np.searchsorted(along_m, at_m, side="right") - 1, 0, len(corners_m) - 2)
        yaw_rad = azimuth_of(np.diff(corners_m, axis=0))[leg] + rng.normal(0, 0.1, n)
    else:
        places_m = source_m[:2] + rng.uniform(-8.0, 8.0, (n, 2))
        yaw_rad = rng.uniform(-np.pi, np.pi, n)
    return np.column_stack([places_m, yaw_rad])


def _with_degrees(survey: DrawnSurvey, rng: np.random.Generator) -> DrawnSurvey:
    latitude_deg, longitude_deg = rng.uniform(-60.0, 60.0), rng.uniform(-180.0, 180.0)
    ground = Proj(proj="aeqd", lat_0=latitude_deg, lon_0=longitude_deg, ellps="WGS84")
    x_deg, y_deg = ground(survey.table.x_m.to_numpy(), survey.table.y_m.to_numpy(), inverse=True)
    return survey.changed(x_m=np.round(x_deg, 7), y_m=np.round(y_deg, 7))


def _with_order(survey: DrawnSurvey, order: IntArray) -> DrawnSurvey:
    values = {names[k]: survey.table[names[order[k]]] for names in (STRENGTHS, DEVIATIONS) for k in range(6)}
    return survey.changed(**values)


def _with_decibels(survey: DrawnSurvey, rng: np.random.Generator) -> DrawnSurvey:
    volts = survey.table[STRENGTHS].clip(lower=1e-5)
    decibels = np.round(20 * np.log10(volts.to_numpy() / 1e-6) + rng.uniform(-3.0, 20.0), 2)
    return survey.changed(**dict(zip(STRENGTHS, decibels.T, strict=True)), **dict.fromkeys(DEVIATIONS, 1.0))


def _with_pattern(survey: DrawnSurvey, turn_deg: float, sign: float) -> DrawnSurvey:
    angle_deg = np.arange(-180.0, 180.0, 5.0)
    gain_db = 20 * np.log10(GaussianPattern()(np.radians(angle_deg - turn_deg)))
    return replace(survey, pattern=(angle_deg, np.round(sign * gain_db, 2)))


MISTAKES: dict[str, Callable[[DrawnSurvey, np.random.Generator], DrawnSurvey]] = {
    "compass": lambda survey, _: survey.changed(yaw_deg=(90.0 - survey.table.yaw_deg) % 360.0),
    "clockwise": lambda survey, _: survey.changed(yaw_deg=-survey.table.yaw_deg),
    "radians": lambda survey, _: survey.changed(yaw_deg=np.radians(survey.table.yaw_deg).round(4)),
    "millimetres": lambda survey, _: survey.changed(x_m=1e3 * survey.table.x_m, y_m=1e3 * survey.table.y_m),
    "degrees": _with_degrees,
    "decibels": _with_decibels,
    "exchanged": lambda survey, _: survey.changed(x_m=survey.table.y_m, y_m=survey.table.x_m),
    "north and east": lambda survey, _: survey.changed(
        x_m=survey.table.y_m, y_m=survey.table.x_m, yaw_deg=(90.0 - survey.table.yaw_deg) % 360.0
    ),
    "order reversed": lambda survey, _: _with_order(survey, np.arange(6)[::-1]),
    "order rotated": lambda survey, rng: _with_order(survey, np.roll(np.arange(6), rng.integers(1, 6))),
    "pattern upside down": lambda survey, _: _with_pattern(survey, 0.0, -1.0),
    "pattern turned": lambda survey, rng: _with_pattern(survey, rng.choice([-1, 1]) * rng.uniform(30.0, 180.0), 1.0),
}
"""Everyday mistakes: what they make of a sound survey."""
