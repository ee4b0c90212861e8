"""`pdpatrol trend` in its own process."""

import json
from pathlib import Path

import pytest

from pdpatrol.missions.campaign.records import Trend
from pdpatrol.missions.report.records import report_text
from tests.missions.campaign.surveys import DAYS, growing
from tests.missions.conftest import Refused
from tests.missions.field.surveys import EXAMPLE, log_of_table
from tests.processes import pdpatrol

pytestmark = pytest.mark.whole


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return four weeks of a growing discharge, in folders with markup in their names."""
    folders = [tmp_path_factory.mktemp("Prüfung [bold]") for _ in DAYS[:4]]
    for folder, log in zip(folders, growing(), strict=True):
        log.save(folder)
    return folders


def test_table_fits_80_columns_and_files_are_written_once(runs: list[Path], tmp_path: Path, refused: Refused) -> None:
    done = pdpatrol("trend", *runs, "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "grown" in done.stdout
    assert (tmp_path / "out" / "trend.html").stat().st_size > 10_000
    table, _, _ = done.stdout.partition("Written to")
    assert max(map(len, table.splitlines())) <= 80
    text = (tmp_path / "out" / "trend.json").read_text("utf-8")
    written = Trend.model_validate_json(text)
    assert report_text(written) == text
    assert written.dates == DAYS[:4]
    assert written.discharges[0].verdict == "grown"
    (line,) = refused("trend", *runs, "--out", "out", cwd=tmp_path)
    assert "must be a new or empty folder" in line


def test_relevant_growth_must_be_positive_and_limits_the_constant(
    runs: list[Path], tmp_path: Path, refused: Refused
) -> None:
    (line,) = refused("trend", *runs, "--relevant-db-per-week", "0", cwd=tmp_path)
    assert "--relevant-db-per-week: must be greater than 0, got " in line
    done = pdpatrol("trend", *runs[:3], "--relevant-db-per-week", "20", "--json", cwd=tmp_path)
    assert Trend.model_validate_json(done.stdout).relevant_db_per_week == 20.0


def test_unusable_folders_are_refused_in_one_line(runs: list[Path], tmp_path: Path, refused: Refused) -> None:
    one_date = tmp_path / "one_date"
    one_date.mkdir()
    growing()[0].save(one_date)
    for words, message in (
        ([runs[0], one_date], "RUN: inspections of at least two dates must be given, got 2026-03-02"),
        (runs[:1], "RUN: inspections of at least two dates must be given, got 2026-03-02"),
        ([], "RUN: inspections of at least two dates must be given, got none"),
        ([runs[0], tmp_path], "log.npz"),
    ):
        (line,) = refused("trend", *words, "--out", "never", cwd=tmp_path)
        assert message in line
    assert not (tmp_path / "never").exists()


def test_field_data_of_two_dates_are_a_trend(tmp_path: Path) -> None:
    for day in DAYS[:2]:
        (tmp_path / day).mkdir()
        log_of_table(EXAMPLE, date=day).save(tmp_path / day)
    done = pdpatrol("trend", *DAYS[:2], "--json", "--out", "trend", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (discharge,) = json.loads(done.stdout)["discharges"]
    first, second = (each["level_db"] for each in discharge["observations"])
    assert first == second
    assert first["lower"] < first["value"] < first["upper"]
