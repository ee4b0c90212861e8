"""Scores of findings against the truth, and tables for the terminal."""

import io

import numpy as np
import pytest
from rich.console import Console

from dirmusic.locating.finding import ellipse95
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import FindingRecord, Report
from pdpatrol.missions.report.scoring import evaluate
from pdpatrol.missions.report.tables import candidates_table, findings_table
from tests.missions.report.logs import empty_log


def finding(x: float, y: float, spread_m: float = 0.1, number: int = 1, **shown: object) -> FindingRecord:
    covariance = spread_m**2 * np.eye(3)
    known = {
        "id": number, "state": "confirmed", "position_m": (x, y, 1.5), "position_std_m": (spread_m,) * 3,
        "covariance_m2": tuple(map(tuple, covariance.tolist())),
        "ellipse95": ellipse95(covariance[:2, :2])._asdict(), "sites": (), "discharge": None,
        "strength": None, "n_bearings": 30, "first_detected_s": 0.0, "confirmed_s": 12.0,
    }  # fmt: skip
    return FindingRecord.model_validate({**known, **shown})


def sources(*places_m: tuple[float, float]) -> dict[str, tuple[float, float, float]]:
    return {f"source_{k}": (x, y, 1.5) for k, (x, y) in enumerate(places_m)}


def test_pairing_minimises_the_total_distance() -> None:
    found = [finding(1.0, 0.0, number=4), finding(0.0, 0.0, number=7)]
    scores = evaluate(found, sources((0.9, 0.0), (1.9, 0.0)))
    assert [(match.finding_id, round(match.error_m, 6)) for match in scores.matches] == [(7, 0.9), (4, 0.9)]
    assert scores.false_findings == 0
    assert evaluate([], sources((0.0, 0.0))).matches == ()


def test_finding_beyond_the_cut_off_is_false() -> None:
    scores = evaluate([finding(0.0, 0.0)], sources((2.1, 0.0)))
    assert scores.sources[0].found is False
    assert scores.sources[0].match is None
    assert scores.false_findings == 1
    assert scores.ospa_m == 2.0


def test_ospa_counts_unpaired_members_at_the_cut_off() -> None:
    assert evaluate([], {}).ospa_m == 0.0
    assert evaluate([finding(0.0, 0.0)], sources((0.5, 0.0), (9.0, 0.0))).ospa_m == pytest.approx(1.25)
    assert evaluate([finding(0.5, 0.0), finding(9.0, 0.0)], sources((0.0, 0.0))).ospa_m == pytest.approx(1.25)


def test_ellipse_contains_the_truth_only_if_wide_enough() -> None:
    for spread_m, inside in ((0.1, False), (0.3, True)):
        assert evaluate([finding(0.0, 0.0, spread_m)], sources((0.5, 0.0))).matches[0].inside_ellipse95 is inside


def report_of(found: list[FindingRecord], candidates: list[FindingRecord], *places_m: tuple[float, float]) -> Report:
    scores = evaluate(found, sources(*places_m))
    shown = {"findings": tuple(found), "candidates": tuple(candidates), "evaluation": scores}
    return make_report(empty_log(), 1.0).model_copy(update=shown)


def lines(table: object, width: int = 120) -> list[str]:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(table)
    return [line for line in console.export_text().splitlines() if line.strip()]


def test_tables_show_ids_and_mark_false_findings() -> None:
    found = [finding(1.0, 0.0, number=4), finding(9.0, 0.0, number=7)]
    report = report_of(found, found, (1.5, 0.0))
    rows = [line.split() for line in lines(findings_table(report)) if line.split()[0] in "47"]
    assert [(row[0], row[-1]) for row in rows] == [("4", "0.50"), ("7", "false")]
    first = [line.split()[0] for line in lines(candidates_table(report))]
    assert [word for word in first if word in "47"] == ["4", "7"]


LONG = "autotransformer_of_the_eastern_switchgear/medium_voltage_bushing_of_phase_3"


def test_table_fits_eighty_columns() -> None:
    void = {
        "kind": "void", "confidence": 0.97, "shift_deg": 0.0, "phase_step_deg": 10.0, "lowest_db": 0.0,
        "level_step_db": 2.0, "counts": ((1,) * 36,),
    }  # fmt: skip
    report = report_of(
        [finding(123.45, 167.89, sites=({"name": LONG, "probability": 0.999},), discharge=void, number=12)],
        [],
        (123.0, 167.5),
    )
    shown = lines(findings_table(report), width=80)
    for part in LONG.replace("/", "_").split("_"):
        assert any(part in line for line in shown), part
    assert all(len(line) <= 80 and "\u2026" not in line for line in shown)
    heading = " ".join(shown[1:3])
    assert heading.count("(m)") == 3
    assert "(s)" in heading
