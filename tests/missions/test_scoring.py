"""Scores of findings against the truth, and tables for the terminal."""

import io

import numpy as np
import pytest
from rich.console import Console
from scipy.stats import multivariate_t

from dirmusic.locating.finding import ellipse95, is_inside95
from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import ELSEWHERE, site_probabilities
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import FindingRecord, Report, Scores, SiteInspection, SiteInspections
from pdpatrol.missions.report.scoring import pair_findings
from pdpatrol.missions.report.tables import candidates_table, findings_table
from pdpatrol.missions.sweep.dataset import MissionRow
from pdpatrol.missions.sweep.plan import make_plan
from tests.missions.report.logs import add_finding, empty_log

SITE, OTHER = "transformer_1/tank_south", "ct_1/head"
SCENARIO = load_scenario("one_source")
YARD = SCENARIO.yard
SITE_M = YARD.site_position(SITE)


def places(*xy_m: tuple[float, float]) -> np.ndarray:
    return np.array([(*xy, 1.5) for xy in xy_m]).reshape(-1, 3)


def test_pairing_minimises_the_total_distance() -> None:
    assert pair_findings(places((1.0, 0.0), (0.0, 0.0)), places((0.9, 0.0), (1.9, 0.0)))[0] == {0: 1, 1: 0}
    assert pair_findings(places(), places((0.0, 0.0)))[0] == {}
    assert pair_findings(places((0.0, 0.0)), places((2.1, 0.0))) == ({}, 2.0)  # beyond the cut-off


def test_ospa_counts_unpaired_members_at_the_cut_off() -> None:
    assert pair_findings(places(), places())[1] == 0.0
    two, one = places((0.5, 0.0), (9.0, 0.0)), places((0.0, 0.0))
    assert pair_findings(one, two)[1] == pair_findings(two, one)[1] == pytest.approx(1.25)


def log_of(*places_m: np.ndarray, n_steps: int = 100, **config: object) -> MissionLog:
    """Return the log of a mission of 10 s without findings, with sources of 0.2 V and 20 pulses per second."""
    scenario = SCENARIO.model_dump(mode="json")
    names = [f"source_{k}" for k in range(len(places_m))]
    scenario["sources"] = [scenario["sources"][0] | {"name": name} | config for name in names]
    truth = [
        {"name": name, "position_m": place_m.tolist(), "amplitude_v": 0.2, "pulse_rate_hz": 20.0}
        for name, place_m in zip(names, places_m, strict=True)
    ]
    log = empty_log()
    log.meta |= {"scenario": scenario, "truth": {"sources": truth}}
    for step in range(n_steps):
        log.append(
            "step", time_s=0.1 * step, pose=np.zeros(3), true_pose=np.zeros(3), odometry=np.zeros(3), battery=1.0,
            command=np.zeros(2), phase="patrol", phase_target=0,
        )  # fmt: skip
    return log


def scored(log: MissionLog, certified: tuple[str, ...] = (), level_db: float = -20.0, rate_hz: float = 1.0) -> Scores:
    """Return the scores of a log whose report certifies some sites."""
    known = {"state": "inspected", "probability": 1.0, "nearest_m": 3.0, "min_level_db": -30.0, "min_rate_hz": 0.1}
    sites = tuple(SiteInspection.model_validate({"name": name, **known}) for name in certified)
    return make_report(log, 0.0, SiteInspections(level_db=level_db, rate_hz=rate_hz, sites=sites)).scores


def test_distances_and_log_score_are_those_of_the_stated_distribution() -> None:
    root = np.array([[0.2, 0.0, 0.0], [0.1, 0.3, 0.0], [-0.1, 0.2, 0.5]])
    covariance, offset_m = root @ root.T, np.array([0.3, -0.2, 0.4])
    log = log_of(SITE_M)
    add_finding(log, 99, 4, "confirmed", tuple(SITE_M + offset_m), covariance_m2=covariance)
    (match,) = scored(log).matches
    assert (match.error_m, match.height_error_m) == pytest.approx((np.hypot(0.3, 0.2), 0.4))
    assert match.mahalanobis2_3d == pytest.approx(np.square(np.linalg.solve(root, offset_m)).sum())
    assert match.mahalanobis2_2d == pytest.approx(np.square(np.linalg.solve(root[:2, :2], offset_m[:2])).sum())
    assert match.log_score == pytest.approx(-multivariate_t.logpdf(offset_m, shape=0.75 * covariance, df=8))
    assert match.is_inside(0.95)[0] is is_inside95(offset_m[:2], covariance[:2, :2])


