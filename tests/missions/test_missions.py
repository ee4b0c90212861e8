"""Complete missions: findings, return to the dock, determinism, and policies that do not know the truth."""

import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.missions.policies.make_policy import BUILT_IN
from pdpatrol.missions.record.log_contents import grid_of
from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report, report_text
from pdpatrol.missions.runner import Mission, run_mission
from pdpatrol.sensing.receiver.faults import ChannelFault


@pytest.mark.whole
def test_robot_without_route_stands_still() -> None:
    log = run_mission(load_scenario("paper_field"), "seek", seed=2)
    report = make_report(log, 1.0)
    assert np.ptp(log.column("step", "true_pose")[:, :2], axis=0).max() < 0.1
    assert report.battery_left == 1.0  # the charger at the dock carries the electronics
    assert 0.9 * 200 < report.n_bearings < 1.05 * 200  # ten positions, twenty shots; few false alarms from noise
    assert report.findings == ()  # bearings from one place give no position
    assert set(log.column("step", "phase")) == {"listen"}
    assert log.column("event", "subject")[-1] == "time limit"


def limited(name: str, time_limit_s: float) -> Scenario:
    return load_scenario(name, {"task.time_limit_s": time_limit_s})


def assert_equal(first: MissionLog, second: MissionLog) -> None:
    assert first.meta == second.meta
    for table in TABLES:
        for name, column in first.table(table).items():
            np.testing.assert_array_equal(second.column(table, name), column, err_msg=f"{table}.{name}")


@pytest.mark.whole
def test_mission_finds_the_discharge_and_docks() -> None:
    log = run_mission(load_scenario("one_source"), seed=4)
    report = make_report(log, 1.0)
    (source,) = report.scores.sources
    assert source.found
    assert source.match is not None
    assert source.match.error_m < 0.4
    assert report.scores.false_findings == 0
    assert report.collisions == 0
    assert report.waypoints.missed == ()
    assert report.battery_left is not None
    energy_wh = (80.0 * report.sim_time_s + 20.0 * report.distance_m) / 3600.0  # electronics and rolling resistance
    assert 1.0 - report.battery_left == pytest.approx(energy_wh / 480.0, rel=0.05)
    assert report.charges == ()
    assert log.column("event", "subject")[-1] == "docked"
    (finding,) = report.findings
    assert finding.n_bearings <= report.n_bearings
    counts = report.pulses
    assert counts.detected == log.n_rows("pulse") == sum(counts.model_dump(exclude={"detected"}).values())
    assert counts.detected - counts.rejected == report.n_bearings < 2 * (counts.of_findings or 0)
    assert finding.confirmed_s is not None
    assert finding.first_detected_s < finding.confirmed_s < report.sim_time_s
    assert finding.sites[0].name in load_scenario("one_source").yard.site_names()
    assert Report.model_validate_json(report_text(report)).findings[0].id == finding.id
    likelihood, grid = log.table("likelihood"), grid_of(log.meta)
    assert np.all(np.diff(likelihood["step"]) > 0)
    assert np.all(np.diff(likelihood["log_likelihood"].max(axis=1)) >= 0.0)
    most_likely_m = grid.centres_m[likelihood["log_likelihood"][-1].argmax()]
    assert np.linalg.norm(most_likely_m - source.true_position_m[:2]) < 1.0


@pytest.mark.whole
def test_missions_are_deterministic() -> None:
    scenario = limited("two_sources", 40.0)
    first, second = (run_mission(scenario, seed=5) for _ in range(2))
    assert first.n_rows("finding") > 0
    assert "channel fault" not in first.column("event", "kind")
    assert_equal(first, second)
    assert make_report(first, 1.0) == make_report(second, 1.0)


def scenario_without_pulses(position_m: tuple[float, float, float]) -> Scenario:
    """Return a scenario with a source that never radiates."""
    scenario = limited("one_source", 40.0)
    source = scenario.sources[0].model_copy(update={"sites": (), "position_m": position_m, "pulse_rate_hz": 0.0})
    return scenario.model_copy(update={"sources": (source,)})


@pytest.mark.whole
@pytest.mark.parametrize("policy", BUILT_IN)
def test_only_oracle_depends_on_the_truth(policy: str) -> None:
    paths = [
        run_mission(scenario_without_pulses(position), policy, seed=2).column("step", "true_pose")
        for position in ((6.0, 20.0, 1.0), (33.0, 13.0, 1.0))
    ]
    same = paths[0].shape == paths[1].shape and np.array_equal(paths[0], paths[1])
    assert same is (policy != "oracle")


