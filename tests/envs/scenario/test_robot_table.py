"""The table [robot]: a robot by name or file, checked with the scenario and used throughout the simulation."""

from pathlib import Path

import numpy as np
import pytest
from gymnasium import spaces

from pdpatrol.envs import Scenario, ScenarioError, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario import SHIPPED
from pdpatrol.envs.vector_env import PatrolVectorEnv
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from pdpatrol.robot_models.description.robot_description import xml_path
from pdpatrol.robot_models.description.robot_file import load_robot
from tests.envs.helpers import drive, replaced, write_yard


def with_robot(folder: Path, model: str, *changes: tuple[str, str]) -> Path:
    """Write a scenario with a robot to a folder."""
    return write_yard(folder, f'[robot]\nmodel = "{model}"', *changes)


def own_robot(folder: Path, *changes: tuple[str, str]) -> None:
    """Write a robot next to the scenario: the crawler with some text replaced."""
    text = replaced(xml_path("crawler").read_text(encoding="utf-8"), changes)
    (folder / "robots").mkdir()
    (folder / "robots" / "own.xml").write_text(text, encoding="utf-8")


def top_heavy(folder: Path) -> Path:
    """Write a scenario whose robot tips over when it brakes, with 60 kg in its head and a narrow wheelbase."""
    own_robot(
        folder,
        ('pos="0 0 0.6" mass="1.6"', 'pos="0 0 0.6" mass="60"'),
        ('pos="0.19 ', 'pos="0.03 '),
        ('pos="-0.19 ', 'pos="-0.03 '),
        ('<key name="home" qpos="0 0 -7.5437e-05 1 0 0 0 0 0 0 0"/>', ""),
    )
    return with_robot(folder, "robots/own.xml")


def test_default_robot_is_the_inspector() -> None:
    assert load_scenario("one_source").robot.description == load_robot("inspector")


def test_robot_path_is_relative_to_the_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own_robot(tmp_path, ('"max_speed" data="0.8"', '"max_speed" data="0.6"'))
    path = with_robot(tmp_path, "robots/own.xml")
    monkeypatch.chdir(SHIPPED)
    scenario = load_scenario(path)
    assert scenario.robot.description.max_speed_mps == 0.6
    assert Scenario.model_validate(scenario.model_dump()).robot.description == scenario.robot.description


def test_errors_of_the_robot_are_errors_of_the_scenario(tmp_path: Path) -> None:
    own_robot(
        tmp_path,
        ('"max_speed" data="0.8"', '"max_speed" data="-1"'),
        ('<gyro name="gyro" site="imu"/>', '<accelerometer name="gyro" site="imu"/>'),
    )
    path = with_robot(tmp_path, "robots/own.xml", ("gain_error = 0.05", "gain_error = -0.05"))
    with pytest.raises(ScenarioError) as refused:
        load_scenario(path)
    file = tmp_path / "robots" / "own.xml"
    assert {line for line in refused.value.faults if "robot.model" in line} == {
        f"{path}: robot.model: {file}: max_speed: must be one number above 0, got -1",
        f"{path}: robot.model: {file}: gyro: must be a gyro at the site `imu`",
    }
    assert any("array.gain_error" in line for line in refused.value.faults)


def test_stop_needs_room_for_the_robot(tmp_path: Path) -> None:
    near = ("dock_m = [3.0, 3.0]", "dock_m = [0.35, 3.0]")
    assert load_scenario(with_robot(tmp_path, "inspector", near)).route.dock_m == (0.35, 3.0)
    with pytest.raises(ScenarioError, match=r"0\.445 m or more .* 0\.35 m from fence/west"):
        load_scenario(with_robot(tmp_path, "crawler", near))


def test_actions_and_bounds_follow_the_limits_of_the_robot(tmp_path: Path) -> None:
    path = with_robot(tmp_path, "crawler")
    env, many = PatrolEnv(path), PatrolVectorEnv(2, path)
    speed_mps, yaw_rate_radps = load_robot("crawler").limits
    assert isinstance(env.observation_space, spaces.Dict)
    velocity = env.observation_space["velocity"]
    assert isinstance(velocity, spaces.Box)
    np.testing.assert_allclose(velocity.high, [2 * speed_mps, 2 * yaw_rate_radps])
    (observation, _), (rows, _) = env.reset(seed=1), many.reset(seed=1)
    for _ in range(25):
        observation, *_ = env.step(drive(-0.5, 1.0))
        rows, *_ = many.step(np.array([[-0.5, 1.0], [0.5, 0.0]], dtype=np.float32))
    np.testing.assert_allclose(observation["velocity"], [-0.5 * speed_mps, yaw_rate_radps], rtol=0.03)
    np.testing.assert_array_equal(rows["velocity"][0], observation["velocity"])


def test_fallen_robot_ends_its_own_episode(tmp_path: Path) -> None:
    path = top_heavy(tmp_path)
    env, many = PatrolEnv(path), PatrolVectorEnv(2, path)
    _, info = env.reset(seed=0)
    many.reset(seed=0)
    assert not info["fell_over"]
    terminated, truncated, step = False, False, 0
    for step in range(40):
        full = 1.0 if step < 20 else -1.0
        *_, terminated, truncated, info = env.step(drive(full, 0.0))
        *_, over, _, rows = many.step(np.array([[full, 0.0], [0.0, 0.0]], dtype=np.float32))
        assert terminated == info["fell_over"]
        assert over.tolist() == rows["fell_over"].tolist() == [terminated, False]
        if terminated:
            break
    assert terminated
    assert not truncated
    assert step > 2


@pytest.mark.whole
def test_mission_of_a_fallen_robot_has_a_complete_log(tmp_path: Path) -> None:
    log = run_mission(load_scenario(top_heavy(tmp_path)), "patrol", seed=0)
    assert log.column("event", "kind").tolist()[-1] == "end"
    assert log.column("event", "subject").tolist()[-1] == "fell over"
    assert log.n_rows("step") > 2
    assert np.isfinite(log.column("step", "true_pose")).all()
    assert make_report(log, 1.0).sim_time_s == log.column("step", "time_s")[-1]


def test_robot_keeps_the_speed_limit_of_the_scenario() -> None:
    scenario = load_scenario("one_source", {"robot.max_speed_mps": 0.3, "route.dock_yaw_deg": 45.0})
    env = PatrolEnv(scenario)
    env.reset(seed=0)
    poses = [env.step(drive(1.0, 0.0))[-1]["true_pose"] for _ in range(30)]
    speed_mps = np.hypot(*(poses[-1] - poses[-2])[:2]) / 0.1
    assert speed_mps == pytest.approx(0.3, rel=0.05)
    assert SiteMap(scenario).robot.max_speed_mps == 0.3
