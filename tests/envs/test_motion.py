"""Pose sensor, odometry and battery."""

from collections.abc import Sequence

import numpy as np
import pytest

from dirmusic.angles import wrap, wrapped
from pdpatrol.envs import load_scenario
from pdpatrol.envs.motion import sense_motion, start_motion
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.robot_states import N_DRAWS, Parameters, RobotStates
from pdpatrol.envs.scenario.robot import BatteryConfig, OdometryConfig, PoseSensorConfig
from pdpatrol.robot_models.readings import LIDAR, MOTOR_POWER, POSE, VELOCITY, WHEEL_ANGLES
from pdpatrol.sensing.quantities import Config
from tests.envs.helpers import drive

PERFECT = OdometryConfig(wheel_radius_error=0.0, gyro_bias_deg_per_min=0.0, gyro_noise_deg_per_sqrt_min=0.0)


class Sensors:
    """Motion sensors of `n` robots at steps of one length, with tables of the scenario replaced."""

    def __init__(self, n: int, step_s: float, **tables: Config) -> None:
        scenario = load_scenario("bench").model_copy(update=tables)
        self.n, self.state, self.parameters = n, RobotStates.zeros(n, scenario), Parameters.of(scenario, step_s=step_s)

    def sense(
        self,
        normal: np.ndarray | float = 0.0,
        *,
        true_pose: np.ndarray | float = 0.0,
        wheels_rad: float = 0.0,
        power_w: np.ndarray | float = 0.0,
        speed_mps: float = 0.0,
        started: Sequence[int] = (),
        rows: Sequence[int] | None = None,
    ) -> None:
        """Step some robots, all by default, and start those in `started`."""
        readings = np.zeros((self.n, 8))
        readings[:, POSE], readings[:, WHEEL_ANGLES], readings[:, MOTOR_POWER] = true_pose, wheels_rad, power_w
        readings[:, VELOCITY] = speed_mps, 0.0
        self.state.motion_normal[:] = normal
        for row in range(self.n) if rows is None else rows:
            update = start_motion if row in started else sense_motion
            update(self.state, self.parameters, readings[row], row)


