"""Wrong maps: planner, Locator and report use the map; physics, lidar, radio and scores use the true yard."""

from copy import copy
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.record.log_contents import bearing_rmse
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import Mission, run_mission

RIGHT = load_scenario("one_source")
KIOSK = {
    "name": "kiosk",
    "kind": "cabinet",
    "shape": "box",
    "position_m": (5.0, 7.5),
    "footprint_m": (3.0, 1.0),
    "height_m": 2.0,
    "sites": {"door": (0.0, -0.5, 1.0)},
}
WRONG: dict[str, dict[str, Any]] = {
    "missing": {"missing": ("transformer_1",)},
    "extra": {"extra": (KIOSK,)},
    "moved": {"moved": ({"name": "transformer_1", "by_m": (-3.0, 1.0)},)},
}


def mapped(**wrong: Any) -> Scenario:  # noqa: ANN401 - tables of many types
    return Scenario.model_validate(RIGHT.model_dump() | {"map": wrong})


def drive_into_transformer_1(scenario: Scenario) -> list[dict[str, Any]]:
    """Return all observations on a drive into transformer_1."""
    env = PatrolEnv(scenario, terminate_on_approach=False, full_info=True)
    fixed = {"start_pose": (12.0, 13.0, np.pi / 2), "sources": {"discharge": "transformer_1/tap_changer"}}
    observation, info = env.reset(seed=3, options=fixed)
    steps: list[dict[str, Any]] = [observation]
    for _ in range(50):
        observation, reward, _, _, info = env.step(np.array([1.0, 0.0], dtype=np.float32))
        steps.append({**observation, "reward": reward, "touched": info["touched_names"], "pose": info["true_pose"]})
    return steps


@pytest.fixture(scope="module")
def right_drive() -> list[dict[str, Any]]:
    return drive_into_transformer_1(RIGHT)


@pytest.mark.parametrize("wrong", WRONG)
def test_simulation_uses_the_true_yard(wrong: str, right_drive: list[dict[str, Any]]) -> None:
    assert any("equipment/transformer_1" in step.get("touched", ()) for step in right_drive)
    assert sum(float(step["detected"][0]) for step in right_drive) > 3
    assert mapped(**WRONG[wrong]).candidate_sites(RIGHT.sources[0]) == RIGHT.candidate_sites(RIGHT.sources[0])
    for step, expected in zip(drive_into_transformer_1(mapped(**WRONG[wrong])), right_drive, strict=True):
        for key, value in expected.items():
            np.testing.assert_array_equal(step[key], value, err_msg=key)


@pytest.mark.parametrize(("wrong", "x_m", "y_m"), [("missing", 12.0, (12.5, 21.5)), ("extra", 5.0, (5.5, 9.5))])
def test_piece_on_the_map_hides_and_is_avoided(wrong: str, x_m: float, y_m: tuple[float, float]) -> None:
    """A piece that exists only in the yard or only on the map stands between two points."""
    true, shown = SiteMap(RIGHT), SiteMap(mapped(**WRONG[wrong]))
    without, having = (shown, true) if wrong == "missing" else (true, shown)
    south, north = (np.array([x_m, y]) for y in y_m)
    for site_map, is_open in ((without, True), (having, False)):
        assert site_map.in_sight(south[np.newaxis], np.append(north, 0.9), 0.0)[0] == is_open
        assert site_map.is_clear(south, north) == is_open
    lengths = [site_map.reach(south).length_m[site_map.cell(north)] for site_map in (without, having)]
    assert lengths[1] > lengths[0] + 1.0


def test_moved_piece_has_moved_sites_and_obstacles() -> None:
    scenario = mapped(moved=({"name": "transformer_1", "by_m": (-3.0, 1.0)},))
    for site in ("transformer_1/tank_south", "transformer_1/tap_changer"):
        off = scenario.known_yard.site_position(site) - scenario.yard.site_position(site)
        np.testing.assert_allclose(off, [-3.0, 1.0, 0.0], atol=1e-9)
    assert SiteMap(scenario).clearance(np.array([[9.0, 18.0]])) < 0
    assert SiteMap(scenario).clearance(np.array([[14.0, 17.0]])) > 0


@pytest.fixture(scope="module")
def log() -> MissionLog:
    """Return the log of a mission on a correct map, with a finding."""
    return run_mission(RIGHT, seed=4)


@pytest.mark.whole
def test_report_uses_map_and_scores_use_yard(log: MissionLog) -> None:
    (finding,) = make_report(log, 0.0).findings
    piece = finding.sites[0].name.partition("/")[0]
    assert finding.sites[0].probability > 0.5
    right = make_report(log, 0.0).scores.matches[0].error_m, bearing_rmse(log, RIGHT)
    x, y, _ = finding.position_m
    for wrong, is_named in (
        ({"missing": (piece,)}, False),
        ({"moved": ({"name": piece, "by_m": (1.0 if x < 20 else -1.0, 0.0)},)}, False),
        ({"extra": ({**KIOSK, "position_m": (x, y + 2.0)},)}, True),
    ):
        scenario = mapped(**wrong)
        on_map = copy(log)
        on_map.meta = {**log.meta, "scenario": scenario.model_dump(mode="json")}
        report = make_report(on_map, 0.0)
        best = report.findings[0].sites[0].name
        assert (best == finding.sites[0].name) == is_named
        (match,) = report.scores.matches
        assert match.right_site == (best == report.scores.sources[0].true_site)
        assert (match.error_m, bearing_rmse(on_map, scenario)) == right


def test_log_describes_equipment_only_on_the_map() -> None:
    scenario = mapped(missing=("transformer_2",), extra=(KIOSK,), moved=({"name": "ct_2", "by_m": (1.0, 0.0)},))
    meta = Mission(scenario, "patrol", 0).log.meta
    assert [solid["name"] for solid in meta["solids"]["map"]] == ["equipment/ct_2", "equipment/kiosk"]
    assert "kiosk/door" in meta["sites"]
    assert "transformer_2/tank_south" not in meta["sites"]
    assert meta["sites"]["ct_2/head"][0] == pytest.approx(RIGHT.yard.site_position("ct_2/head")[0] + 1.0)
    (moved, _), standing = meta["solids"]["map"], {solid["name"]: solid for solid in meta["solids"]["yard"]}
    np.testing.assert_allclose(np.subtract(moved["position_m"], standing["equipment/ct_2"]["position_m"]), [1, 0, 0])
    assert "map" not in Mission(RIGHT, "patrol", 0).log.meta["solids"]


@pytest.mark.whole
def test_mission_on_wrong_map_finds_the_discharge() -> None:
    scenario = mapped(missing=("ct_1",), extra=(KIOSK,), moved=({"name": "transformer_2", "by_m": (0.6, -0.4)},))
    report = make_report(run_mission(scenario, seed=4), 0.0)
    assert report.scores.sources[0].found
    assert report.waypoints.missed == ()
    assert report.collisions == 0
