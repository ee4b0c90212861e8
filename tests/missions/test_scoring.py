"""Findings against the truth, and the tables that show them."""

import io

import numpy as np
import pytest
from rich.console import Console

from dirmusic.locating.finding import ellipse95
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Discharge, Ellipse, FindingRecord, PhaseHistogram, Report, Site
from pdpatrol.missions.report.scoring import TrueSource, evaluate
from pdpatrol.missions.report.tables import candidates_table, findings_table
from tests.missions.report.logs import empty_log


def finding(x: float, y: float, spread_m: float = 0.1, number: int = 1, **shown: object) -> FindingRecord:
    covariance = spread_m**2 * np.eye(3)
    known = {
        "id": number, "state": "confirmed", "position_m": (x, y, 1.5), "position_std_m": (spread_m,) * 3,
        "covariance_m2": tuple(map(tuple, covariance.tolist())),
        "ellipse95": Ellipse(**ellipse95(covariance[:2, :2])._asdict()), "sites": (), "discharge": None,
        "strength": None, "detected_from": None, "n_bearings": 30, "first_detected_s": 0.0, "confirmed_s": 12.0,
    }  # fmt: skip
    return FindingRecord.model_validate({**known, **shown})


def source(x: float, y: float, name: str = "s") -> TrueSource:
    return TrueSource(name, (x, y, 1.5))


def test_findings_and_sources_are_paired_for_the_least_total_distance() -> None:
    # the nearest pair first would leave 2 and 0 paired at 1.9 m
    scores = evaluate([finding(1.0, 0.0), finding(0.0, 0.0)], [source(0.9, 0.0, "a"), source(1.9, 0.0, "b")])
    assert [round(match.error_m, 6) for match in scores.matches] == [0.9, 0.9]
    assert scores.false_findings == 0


def test_a_finding_further_than_the_cut_off_is_false_and_its_source_not_found() -> None:
    scores = evaluate([finding(0.0, 0.0)], [source(2.1, 0.0)])
    assert scores.sources[0].found is False
    assert scores.sources[0].match is None
    assert scores.false_findings == 1
    assert scores.ospa_m == 2.0


def test_ospa_counts_what_is_missing_or_too_much_at_the_cut_off() -> None:
    assert evaluate([], []).ospa_m == 0.0
    assert evaluate([finding(0.0, 0.0)], [source(0.5, 0.0), source(9.0, 0.0)]).ospa_m == pytest.approx(1.25)
    assert evaluate([finding(0.5, 0.0), finding(9.0, 0.0)], [source(0.0, 0.0)]).ospa_m == pytest.approx(1.25)


def test_the_truth_lies_inside_an_ellipse_that_is_wide_enough_only() -> None:
    for spread_m, inside in ((0.1, False), (0.3, True)):
        assert evaluate([finding(0.0, 0.0, spread_m)], [source(0.5, 0.0)]).matches[0].inside_ellipse95 is inside


def test_a_source_is_paired_with_a_finding_by_its_id_even_if_two_findings_are_as_far() -> None:
    found = [finding(1.0, 0.0, number=4), finding(-1.0, 0.0, number=7)]
    (first, second) = evaluate(found, [source(0.0, 0.0, "a"), source(-2.0, 0.0, "b")]).matches
    assert (first.finding_id, second.finding_id) == (4, 7)
    assert first.error_m == second.error_m == 1.0
    assert evaluate([], [source(0.0, 0.0)]).matches == ()


def report_of(found: list[FindingRecord], candidates: list[FindingRecord], sources: list[TrueSource]) -> Report:
    shown = {"findings": tuple(found), "candidates": tuple(candidates), "evaluation": evaluate(found, sources)}
    return make_report(empty_log(), 1.0).model_copy(update=shown)


def lines(table: object, width: int = 120) -> list[str]:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(table)
    return [line for line in console.export_text().splitlines() if line.strip()]


def test_tables_number_findings_by_their_ids_and_name_the_false_one() -> None:
    found = [finding(1.0, 0.0, number=4), finding(9.0, 0.0, number=7)]
    report = report_of(found, found, [source(1.5, 0.0)])
    rows = [line.split() for line in lines(findings_table(report)) if line.split()[0] in "47"]
    assert [(row[0], row[-1]) for row in rows] == [("4", "0.50"), ("7", "false")]
    told = [line.split()[0] for line in lines(candidates_table(report))]
    assert [word for word in told if word in "47"] == ["4", "7"]


PATTERN = PhaseHistogram(phase_step_deg=10.0, lowest_db=0.0, level_step_db=2.0, counts=((1,) * 36,))
LONG = "autotransformer_of_the_eastern_switchgear/medium_voltage_bushing_of_phase_3"


def test_at_eighty_columns_no_word_is_broken_and_no_figure_lacks_its_unit() -> None:
    void = Discharge(kind="void", confidence=0.97, shift_deg=0.0, pattern=PATTERN)
    report = report_of(
        [finding(123.45, 167.89, sites=(Site(name=LONG, probability=0.999),), discharge=void, number=12)],
        [],
        [source(123.0, 167.5)],
    )
    told = lines(findings_table(report), width=80)
    for part in LONG.replace("/", "_").split("_"):
        assert any(part in line for line in told), part
    assert all(len(line) <= 80 and "\u2026" not in line for line in told)
    heading = " ".join(told[1:3])
    assert heading.count("(m)") == 3
    assert "(s)" in heading


def test_what_lies_beyond_the_fence_is_on_no_site_and_an_unknown_kind_has_no_confidence() -> None:
    unknown = Discharge(kind="unknown", confidence=1.0, shift_deg=0.0, pattern=PATTERN)
    report = report_of([], [finding(-30.0, 5.0, state="outside", discharge=unknown, confirmed_s=None)], [])
    told = " ".join(lines(candidates_table(report), width=80))
    assert "beyond the fence" in told.partition("#")[2]
    assert "unknown" in told
    assert "%" not in told.partition("site")[2]
