"""Whole missions: what they find, that they come home, that they repeat, and that no policy is told the truth."""

import numpy as np
import pytest

from dirmusic.bearing.channel_health import CLEAR_STD_RAD
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.make_policy import make_policy
from pdpatrol.missions.policies.own_policy import BUILT_IN
from pdpatrol.missions.policies.protocol import SeesTruth
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.log_contents import described_grid
from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report, read_report, report_text
from pdpatrol.missions.report.wording import PULSE_CLASSES
from pdpatrol.missions.runner import Mission, run_mission
from pdpatrol.sensing.receiver.faults import ChannelFault


def test_without_a_route_the_robot_stands_and_listens_to_the_field_test() -> None:
    log = run_mission(load_scenario("paper_field"), "seek", seed=2)
    report = make_report(log, 1.0)
    assert report.distance_m < 0.1
    assert report.battery_left is not None
    assert 0.98 < report.battery_left < 1.0  # electronics take 80 W of 480 Wh for two minutes
    assert 190 <= report.n_bearings <= 200  # ten positions, twenty shots; the weakest may be too wide
    assert report.findings == ()  # one place gives bearings, no fix
    assert set(log.column("step", "phase")) == {"listen"}
    assert log.column("event", "subject")[-1] == "time limit"


def limited(scenario: Scenario, time_limit_s: float) -> Scenario:
    return scenario.model_copy(update={"task": scenario.task.model_copy(update={"time_limit_s": time_limit_s})})


def assert_equal(first: MissionLog, second: MissionLog) -> None:
    assert first.meta == second.meta
    for table in TABLES:
        for name, column in first.table(table).items():
            np.testing.assert_array_equal(second.column(table, name), column, err_msg=f"{table}.{name}")


@pytest.mark.whole
def test_a_mission_finds_the_discharge_visits_every_waypoint_and_docks() -> None:
    log = run_mission(load_scenario("one_source"), seed=4)
    report = make_report(log, 1.0)
    (source,) = report.scores.sources
    assert source.found
    assert source.match is not None
    assert source.match.error_m < 0.4
    assert report.scores.false_findings == 0
    assert report.collisions == 0
    assert report.waypoints.missed == ()
    assert log.column("event", "subject")[-1] == "docked"
    (finding,) = report.findings
    assert finding.n_bearings <= report.n_bearings
    counts = report.pulses
    assert counts.detected == log.n_rows("pulse") == sum(getattr(counts, fate) for fate in PULSE_CLASSES)
    assert counts.detected - counts.not_credible == report.n_bearings
    assert counts.of_findings is not None
    assert counts.of_findings > 0.5 * report.n_bearings
    assert finding.confirmed_s is not None
    assert finding.first_detected_s < finding.confirmed_s < report.sim_time_s
    assert finding.sites[0].name in load_scenario("one_source").yard.site_names()
    assert read_report(report_text(report)).findings[0].id == finding.id
    likelihood, grid = log.table("likelihood"), described_grid(log.meta["grid"])
    assert np.all(np.diff(likelihood["step"]) > 0)
    assert np.all(np.diff(likelihood["log_likelihood"].max(axis=1)) >= 0.0)
    most_likely_m = grid.centres_m[likelihood["log_likelihood"][-1].argmax()]
    assert np.linalg.norm(most_likely_m - source.true_position_m[:2]) < 1.0


def test_the_same_seed_gives_the_same_log_and_report_to_the_bit() -> None:
    scenario = limited(load_scenario("two_sources"), 60.0)
    first, second = (run_mission(scenario, seed=5) for _ in range(2))
    assert first.n_rows("finding") > 0
    assert_equal(first, second)
    assert make_report(first, 1.0) == make_report(second, 1.0)


def test_another_seed_gives_another_mission() -> None:
    scenario = limited(load_scenario("one_source"), 5.0)
    first, second = (run_mission(scenario, seed=seed).column("step", "true_pose") for seed in (0, 1))
    assert not np.array_equal(first, second)


def silent_at(position_m: tuple[float, float, float]) -> Scenario:
    """A source that never radiates: only who is told the truth can behave as if it were there."""
    scenario = limited(load_scenario("one_source"), 40.0)
    source = scenario.sources[0].model_copy(update={"sites": (), "position_m": position_m, "pulse_rate_hz": 0.0})
    return scenario.model_copy(update={"sources": (source,)})


