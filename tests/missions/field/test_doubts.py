"""Everyday mistakes in surveys are doubted with the right cause, and sound surveys are not doubted."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dirmusic import InputFileError
from pdpatrol.missions.field.doubts import doubts
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import array_model
from pdpatrol.missions.field.survey import Heading, SurveyOptions
from tests.missions.field.drawn_surveys import DEVIATIONS, MISTAKES, STRENGTHS, DrawnSurvey, draw_survey
from tests.missions.field.surveys import EXAMPLE, locate

CAUSES = {
    "compass": "compass headings",
    "clockwise": "angles clockwise",
    "radians": "radians",
    "millimetres": "millimetres",
    "degrees": "longitude and latitude",
    "decibels": "decibels",
    "exchanged": "x_m and y_m may be exchanged:",
    "north and east": "x_m and y_m may be exchanged, and yaw_deg compass headings",
    "order reversed": "another order",
    "order rotated": "another order|turned by about",
    "pattern upside down": "attenuation as gain",
    "pattern turned": "turned by about|another order",
}
"""Pattern of the text of the cause of each mistake; a ring whose channels are rotated is turned."""


def example() -> DrawnSurvey:
    """Return the shipped example."""
    return DrawnSurvey(table=pd.read_csv(EXAMPLE), sources_m=np.array([[14.0, 9.0, 1.9]]), path="route")


def notes_on(survey: DrawnSurvey, folder: Path, heading: Heading = "counterclockwise") -> list[str]:
    """Return the doubts about a survey."""
    table, pattern = survey.write(folder)
    options = SurveyOptions(pattern=pattern, heading=heading)
    data = read_field_data(table, heading=heading)
    return doubts(data, array_model(data, options).manifold, options)


def test_sound_example_is_not_doubted(tmp_path: Path) -> None:
    assert notes_on(example(), tmp_path) == []


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_in_the_example_is_named(tmp_path: Path, mistake: str) -> None:
    notes = notes_on(MISTAKES[mistake](example(), np.random.default_rng(1)), tmp_path)
    assert re.search(CAUSES[mistake], notes[0])


@pytest.mark.parametrize(
    ("columns", "factor", "cause"),
    [
        (["time_s"], 1 / 86_400, "time_s may not hold seconds: the poses are 29 m apart along the path and 0.00301 s"),
        (["time_s"], 0.0, "time_s may not hold seconds"),
        ([*STRENGTHS, *DEVIATIONS], 1e3, "strengths may be millivolts or microvolts: the median"),
    ],
)
def test_unit_that_leaves_directions_as_they_are_is_doubted(
    tmp_path: Path, columns: list[str], factor: float, cause: str
) -> None:
    (note,) = notes_on(example().changed(**{name: factor * example().table[name] for name in columns}), tmp_path)
    assert note.startswith(cause)


def test_degrees_with_compass_headings_are_named_together(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    note, *_ = notes_on(MISTAKES["degrees"](MISTAKES["compass"](example(), rng), rng), tmp_path)
    assert note.startswith("x_m and y_m may be longitude and latitude in degrees, and yaw_deg compass headings")
    assert note.endswith("convert them to metres east and north, and use --heading compass")


def test_saturated_channel_is_doubted(tmp_path: Path) -> None:
    """Rounded strengths, whose largest occur less often than smaller ones, are not doubted."""
    strength_v = example().table.strength_2
    (note,) = notes_on(example().changed(strength_2=strength_v.clip(upper=strength_v.quantile(0.6))), tmp_path)
    assert note.startswith("channel 2 may be saturated: 34 pulses have exactly its largest strength")
    assert notes_on(example().changed(**example().table[STRENGTHS].round(3)), tmp_path) == []


@pytest.mark.parametrize("heading", ["compass", "clockwise"])
def test_heading_option_corrects_the_doubted_column(tmp_path: Path, heading: Heading) -> None:
    """With the option that the doubt names, the survey has no doubt and its poses equal the original ones."""
    written = MISTAKES[heading](example(), np.random.default_rng(1))
    (note,) = notes_on(written, tmp_path)
    assert note.endswith(f"use --heading {heading}")
    assert notes_on(written, tmp_path, heading) == []
    turn_rad = read_field_data(tmp_path / "t.csv", heading=heading).pose[:, 2] - read_field_data(EXAMPLE).pose[:, 2]
    np.testing.assert_allclose(np.cos(turn_rad), 1.0, atol=1e-6)
    (note,) = notes_on(example(), tmp_path, heading)
    assert note.endswith("use --heading counterclockwise")


@pytest.mark.whole
def test_boresights_of_the_doubt_correct_the_order(tmp_path: Path) -> None:
    (tmp_path / "with").mkdir()
    table, _ = MISTAKES["order reversed"](example(), np.random.default_rng(1)).write(tmp_path)
    doubted = locate(table, noise_v=None)
    (note,) = [note for note in doubted.notes if "--boresights-deg" in note]
    boresights_deg = tuple(map(float, note.partition("--boresights-deg ")[2].split()))
    (finding,) = locate(table, noise_v=None, boresights_deg=boresights_deg).findings
    assert np.linalg.norm(np.subtract(finding.position_m, example().sources_m[0])[:2]) < 0.3


def test_negative_strengths_are_refused_as_decibels(tmp_path: Path) -> None:
    decibels = 20 * np.log10(example().table[STRENGTHS])
    table, _ = example().changed(**{name: decibels[name] for name in STRENGTHS}).write(tmp_path)
    with pytest.raises(InputFileError, match="must be in volts, not in decibels: most are negative") as refused:
        read_field_data(table)
    assert len(refused.value.faults) == 1


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_random_surveys_are_named(tmp_path: Path, mistake: str) -> None:
    """In at least 18 of 20 random surveys, the first doubt names the mistake that was made."""
    n_named = 0
    for seed in range(20):
        survey = MISTAKES[mistake](draw_survey(seed), np.random.default_rng(seed))
        n_named += bool(re.search(CAUSES[mistake], " ".join(notes_on(survey, tmp_path)[:1])))
    assert n_named >= 18


@pytest.mark.slow
def test_sound_random_surveys_are_not_doubted(tmp_path: Path) -> None:
    """At most 4 of 200 are doubted, with one or two sources, reflections, and few poses."""
    surveys = (
        draw_survey(1000 + seed, n_sources=1 + seed % 2, n_poses=4 + seed % 5 if seed % 4 == 0 else None)
        for seed in range(200)
    )
    assert sum(bool(notes_on(survey, tmp_path)) for survey in surveys) <= 4