def reckoned(
    config: OdometryConfig, start: np.ndarray, wheels_rad: np.ndarray, yaw_rad: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Return the odometry (400, 3) after steps of 0.1 s from an exactly known start (3,).

    Angles of wheels with a radius of 0.1 m and true headings have shape (n_steps,).
    """
    n, sharp = 400, PoseSensorConfig(position_std_m=0.0, heading_std_deg=0.0)
    sensors = Sensors(n, 0.1, pose_sensor=sharp, odometry=config)
    scale, bias = rng.standard_normal((2, n))
    sensors.state.metres_per_radian[:] = 0.1 * (1.0 + config.wheel_radius_error * scale)
    sensors.state.gyro_bias_radps[:] = np.radians(config.gyro_bias_deg_per_min) / 60.0 * bias
    for k, (wheel, yaw) in enumerate(zip([0.0, *wheels_rad], [start[2], *yaw_rad], strict=True)):
        true_pose, normal = np.array([start[0], start[1], yaw]), rng.standard_normal((n, N_DRAWS))
        sensors.sense(normal, true_pose=true_pose, wheels_rad=wheel, started=range(n) if k == 0 else ())
    return sensors.state.odometry


def test_odometry_without_errors_closes_a_circle() -> None:
    share = np.arange(1, 101) / 100
    start = np.array([1.0, 2.0, 0.3])
    wheels_rad, yaw_rad = 2 * np.pi * 3.0 * share / 0.1, 0.3 + 2 * np.pi * share
    ends = reckoned(PERFECT, start, wheels_rad, yaw_rad, np.random.default_rng(0))
    np.testing.assert_allclose(ends, np.tile(start, (400, 1)), atol=1e-9)


@pytest.mark.whole
def test_odometry_errors_are_those_of_wheels_and_gyro() -> None:
    straight = 0.8 * np.arange(1, 601), np.zeros(600)
    x, y, yaw = reckoned(OdometryConfig(), np.zeros(3), *straight, np.random.default_rng(0)).T
    assert x.std() == pytest.approx(48 * 0.001, rel=0.15)
    assert np.degrees(yaw.std()) == pytest.approx(np.hypot(0.05, 0.1), rel=0.15)
    assert abs(y.mean()) < 4 * y.std() / 20


def test_battery_supplies_motors_and_idle_load() -> None:
    config = BatteryConfig(capacity_wh=10.0, idle_w=80.0)
    sensors, power_w = Sensors(2, 36.0, odometry=PERFECT, battery=config), np.array([20.0, 120.0])
    battery = sensors.state.battery
    sensors.sense(started=[0, 1])
    for expected in ([0.9, 0.8], [0.8, 0.6]):
        sensors.sense(power_w=power_w)
        np.testing.assert_allclose(battery, expected)
    sensors.sense(power_w=power_w, started=[0])
    np.testing.assert_allclose(battery, [1.0, 0.4])
    sensors.sense(power_w=power_w, rows=[1])
    np.testing.assert_allclose(battery, [1.0, 0.2])
    assert sensors.state.time_s.tolist() == [0.0, 144.0]
    for _ in range(2):
        sensors.sense(power_w=power_w, rows=[1])
    assert battery[1] == 0.0


def test_battery_supplies_the_drive_in_both_directions() -> None:
    sensors = Sensors(1, 36.0, battery=BatteryConfig(capacity_wh=10.0, idle_w=80.0, drive_j_per_m=50.0))
    sensors.sense(started=[0])
    for speed_mps, expected in ((0.4, 0.9), (-0.4, 0.8)):
        sensors.sense(speed_mps=speed_mps)
        np.testing.assert_allclose(sensors.state.battery, expected)


def test_battery_is_charged_only_while_standing_at_the_dock() -> None:
    battery = BatteryConfig(capacity_wh=10.0, idle_w=100.0, drive_j_per_m=0.0, charge_w=50.0)
    sensors, dock_m = Sensors(1, 36.0, battery=battery), load_scenario("bench").route.dock_m
    at_dock, beside = np.array([*dock_m, 0.0]), np.array([dock_m[0] + 0.7, dock_m[1], 0.0])
    sensors.sense(started=[0], true_pose=at_dock)
    for pose, speed_mps, expected in (
        (at_dock, 0.0, 1.0), (beside, 0.0, 0.9), (at_dock, 0.1, 0.8), (at_dock, 0.0, 0.85), (at_dock, -0.1, 0.75),
    ):  # fmt: skip
        sensors.sense(true_pose=pose, speed_mps=speed_mps)
        np.testing.assert_allclose(sensors.state.battery, expected)


def test_episode_ends_when_the_battery_is_empty() -> None:
    env = PatrolEnv(load_scenario("quiet_yard", {"battery.capacity_wh": 0.02, "nature.battery.idle_w": 90.0}))
    env.reset(seed=0)
    steps = [env.step(drive(1.0, 0.0)) for _ in range(9)]
    batteries = [observation["state_of_charge"].item() for observation, *_ in steps]
    assert [terminated for _, _, terminated, _, _ in steps] == [battery == 0.0 for battery in batteries]
    assert batteries[-1] == 0.0
    assert batteries[0] == 1.0 or batteries[0] > batteries[1]


def displacement(start: np.ndarray, end: np.ndarray) -> complex:
    """Return the displacement between two poses in the frame of the first."""
    return complex(*(end - start)[:2]) * np.exp(-1j * start[2])


def test_odometry_drifts_by_less_than_half_a_percent() -> None:
    for seed in range(2):
        env, wish = PatrolEnv("one_source"), np.random.default_rng(seed).uniform([0.4, -0.6], [1.0, 0.6], (60, 2))
        infos = [env.reset(seed=seed)[1]]
        for speed, turn in np.repeat(wish, 20, axis=0):
            is_near = env.simulation.robots.readings.values[0, LIDAR][[0, 1, 2, 3, -1, -2, -3]].min() < 1.5
            infos.append(env.step(drive(speed, 0.9 if is_near else turn))[-1])
        true, odometry = (np.array([info[key] for info in infos]) for key in ("true_pose", "odometry"))
        driven_m = np.hypot(*np.diff(true[:, :2], axis=0).T).sum()
        assert driven_m > 30
        assert abs(displacement(odometry[0], odometry[-1]) - displacement(true[0], true[-1])) < 0.005 * driven_m


def test_compiled_wrap_equals_wrap() -> None:
    angles = np.concatenate([np.linspace(-20.0, 20.0, 1001), [np.pi, -np.pi, 3 * np.pi]])
    assert [wrapped(float(angle)) for angle in angles] == wrap(angles).tolist()


def test_pose_error_keeps_deviation_and_correlation() -> None:
    """The standard deviation is that of the scenario; the correlation falls to 1/e in the correlation time of 5 s."""
    sensors, rng = Sensors(1, 1.0), np.random.default_rng(0)
    sensors.sense(started=[0])
    seen = np.empty((60_000, 3))
    for row in seen:
        sensors.sense(rng.standard_normal((1, N_DRAWS)))
        row[:] = sensors.state.believed_pose[0]
    np.testing.assert_allclose(seen[30_000:].std(axis=0), [0.05, 0.05, np.radians(0.5)], rtol=0.05)
    assert np.corrcoef(seen[:-5, 0], seen[5:, 0])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_believed_heading_is_wrapped() -> None:
    sensors, true_pose = Sensors(200, 5.0, pose_sensor=PoseSensorConfig(heading_std_deg=5.0)), np.array([0, 0, np.pi])
    sensors.sense(true_pose=true_pose, started=range(200))
    sensors.sense(np.random.default_rng(0).standard_normal((200, N_DRAWS)), true_pose=true_pose)
    headings = sensors.state.believed_pose[:, 2]
    assert ((headings > -np.pi) & (headings <= np.pi)).all()
    assert (headings < 0).any()


def test_restarted_robot_draws_a_new_pose_error() -> None:
    rng, sensors = np.random.default_rng(1), Sensors(2, 0.1)
    sensors.sense(started=[0, 1])
    sensors.sense(rng.standard_normal((2, N_DRAWS)))
    before = sensors.state.believed_pose.copy()
    sensors.sense(rng.standard_normal((2, N_DRAWS)), started=[1])
    moved = np.abs(sensors.state.believed_pose - before)[:, 0]
    assert moved[0] < 0.03 < moved[1]