@pytest.mark.parametrize("policy", BUILT_IN)
def test_no_policy_but_oracle_is_told_the_truth(policy: str) -> None:
    paths = [
        run_mission(silent_at(position), policy, seed=2).column("step", "true_pose")
        for position in ((6.0, 20.0, 1.0), (33.0, 13.0, 1.0))
    ]
    same = paths[0].shape == paths[1].shape and np.array_equal(paths[0], paths[1])
    assert same is (policy != "oracle")
    assert isinstance(make_policy(policy, np.random.default_rng(0)), SeesTruth) is (policy == "oracle")


def test_what_a_policy_sees_holds_no_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    mission = Mission(load_scenario("one_source"), "seek", 0)
    inner, seen = mission.policy, []

    def watching(observation: object, findings: object, site_map: object) -> object:
        seen.append((observation, findings, site_map))
        return inner(observation, findings, site_map)  # pyright: ignore[reportArgumentType]

    watching.phase, watching.unreachable = Phase("watched"), ()  # pyright: ignore[reportFunctionMemberAccess]
    monkeypatch.setattr(mission, "policy", watching)
    for _ in range(20):
        mission.step()
    source = mission.log.meta["truth"]["sources"][0]["position_m"]
    for observation, findings, site_map in seen:
        assert set(observation) == set(mission.env.observation_space.spaces)  # pyright: ignore
        assert all(not np.allclose(finding.position_m, source, atol=1e-6) for finding in findings)
        assert vars(site_map).keys() <= {
            "yard",
            "route",
            "task",
            "robot",
            "bearing_std_rad",  # of the data sheet or a calibration, and of the pose sensor
            "position_std_m",
            "antenna_height_m",
            "knows_pattern_above",
            "sight",
            "obstacles_m",
            "centres_m",
            "clearance_m",
            "_shape",
            "_planned_clearance_m",
            "is_free",
            "_free_cells",
            "_free_tree",
            "_graph",
        }


def test_every_policy_stops_at_the_time_limit() -> None:
    for policy in BUILT_IN:
        log = run_mission(limited(load_scenario("one_source"), 3.0), policy, seed=0)
        assert log.column("event", "subject")[-1] == "time limit"
        assert log.n_rows("step") == 30


def test_patrol_drives_the_route_and_ends_at_the_dock_though_it_hears() -> None:
    log = run_mission(load_scenario("quiet_yard"), "patrol", seed=1)
    assert log.column("event", "subject")[-1] == "docked"
    assert log.n_rows("bearing") > 100


def test_a_waypoint_that_cannot_be_reached_is_reported_and_skipped() -> None:
    scenario = load_scenario("quiet_yard")
    data = scenario.model_dump()
    wall = {"kind": "wall", "shape": "box", "height_m": 2.0}
    walls = (
        {"name": "wall_n", "position_m": (29.0, 9.0), "footprint_m": (6.0, 0.4), **wall},
        {"name": "wall_w", "position_m": (26.0, 4.6), "footprint_m": (0.4, 9.2), **wall},
    )
    data["yard"]["equipment"] = (*data["yard"]["equipment"], *walls)
    data["interferers"] = ()
    log = run_mission(Scenario.model_validate(data), "seek", seed=0)
    report = make_report(log, 1.0)
    assert report.waypoints.missed == report.waypoints.unreachable == (2,)
    assert log.column("event", "number")[log.column("event", "kind") == "unreachable"].tolist() == [2]
    assert report.sim_time_s < scenario.task.time_limit_s
    assert report.collisions == 0


def test_an_ended_mission_is_a_whole_one_cut_short() -> None:
    def stop(mission: Mission) -> None:
        if mission.time_s >= 2.0 and not mission.is_over:
            mission.end("interrupted")

    cut = run_mission(load_scenario("one_source"), "patrol", seed=1, after_step=stop)
    assert cut.n_rows("step") == 20
    whole = run_mission(limited(load_scenario("one_source"), 2.0), "patrol", seed=1)
    np.testing.assert_array_equal(cut.column("pulse", "strengths_v"), whole.column("pulse", "strengths_v"))
    assert make_report(cut, 1.0).findings == ()