def test_unreachable_waypoint_is_skipped_and_reported() -> None:
    wall = {"kind": "wall", "shape": "box", "height_m": 2.0}
    walls = (
        {"name": "wall_n", "position_m": (29.0, 9.0), "footprint_m": (6.0, 0.4), **wall},
        {"name": "wall_w", "position_m": (26.0, 4.6), "footprint_m": (0.4, 9.2), **wall},
    )
    data = load_scenario("quiet_yard").model_dump()
    data["yard"]["equipment"] = (*data["yard"]["equipment"], *walls)
    log = run_mission(Scenario.model_validate({**data, "interferers": ()}), "seek", seed=0)
    report = make_report(log, 1.0)
    assert report.waypoints.missed == report.waypoints.unreachable == (2,)
    assert log.column("event", "number")[log.column("event", "kind") == "unreachable"].tolist() == [2]
    assert log.column("event", "subject")[-1] != "time limit"
    assert report.collisions == 0


def test_interrupted_mission_equals_a_shorter_one() -> None:
    def stop(mission: Mission) -> None:
        if mission.time_s >= 2.0 and not mission.is_over:
            mission.end("interrupted")

    cut = Mission(load_scenario("one_source"), "patrol", 1).run(stop)
    assert cut.n_rows("step") == 20
    whole = run_mission(limited("one_source", 2.0), "patrol", seed=1)
    np.testing.assert_array_equal(cut.column("pulse", "strengths_v"), whole.column("pulse", "strengths_v"))
    assert make_report(cut, 1.0).findings == ()


OPEN_YARD = {
    "name": "open_yard",
    "yard": {"size_m": (30.0, 20.0)},
    "route": {"dock_m": (3.0, 3.0), "waypoints_m": ((15.0, 4.0), (26.0, 10.0), (15.0, 16.0))},
}
FREE_SOURCE = {"name": "pd", "position_m": (20.0, 9.0, 1.0)}


@pytest.mark.whole
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"sources": ({**FREE_SOURCE, "pulse_rate_hz": 1.0},), "array": {}}, id="one pulse a second"),
        pytest.param(
            {
                "sources": (FREE_SOURCE,),
                "array": {"gain_error": 0.0, "pointing_error_deg": 0.0, "position_error_m": 0.0},
                "pose_sensor": {"position_std_m": 0.0, "heading_std_deg": 0.0},
            },
            id="array and pose without error",
        ),
        pytest.param(
            {"sources": (FREE_SOURCE,), "array": {}, "receiver": {"false_alarm_rate_hz": 20.0}},
            id="200 times the false alarms",
        ),
    ],
)
def test_free_standing_source_is_found(changes: dict) -> None:
    report = make_report(run_mission(Scenario.model_validate({**OPEN_YARD, **changes}), seed=1), 1.0)
    assert report.scores.sources[0].found
    assert report.scores.false_findings == 0


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 100])
def test_one_source_is_found_in_twenty_missions(first: int) -> None:
    reports = [
        make_report(run_mission(load_scenario("one_source"), seed=seed), 1.0) for seed in range(first, first + 20)
    ]
    sources = [report.scores.sources[0] for report in reports]
    assert all(source.found for source in sources)
    matches = [match for report in reports for match in report.scores.matches]
    errors = [match.error_m for match in matches]
    assert np.median(errors) <= 0.30
    assert max(errors) <= 1.0
    assert sum(match.is_inside(0.95)[0] for match in matches) >= 15
    assert sum(report.collisions for report in reports) == 0
    positions = np.array([source.true_position_m[:2] for source in sources])
    assert np.linalg.norm(positions[:, np.newaxis] - positions, axis=-1).max() > 8.0


@pytest.mark.whole
def test_finding_on_an_interferer_within_the_fence_is_false() -> None:
    place_m = (12.0, 6.0, 1.5)
    lamp = {"name": "lamp", "position_m": place_m, "amplitude_v": 0.27, "kind": "surface"}
    report = make_report(run_mission(load_scenario("one_source", {"sources": [], "interferers": [lamp]}), seed=0), 0.0)
    assert len(report.findings) == report.scores.false_findings == 1
    assert np.linalg.norm(np.subtract(report.findings[0].position_m, place_m)[:2]) < 0.5


@pytest.mark.whole
def test_clipped_pulses_are_not_used_for_locating() -> None:
    clipping = load_scenario("one_source", {"task.time_limit_s": 30.0, "receiver.full_scale_v": 0.01})
    log = run_mission(clipping, "patrol", seed=0)
    clipped = log.column("pulse", "is_clipped")
    assert clipped.any()
    assert not log.column("pulse", "is_used")[clipped].any()
    assert list(log.column("event", "kind")).count("clipped") == 1


@pytest.mark.whole
def test_mission_survives_a_dead_channel() -> None:
    dead = ChannelFault(channel=2, kind="dead", start_s=5.0)
    scenario = load_scenario("one_source", {"nature.receiver.faults": (dead,)})
    report = make_report(run_mission(scenario, seed=1), 0.0)
    (fault,) = report.channel_faults
    assert "channel 2 is dead" in fault
    assert all(source.found for source in report.scores.sources)
