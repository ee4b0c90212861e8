"""Surveys for tests: the shipped example, and simulated tables of strengths."""

from pathlib import Path
from typing import Any

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report
from pdpatrol.sensing import ArrayConfig, ElementConfig, HelicalArray
from pdpatrol.sensing.nature.pulses import unit_pulse_energy
from pdpatrol.sensing.radio.surroundings import level_transform

EXAMPLE = Path(__file__).parents[3] / "examples" / "locate" / "strengths.csv"
SHARED = Path(__file__).parents[4] / "shared"
NOISE_V = 1e-3
FOUR_OF_SIX = tuple(ElementConfig(azimuth_deg=azimuth) for azimuth in (90.0, 30.0, -30.0, -90.0))


def orbit(n: int, radius_m: float, centre: tuple[float, float], turns: float = 1.0) -> FloatArray:
    """Return poses on a circle, shape (n, 3)."""
    angle = np.linspace(0, 2 * np.pi * turns, n, endpoint=False)
    return np.column_stack([centre[0] + radius_m * np.cos(angle), centre[1] + radius_m * np.sin(angle), angle + 2.0])


def survey(
    poses: FloatArray, *sources_m: tuple[float, float, float], seed: int, n_elements: int = 6
) -> list[list[float]]:
    """Simulate one pulse per pose and source, with an imperfect array and imperfectly known poses.

    Returns:
        Rows of time, pose and strengths.
    """
    rng = np.random.default_rng(seed)
    array = HelicalArray.draw(ArrayConfig(elements=FOUR_OF_SIX) if n_elements == 4 else ArrayConfig(), rng)
    energy_to_noise = unit_pulse_energy(20e9) / NOISE_V**2
    rows: list[list[float]] = []
    for k, (x, y, yaw) in enumerate(poses):
        for source_m in sources_m:
            pose = level_transform(np.array([x, y, yaw]))
            amplitude = 0.27 * array.free_space_response(np.array(source_m), pose)[0]
            energy = rng.noncentral_chisquare(90, np.square(amplitude) * energy_to_noise)
            estimated = [*(np.array([x, y]) + rng.normal(0, 0.05, 2)), np.degrees(yaw) + rng.normal(0, 0.5)]
            rows.append([30.0 * k, *estimated, *(NOISE_V * np.sqrt(np.maximum(energy - 90, 0)))])
    return rows


def write(path: Path, rows: list[list[float]]) -> Path:
    """Write rows of `survey` as a table."""
    header = ",".join(["time_s", "x_m", "y_m", "yaw_deg", *(f"strength_{k + 1}" for k in range(len(rows[0]) - 4))])
    path.write_text("\n".join([header, *(",".join(f"{v:.6f}" for v in row) for row in rows), ""]))
    return path


def log_of_table(table: Path, **options: Any) -> MissionLog:  # noqa: ANN401
    """Return the log of a table; `options` belong to the survey."""
    survey = SurveyOptions(**options)
    return locate_field_data(read_field_data(table, noise_v=survey.noise_v), survey)


def locate(table: Path, *, noise_v: float | None = NOISE_V, **options: Any) -> Report:  # noqa: ANN401
    """Return the report of a table; `options` belong to the survey."""
    return make_report(log_of_table(table, noise_v=noise_v, **options), 0.0)
