"""What a robot knows of its motion: believed pose, dead reckoning, battery."""

import numpy as np
import pytest

from dirmusic.angles import difference, wrap
from dirmusic.kernels import wrapped
from pdpatrol.envs.motion import N_DRAWS, Motion, SensorParameters, StepInputs, move
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario.robot import BatteryConfig, OdometryConfig, PoseSensorConfig
from pdpatrol.robot_models.readings import MOTOR_POWER, POSE, WHEEL_ANGLES

PERFECT = OdometryConfig(wheel_radius_error=0.0, gyro_bias_deg_per_min=0.0, gyro_noise_deg_per_sqrt_min=0.0)


def sense(
    motion: Motion,
    sensors: SensorParameters,
    normal: np.ndarray,
    *,
    true_pose: np.ndarray | float = 0.0,
    wheels_rad: float = 0.0,
    power_w: np.ndarray | float = 0.0,
    is_reset: np.ndarray | None = None,
    is_idle: np.ndarray | None = None,
) -> None:
    """A step of all robots: nobody is reset and nobody idle unless masks say so."""
    n = len(motion.n_steps)
    nobody, readings = np.zeros(n, dtype=np.bool_), np.zeros((n, 8))
    readings[:, POSE], readings[:, WHEEL_ANGLES], readings[:, MOTOR_POWER] = true_pose, wheels_rad, power_w
    reset, idle = (nobody if mask is None else mask for mask in (is_reset, is_idle))
    move(motion, sensors, StepInputs(readings, normal, np.zeros((n, 0, 2)), nobody, reset, idle))


