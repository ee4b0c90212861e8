"""Damaged and hostile files are refused with clear errors, or run."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError, InputFileWarning
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.recording import write_recording
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report, report_text
from tests.missions.field.surveys import EXAMPLE
from tests.missions.files import hostile

HEADER = "time_s,x_m,y_m,yaw_deg,waveform"


def is_accepted(table: Path, recording: Path | None = None) -> bool:
    """Locate a table with warnings as errors; return False if it is refused with clear errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", InputFileWarning)
        try:
            data = read_field_data(table, noise_v=1e-3)
        except InputFileError as error:
            faults = error.faults
        else:
            log = locate_field_data(data, SurveyOptions())
            Report.model_validate_json(report_text(make_report(log, 0.0)))
            if recording is not None:
                write_recording(log, recording)
            return True
    assert 1 <= len(faults) <= 21
    assert all("\n" not in fault and len(fault) < 600 for fault in faults)
    return False


def count_accepted_tables(folder: Path, seeds: range) -> int:
    """Count the mutated tables that are accepted."""
    good = "\n".join(EXAMPLE.read_text(encoding="utf-8").splitlines()[:60])
    accepted = 0
    for seed in seeds:
        (folder / "t.csv").write_bytes(hostile.table(good, np.random.default_rng(seed)))
        accepted += is_accepted(folder / "t.csv", folder / "t.rrd" if seed % 10 == 0 else None)
    return accepted


def count_accepted_archives(folder: Path, seeds: range) -> int:
    """Count the mutated archives that are accepted."""
    (folder / "t.csv").write_text("\n".join([HEADER, *(f"{10 * k},{k},{k % 2},{30 * k},w.npz" for k in range(5))]))
    accepted = 0
    for seed in seeds:
        (folder / "w.npz").write_bytes(hostile.archive(np.random.default_rng(seed)))
        accepted += is_accepted(folder / "t.csv")
    return accepted


@pytest.mark.whole
def test_mutated_tables_are_refused_or_run(tmp_path: Path) -> None:
    assert 10 <= count_accepted_tables(tmp_path, range(100)) <= 90


@pytest.mark.whole
def test_mutated_archives_are_refused_or_run(tmp_path: Path) -> None:
    assert 4 <= count_accepted_archives(tmp_path, range(40)) <= 36