def test_site_score_is_of_the_place_named_first() -> None:
    """A finding between two sites names the nearer one, and the score is of the probability of the true one."""
    log, position_m, covariance = log_of(SITE_M), SITE_M + np.array([-1.0, 1.7, 0.2]), 0.25 * np.eye(3)
    add_finding(log, 99, 1, "confirmed", tuple(position_m), covariance_m2=covariance)
    (source,) = scored(log).sources
    probabilities = site_probabilities(YARD, position_m, covariance, SCENARIO.map.accuracy_m)
    assert source.true_site == SITE != next(iter(probabilities))
    assert source.match is not None
    assert not source.match.right_site
    assert source.match.site_log_score == pytest.approx(-np.log(probabilities[SITE]))


def test_true_place_off_the_sites_and_off_the_map() -> None:
    roof_m, air_m = SITE_M + np.array([0.0, 0.6, 0.0]), np.array([20.0, 4.0, 1.5])
    assert [source.true_site for source in scored(log_of(roof_m, air_m)).sources] == ["transformer_1", ELSEWHERE]
    log = log_of(SITE_M)
    log.meta["scenario"]["map"] = {"missing": ["transformer_1"]}
    assert scored(log).sources[0].true_site == ELSEWHERE


def live(log: MissionLog) -> tuple[int, int, float]:
    scores = scored(log)
    return scores.confirmations, scores.wrong_confirmations, round(scores.wrong_s, 6)


def shown(log: MissionLog, *rows: tuple[int, str, np.ndarray], number: int = 1) -> MissionLog:
    """Add a finding to a log: its state and position from each step on."""
    for step, state, position_m in rows:
        add_finding(log, step, number, state, tuple(position_m))
    return log


FAR_M = SITE_M + np.array([1.2, 0.0, 0.0])


def test_withdrawn_confirmations_count_for_the_time_they_were_shown() -> None:
    for steps, expected in ((15, (1, 0, 1.5)), (30, (1, 1, 3.0))):
        log = shown(log_of(SITE_M), (10, "confirmed", FAR_M), (10 + steps, "dropped", FAR_M))
        assert live(log) == expected
    twice = [(10, "confirmed", FAR_M), (22, "candidate", FAR_M), (40, "confirmed", FAR_M), (52, "dropped", FAR_M)]
    assert live(shown(log_of(SITE_M), *twice)) == (1, 1, 2.4)
    assert live(shown(log_of(), (10, "confirmed", FAR_M), (41, "dropped", FAR_M))) == (1, 1, 3.1)
    assert live(shown(log_of(SITE_M), (0, "candidate", FAR_M), (50, "outside", FAR_M))) == (0, 0, 0.0)


def test_first_right_confirmation_is_timed() -> None:
    """A source that is not active yet cannot be found, and a finding confirms only the nearest source."""
    rows = (10, "confirmed", FAR_M), (25, "confirmed", SITE_M), (70, "candidate", SITE_M)
    log = shown(log_of(SITE_M), *rows)
    assert live(log) == (1, 0, 1.5)
    assert scored(log).sources[0].confirmed_s == pytest.approx(2.5)
    assert scored(log).sources[0].found is False
    near_m = SITE_M - np.array([0.5, 0.0, 0.0])
    times_s = [source.confirmed_s for source in scored(shown(log_of(SITE_M, near_m), *rows)).sources]
    assert times_s == [pytest.approx(2.5), None]
    late = shown(log_of(SITE_M, active_s=(6.0, 1000.0)), *rows, (80, "confirmed", SITE_M))
    assert live(late) == (1, 1, 6.0)
    assert scored(late).sources[0].confirmed_s == pytest.approx(8.0)


