"""Findings against the truth, and the tables that show them."""

import io

import numpy as np
import pytest
from rich.console import Console

from missions.record.scoring import evaluate
from missions.record.tables import candidates_table, findings_table


def finding(x: float, y: float, spread_m: float = 0.1, number: int = 1) -> dict:
    return {"id": number, "position_m": [x, y, 1.5], "covariance_m2": (spread_m**2 * np.eye(3)).tolist()}


def source(x: float, y: float, name: str = "s") -> dict:
    return {"name": name, "position_m": [x, y, 1.5]}


def test_findings_and_sources_are_paired_for_the_least_total_distance() -> None:
    # the nearest pair first would leave 2 and 0 paired at 1.9 m
    scores = evaluate([finding(1.0, 0.0), finding(0.0, 0.0)], [source(0.9, 0.0, "a"), source(1.9, 0.0, "b")])
    assert [round(s["error_m"], 6) for s in scores["sources"]] == [0.9, 0.9]
    assert scores["false_findings"] == 0


def test_a_finding_further_than_the_cut_off_is_false_and_its_source_not_found() -> None:
    scores = evaluate([finding(0.0, 0.0)], [source(2.1, 0.0)])
    assert scores["sources"][0]["found"] is False
    assert scores["sources"][0]["error_m"] is None
    assert scores["false_findings"] == 1
    assert scores["ospa_m"] == 2.0


def test_ospa_counts_what_is_missing_or_too_much_at_the_cut_off() -> None:
    assert evaluate([], [])["ospa_m"] == 0.0
    assert evaluate([finding(0.0, 0.0)], [source(0.5, 0.0), source(9.0, 0.0)])["ospa_m"] == pytest.approx(1.25)
    assert evaluate([finding(0.5, 0.0), finding(9.0, 0.0)], [source(0.0, 0.0)])["ospa_m"] == pytest.approx(1.25)


def test_the_truth_lies_inside_an_ellipse_that_is_wide_enough_only() -> None:
    for spread_m, inside in ((0.1, False), (0.3, True)):
        assert evaluate([finding(0.0, 0.0, spread_m)], [source(0.5, 0.0)])["sources"][0]["inside_ellipse95"] is inside


def test_a_source_is_paired_with_a_finding_by_its_id_even_if_two_findings_are_as_far() -> None:
    found = [finding(1.0, 0.0, number=4), finding(-1.0, 0.0, number=7)]
    (first, second) = evaluate(found, [source(0.0, 0.0, "a"), source(-2.0, 0.0, "b")])["sources"]
    assert (first["finding_id"], second["finding_id"]) == (4, 7)
    assert first["error_m"] == second["error_m"] == 1.0
    assert evaluate([], [source(0.0, 0.0)])["sources"][0]["finding_id"] is None


def report_of(found: list[dict], sources: list[dict]) -> dict:
    shown = {
        "ellipse95": {"semi_major_m": 0.2, "semi_minor_m": 0.1}, "n_bearings": 30, "sites": [],
        "discharge": None, "fixed_s": 12.0, "state": "confirmed",
    }  # fmt: skip
    rows = [{**one, **shown} for one in found]
    evaluation = evaluate(found, sources)
    return {"scenario": "yard", "seed": 1, "findings": rows, "candidates": rows, "evaluation": evaluation}


def lines(table: object) -> list[list[str]]:
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(table)
    return [line.split() for line in console.export_text().splitlines() if line.strip()]


def test_tables_number_findings_by_their_ids_and_name_the_false_one() -> None:
    found = [finding(1.0, 0.0, number=4), finding(9.0, 0.0, number=7)]
    report = report_of(found, [source(1.5, 0.0)])
    rows = [row for row in lines(findings_table(report)) if row[0] in "47"]
    assert [(row[0], row[-1]) for row in rows] == [("4", "0.50"), ("7", "false")]
    assert [row[0] for row in lines(candidates_table(report)) if row[0] in "47"] == ["4", "7"]
