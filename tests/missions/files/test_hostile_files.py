"""Files as nobody should send them: each is refused in clear lines, or runs; nothing else."""

import resource
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from dirmusic import ElementSpread, InputFileError, InputFileWarning, PoseError
from pdpatrol.missions.field.array_model import array_model
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.recording import write_recording
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.report_file import read_report, report_text
from tests.missions.files import hostile

EXAMPLE = Path(__file__).parents[3] / "examples" / "locate" / "strengths.csv"
PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))
HEADER = "time_s,x_m,y_m,yaw_deg,waveform"
SPREAD = ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
POSE_ERROR = PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0)


def tried(table: Path, recording: Path | None = None) -> bool:
    """Whether a table is accepted, and then located to the end, with warnings as errors; else it is refused clearly."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", InputFileWarning)
        try:
            data = read_field_data(table, noise_v=1e-3)
            array = array_model(data, SPREAD, None, None, 0.12, 0.6)
        except InputFileError as error:
            faults = error.faults
        else:
            log = locate_field_data(data, array, POSE_ERROR)
            read_report(report_text(make_report(log, 0.0)))
            if recording is not None:
                write_recording(log, recording)
            return True
    assert 1 <= len(faults) <= 21
    assert all("\n" not in fault and len(fault) < 600 for fault in faults)
    return False


def tried_tables(folder: Path, seeds: range) -> int:
    """How many of some mutated tables are accepted."""
    good = "\n".join(EXAMPLE.read_text(encoding="utf-8").splitlines()[:60])
    accepted = 0
    for seed in seeds:
        (folder / "t.csv").write_bytes(hostile.table(good, np.random.default_rng(seed)))
        accepted += tried(folder / "t.csv", folder / "t.rrd" if seed % 10 == 0 else None)
    return accepted


def tried_archives(folder: Path, seeds: range) -> int:
    """How many of some mutated archives are accepted."""
    (folder / "t.csv").write_text("\n".join([HEADER, *(f"{10 * k},{k},{k % 2},{30 * k},w.npz" for k in range(5))]))
    accepted = 0
    for seed in seeds:
        (folder / "w.npz").write_bytes(hostile.archive(np.random.default_rng(seed)))
        accepted += tried(folder / "t.csv")
    return accepted


def test_mutated_tables_are_refused_or_run(tmp_path: Path) -> None:
    assert 10 <= tried_tables(tmp_path, range(100)) <= 90


def test_mutated_archives_are_refused_or_run(tmp_path: Path) -> None:
    assert 10 <= tried_archives(tmp_path, range(100)) <= 90


@pytest.mark.slow
def test_many_mutated_files_are_refused_or_run_in_two_gigabytes(tmp_path: Path) -> None:
    assert 200 <= tried_tables(tmp_path, range(1000, 3000)) <= 1800
    assert 25 <= tried_archives(tmp_path, range(1000, 1500)) <= 450
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 2e6