def reckoned(
    config: OdometryConfig, start: np.ndarray, wheels_rad: np.ndarray, yaw_rad: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Odometry (n_robots, 3) after steps of 0.1 s, from a start (3,) that is believed exactly.

    Wheels of 0.1 m and headings as they are truly turned, one after the other, shape (n_steps,).
    """
    n, sharp = 400, PoseSensorConfig(position_std_m=0.0, heading_std_deg=0.0)
    motion, sensors = Motion.at_rest(n), SensorParameters.of(sharp, config, BatteryConfig(), 0.1)
    for k, (wheel, yaw) in enumerate(zip([0.0, *wheels_rad], [start[2], *yaw_rad], strict=True)):
        true_pose, normal = np.array([start[0], start[1], yaw]), rng.standard_normal((n, N_DRAWS))
        is_reset = np.full(n, k == 0)
        sense(motion, sensors, normal, true_pose=true_pose, wheels_rad=wheel, is_reset=is_reset)
        if k == 0:
            for row in range(n):
                motion.draw_odometry(row, config, 0.1, rng)
    return motion.odometry


def test_without_errors_it_follows_a_circle_and_closes_it() -> None:
    share = np.arange(1, 101) / 100
    start = np.array([1.0, 2.0, 0.3])
    wheels_rad, yaw_rad = 2 * np.pi * 3.0 * share / 0.1, 0.3 + 2 * np.pi * share
    ends = reckoned(PERFECT, start, wheels_rad, yaw_rad, np.random.default_rng(0))
    np.testing.assert_allclose(ends, np.tile(start, (400, 1)), atol=1e-9)


def test_its_errors_are_those_of_wheels_and_gyro() -> None:
    straight = 0.8 * np.arange(1, 601), np.zeros(600)
    x, y, yaw = reckoned(OdometryConfig(), np.zeros(3), *straight, np.random.default_rng(0)).T
    assert x.std() == pytest.approx(48 * 0.001, rel=0.15)
    assert np.degrees(yaw.std()) == pytest.approx(np.hypot(0.05, 0.1), rel=0.15)
    assert abs(y.mean()) < 4 * y.std() / 20


def test_the_battery_gives_what_motors_and_electronics_take_and_is_full_at_the_start() -> None:
    config = BatteryConfig(capacity_wh=10.0, idle_w=80.0)
    motion, sensors = Motion.at_rest(2), SensorParameters.of(PoseSensorConfig(), PERFECT, config, 36.0)
    one, power_w, normal = np.array([True, False]), np.array([20.0, 120.0]), np.zeros((2, N_DRAWS))
    for expected in ([0.9, 0.8], [0.8, 0.6]):
        sense(motion, sensors, normal, power_w=power_w)
        np.testing.assert_allclose(motion.battery, expected)
    sense(motion, sensors, normal, power_w=power_w, is_reset=one)
    np.testing.assert_allclose(motion.battery, [1.0, 0.4])
    sense(motion, sensors, normal, power_w=power_w, is_idle=one)
    np.testing.assert_allclose(motion.battery, [1.0, 0.2])
    assert motion.time_s.tolist() == [0.0, 144.0]
    sense(motion, sensors, normal, power_w=power_w, is_idle=one)
    assert motion.battery[1] == 0.0


def test_driven_about_the_yard_it_drifts_by_less_than_half_a_percent_of_the_way() -> None:
    drifts = []
    for seed in range(4):
        env = PatrolEnv("one_source")
        _, info = env.reset(seed=seed)
        rng = np.random.default_rng(seed)
        start, true_start, driven_m, before = info["odometry"], info["true_pose"], 0.0, info["true_pose"]
        wish = rng.uniform([0.4, -0.6], [1.0, 0.6], (60, 2)).astype(np.float32)
        for k in range(1200):
            action = wish[k // 20].copy()
            if env.simulation.robots.readings.lidar_m[0, [0, 1, 2, 3, -1, -2, -3]].min() < 1.5:
                action[1] = 0.9
            _, _, _, _, info = env.step(action)
            pose = info["true_pose"]
            driven_m += float(np.hypot(*(pose[:2] - before[:2])))
            before = pose
        turn = float(difference(start[2], true_start[2]))
        cos, sin = np.cos(turn), np.sin(turn)
        moved, true_moved = info["odometry"][:2] - start[:2], before[:2] - true_start[:2]
        drifts.append(float(np.hypot(*(moved - np.array([[cos, -sin], [sin, cos]]) @ true_moved))) / driven_m)
        assert driven_m > 30
    assert max(drifts) < 0.005


def test_the_compiled_wrap_is_the_wrap() -> None:
    angles = np.concatenate([np.linspace(-20.0, 20.0, 1001), [np.pi, -np.pi, 3 * np.pi]])
    assert [wrapped(float(angle)) for angle in angles] == wrap(angles).tolist()


def read(motion: Motion, config: PoseSensorConfig, true_pose: np.ndarray, every_s: float, normal: np.ndarray) -> None:
    """Let the believed poses of all robots follow their true ones, (3,) or (n_robots, 3)."""
    sense(
        motion,
        SensorParameters.of(config, OdometryConfig(), BatteryConfig(), every_s),
        normal,
        true_pose=true_pose,
    )


def errors(n: int, every_s: float) -> np.ndarray:
    motion, rng, seen = Motion.at_rest(1), np.random.default_rng(0), []
    for _ in range(n):
        read(motion, PoseSensorConfig(), np.zeros(3), every_s, rng.standard_normal((1, N_DRAWS)))
        seen.append(motion.pose[0].copy())
    return np.array(seen)


def test_the_spread_stays_as_configured_however_long_it_runs() -> None:
    seen = errors(60_000, 1.0)[30_000:]
    np.testing.assert_allclose(seen.std(axis=0), [0.05, 0.05, np.radians(0.5)], rtol=0.05)


def test_an_error_keeps_a_share_of_one_over_e_after_the_correlation_time() -> None:
    seen = errors(60_000, 1.0)[:, 0]
    assert np.corrcoef(seen[:-5], seen[5:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.03)


def test_the_believed_heading_stays_in_the_half_open_turn() -> None:
    motion, config = Motion.at_rest(200), PoseSensorConfig(heading_std_deg=5.0)
    read(motion, config, np.array([0.0, 0.0, np.pi]), 5.0, np.random.default_rng(0).standard_normal((200, N_DRAWS)))
    headings = motion.pose[:, 2]
    assert ((headings > -np.pi) & (headings <= np.pi)).all()
    assert (headings < 0).any()


def test_a_robot_that_starts_anew_has_an_error_of_its_own_from_the_first_reading_on() -> None:
    motion, rng = Motion.at_rest(2), np.random.default_rng(1)
    sensors = SensorParameters.of(PoseSensorConfig(), OdometryConfig(), BatteryConfig(), 0.1)
    sense(motion, sensors, rng.standard_normal((2, N_DRAWS)))
    before = motion.pose.copy()
    sense(motion, sensors, rng.standard_normal((2, N_DRAWS)), is_reset=np.array([False, True]))
    assert np.abs(motion.pose - before)[0, 0] < 0.03
    assert np.abs(motion.pose - before)[1, 0] > 0.03