def test_all_clear_is_false_if_a_stated_source_was_not_found() -> None:
    assert scored(log_of(SITE_M), (SITE,)).false_all_clears == (SITE,)
    assert scored(log_of(SITE_M), (OTHER,)).false_all_clears == ()
    assert scored(log_of(SITE_M), (SITE,), level_db=-13.0).false_all_clears == ()  # 0.2 V are -14 dBV
    assert scored(log_of(SITE_M, active_s=(20.0, 30.0)), (SITE,)).false_all_clears == ()
    assert scored(log_of(SITE_M, drift_db_per_min=60.0), (SITE,), level_db=-10.0).false_all_clears == (SITE,)
    assert scored(log_of(SITE_M, changes=({"at_s": 5.0, "amplitude_db": 6.0},)), (SITE,), -10.0).false_all_clears == (
        SITE,
    )
    assert scored(log_of(SITE_M, changes=({"at_s": 0.0, "pulse_rate_hz": 0.0},)), (SITE,)).false_all_clears == ()
    assert scored(log_of(SITE_M), (SITE,), rate_hz=21.0).false_all_clears == ()
    assert scored(log_of(SITE_M, duty_s=(2.0, 2.0)), (SITE,), rate_hz=10.0).false_all_clears == (SITE,)
    assert scored(log_of(SITE_M, duty_s=(2.0, 2.0)), (SITE,), rate_hz=11.0).false_all_clears == ()
    assert scored(log_of(SITE_M, duty_s=(60.0, 6.0)), (SITE,)).false_all_clears == ()
    for offset_m, expected in ((0.9, ()), (1.1, (SITE,))):
        log = shown(log_of(SITE_M), (50, "confirmed", SITE_M + np.array([offset_m, 0.0, 0.0])))
        assert scored(log, (SITE, OTHER)).false_all_clears == expected
    withdrawn = shown(log_of(SITE_M), (50, "confirmed", SITE_M), (60, "candidate", SITE_M))
    assert scored(withdrawn, (SITE,)).false_all_clears == (SITE,)
    assert make_report(log_of(SITE_M), 0.0).scores.false_all_clears is None


@pytest.mark.parametrize("possibly_two", [False, True])
def test_row_counts_the_found_sources_that_are_possibly_two(possibly_two: bool) -> None:
    log = log_of(SITE_M)
    add_finding(log, 99, 1, "confirmed", tuple(SITE_M), possibly_two=possibly_two)
    add_finding(log, 99, 2, "candidate", tuple(SITE_M + 0.5), possibly_two=True)
    row = MissionRow.of_log(make_plan(["one_source"], ["seek"], {}, [0]).jobs[0], log, 0.0, 0.0)
    assert (row.n_found, row.n_possibly_two) == (1, possibly_two)


def finding(x: float, y: float, spread_m: float = 0.1, number: int = 1, **shown: object) -> FindingRecord:
    covariance = spread_m**2 * np.eye(3)
    known = {
        "id": number, "state": "confirmed", "position_m": (x, y, 1.5), "position_std_m": (spread_m,) * 3,
        "covariance_m2": tuple(map(tuple, covariance.tolist())),
        "ellipse95": ellipse95(covariance[:2, :2])._asdict(), "sites": (), "discharge": None,
        "strength": None, "asset": None, "assessment": None, "existence": 0.97, "possibly_two": False, "n_bearings": 30,
        "first_detected_s": 0.0, "confirmed_s": 12.0,
    }  # fmt: skip
    return FindingRecord.model_validate({**known, **shown})


def report_of(found: list[FindingRecord], candidates: list[FindingRecord], source_m: tuple[float, float]) -> Report:
    log = log_of(*places(source_m))
    for each in found:
        add_finding(log, 99, each.id, "confirmed", each.position_m)
    return make_report(log, 1.0).model_copy(update={"findings": tuple(found), "candidates": tuple(candidates)})


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


@pytest.mark.parametrize(
    ("width", "name"), [(60, "breaker_1/lower_bushing"), (80, LONG), (120, "breaker_1/pole"), (120, LONG), (200, LONG)]
)
def test_table_uses_the_width_there_is(width: int, name: str) -> None:
    void = {
        "kind": "void", "confidence": 0.97, "shift_deg": 0.0, "phase_step_deg": 10.0, "lowest_db": 0.0,
        "level_step_db": 2.0, "counts": ((1,) * 36,),
    }  # fmt: skip
    report = report_of(
        [finding(123.45, 167.89, sites=({"name": name, "probability": 0.999},), discharge=void, number=12)],
        [],
        (123.0, 167.5),
    )
    shown = lines(findings_table(report), width)
    for part in name.replace("/", "_").split("_"):
        assert any(part in line for line in shown), part
    assert all(len(line) <= width and "\u2026" not in line for line in shown)
    fits = width == 200 or name == "breaker_1/pole"
    assert any(f"{name} > 99 %" in line for line in shown) == fits
    heading = " ".join(shown[1:4])
    assert heading.count("(m)") == 3
    assert "(s)" in heading