OPEN_YARD = {
    "name": "open_yard",
    "yard": {"size_m": (30.0, 20.0)},
    "route": {"dock_m": (3.0, 3.0), "waypoints_m": ((15.0, 4.0), (26.0, 10.0), (15.0, 16.0))},
}
FREE_SOURCE = {"name": "pd", "position_m": (20.0, 9.0, 1.0)}


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
            id="two hundred times the false alarms",
        ),
    ],
)
def test_a_free_standing_source_is_found_also_when(changes: dict) -> None:
    report = make_report(run_mission(Scenario.model_validate({**OPEN_YARD, **changes}), seed=1), 1.0)
    assert report.scores.sources[0].found
    assert report.scores.false_findings == 0


def scores(name: str, seeds: range) -> list[Report]:
    return [make_report(run_mission(load_scenario(name), seed=seed), 1.0) for seed in seeds]


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 100])
def test_one_source_is_found_in_every_of_twenty_missions_and_mostly_inside_its_ellipse(first: int) -> None:
    reports = scores("one_source", range(first, first + 20))
    sources = [report.scores.sources[0] for report in reports]
    assert all(source.found for source in sources)
    matches = [match for report in reports for match in report.scores.matches]
    errors = [match.error_m for match in matches]
    assert np.median(errors) <= 0.30
    assert max(errors) <= 1.0
    assert sum(match.inside_ellipse95 for match in matches) >= 15
    assert sum(report.collisions for report in reports) == 0
    positions = np.array([source.true_position_m[:2] for source in sources])
    assert np.linalg.norm(positions[:, np.newaxis] - positions, axis=-1).max() > 8.0


@pytest.mark.slow
def test_two_sources_are_both_found_in_nine_of_ten_missions() -> None:
    reports = scores("two_sources", range(10))
    both = [all(source.found for source in report.scores.sources) for report in reports]
    assert sum(both) >= 9


@pytest.mark.slow
def test_the_interferer_beyond_the_fence_is_heard_in_every_mission_and_becomes_no_finding() -> None:
    reports = scores("quiet_yard", range(10))
    assert all(report.findings == () for report in reports)
    assert all(report.n_bearings > 100 for report in reports)


def test_clipped_pulses_are_told_logged_and_left_out_of_locating() -> None:
    scenario = limited(load_scenario("one_source"), 30.0)
    deaf = scenario.model_copy(update={"receiver": scenario.receiver.model_copy(update={"full_scale_v": 0.01})})
    log = run_mission(deaf, "patrol", seed=0)
    clipped = log.column("pulse", "is_clipped")
    assert clipped.any()
    assert not log.column("pulse", "is_credible")[clipped].any()
    assert list(log.column("event", "kind")).count("clipped") == 1


def test_a_channel_that_dies_is_told_left_out_and_does_not_spoil_the_mission() -> None:
    scenario = load_scenario("one_source")
    dead = scenario.receiver.model_copy(update={"faults": (ChannelFault(channel=2, kind="dead", start_s=5.0),)})
    log = run_mission(scenario.model_copy(update={"receiver": dead}), seed=1)
    report = make_report(log, 0.0)
    assert len(report.channel_faults) == 1
    assert "channel 2 is dead" in report.channel_faults[0]
    assert all(source.found for source in report.scores.sources)


@pytest.mark.parametrize("seed", range(4))
def test_a_channel_that_dies_is_told_after_a_few_dozen_pulses_with_a_clear_direction(seed: int) -> None:
    scenario = load_scenario("one_source")
    dead = scenario.receiver.model_copy(update={"faults": (ChannelFault(channel=2, kind="dead", start_s=5.0),)})
    env = PatrolEnv(scenario.model_copy(update={"receiver": dead}), terminate_on_approach=False, full_info=True)
    observation, info = env.reset(seed=seed)
    policy, site_map, n_clear = make_policy("patrol", np.random.default_rng(0)), SiteMap(scenario), 0
    while not info["suspects"]:
        action = policy(observation, (), site_map)
        assert action is not None
        observation, *_, info = env.step(action)
        if info["time_s"] > 5.0:
            n_clear += int((info["pulses"].std_rad < CLEAR_STD_RAD).sum())
    assert [(suspect.channel, suspect.kind) for suspect in info["suspects"]] == [(2, "dead")]
    assert n_clear <= 70


def test_a_healthy_mission_tells_of_no_channel_fault() -> None:
    log = run_mission(limited(load_scenario("two_sources"), 60.0), seed=11)
    assert "channel fault" not in log.column("event", "kind")
