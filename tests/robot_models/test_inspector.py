"""Laws of the inspector: how it drives, what it touches, what it sees."""
# pyright: reportAttributeAccessIssue=false

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

import robot_models
from robot_models import inspector as robot
from robot_models.robots import Robots
from robot_models.yard.pieces import BoxEquipment, CylinderEquipment
from robot_models.yard.yard import Yard

FOLDER = Path(robot_models.__file__).parent / "inspector"
SCENE = FOLDER / "scene.xml"
AZIMUTHS_RAD = np.radians([90.0, 30.0, -30.0, -90.0, -150.0, 150.0])
RING_M = np.column_stack([0.12 * np.cos(AZIMUTHS_RAD), 0.12 * np.sin(AZIMUTHS_RAD), np.full(6, 0.6)])
TANK = BoxEquipment(
    name="tank", kind="power_transformer", position_m=(20.0, 10.0), footprint_m=(2.0, 4.0), height_m=3.0, shape="box"
)
BUSHING = CylinderEquipment(
    name="bushing", kind="bushing", position_m=(10.0, 20.0), radius_m=0.3, height_m=2.5, shape="cylinder"
)


YARD = Yard(size_m=(30.0, 30.0), equipment=(TANK, BUSHING))


class Inspector:
    """One robot alone."""

    def __init__(self) -> None:
        self.robots = Robots(YARD, RING_M, AZIMUTHS_RAD)
        self.model = self.robots.model

    @property
    def data(self) -> mujoco.MjData:
        return self.robots.data()

    @property
    def time_s(self) -> float:
        return self.data.time

    def reset(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        self.robots.reset([0], [(x_m, y_m, yaw_rad)])

    def drive(self, v_mps: float, yaw_rate_radps: float, duration_s: float) -> None:
        self.robots.drive([v_mps], [yaw_rate_radps], duration_s)

    def pose(self) -> np.ndarray:
        return self.robots.readings.pose[0]

    def velocity(self) -> np.ndarray:
        return self.robots.readings.velocity[0]

    def world_from_base(self) -> np.ndarray:
        return self.robots.readings.world_from_base[0]

    def touched(self) -> tuple[str, ...]:
        return self.robots.touched[0]


@pytest.fixture
def inspector() -> Inspector:
    inspector = Inspector()
    inspector.reset(10.0, 10.0, 0.0)
    return inspector


def n_warnings(data: mujoco.MjData) -> int:
    return sum(warning.number for warning in data.warning)


def wheel_loads_n(inspector: Inspector) -> np.ndarray:
    """Normal force of the floor on the left and the right wheel."""
    model, data, loads, force = inspector.model, inspector.data, np.zeros(2), np.zeros(6)
    mujoco.mj_forward(model, data)  # solves the contacts as they are now
    for index, geoms in enumerate(data.contact.geom.tolist()):
        for side, name in enumerate(("left_wheel", "right_wheel")):
            if model.geom(name).id in geoms:
                mujoco.mj_contactForce(model, data, index, force)
                loads[side] += force[0]
    return loads


@pytest.mark.parametrize("file", ["inspector.xml", "scene.xml"])
def test_each_file_compiles_and_runs_for_a_second_without_a_warning(file: str):
    model = mujoco.MjModel.from_xml_path(str(FOLDER / file))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_step(model, data, round(1.0 / model.opt.timestep))
    assert n_warnings(data) == 0
    assert np.isfinite(data.qpos).all()
    assert data.time == pytest.approx(1.0)


def test_twenty_seconds_of_random_driving_give_no_warning_and_no_nan(inspector: Inspector):
    rng = np.random.default_rng(7)
    for v, yaw_rate in rng.uniform([-0.8, -1.5], [0.8, 1.5], size=(200, 2)).tolist():
        inspector.drive(v, yaw_rate, 0.1)
        assert np.isfinite(np.concatenate([inspector.pose(), inspector.velocity()])).all()
    assert inspector.robots.n_warnings().tolist() == [0]
    assert inspector.time_s == pytest.approx(20.0)


def test_the_robot_reaches_the_commanded_speed_and_yaw_rate_within_one_percent(inspector: Inspector):
    limits = np.array([robot.MAX_SPEED_MPS, robot.MAX_YAW_RATE_RADPS])
    for command in np.random.default_rng(3).uniform(-limits, limits, size=(200, 2)):
        v, yaw_rate = command.tolist()
        inspector.reset(15.0, 25.0, 0.0)
        inspector.drive(v, yaw_rate, 1.0)
        reached = []
        for _ in range(20):
            inspector.drive(v, yaw_rate, 0.05)
            reached.append(inspector.velocity())
        tolerance = 0.01 * np.maximum(np.abs(command), 0.1 * limits)
        assert np.all(np.abs(np.mean(reached, axis=0) - command) < tolerance), command


def test_the_change_of_pose_is_the_integral_of_the_velocity(inspector: Inspector):
    inspector.reset(10.0, 10.0, 0.5)
    inspector.drive(0.5, 0.0, 1.0)
    start = inspector.pose()
    inspector.drive(0.5, 0.0, 2.0)
    expected = start + np.array([math.cos(0.5), math.sin(0.5), 0.0])
    np.testing.assert_allclose(inspector.pose(), expected, atol=2e-3)


def test_a_positive_yaw_rate_turns_counter_clockwise(inspector: Inspector):
    inspector.drive(0.0, 1.0, 1.0)
    assert inspector.pose()[2] == pytest.approx(1.0, abs=0.06)


def test_commands_beyond_the_limits_are_clipped(inspector: Inspector):
    inspector.drive(5.0, 0.0, 2.0)
    assert inspector.velocity()[0] == pytest.approx(robot.MAX_SPEED_MPS, rel=0.01)
    inspector.drive(0.0, -9.0, 2.0)
    assert inspector.velocity()[1] == pytest.approx(-robot.MAX_YAW_RATE_RADPS, rel=0.01)


def test_the_speed_never_changes_faster_than_the_acceleration_limit(inspector: Inspector):
    for command in (0.8, -0.8):
        for _ in range(20):
            before = inspector.velocity()[0]
            inspector.drive(command, 0.0, 0.05)
            change = abs(inspector.velocity()[0] - before)
            assert change <= 1.1 * robot.MAX_ACCELERATION_MPS2 * 0.05


def test_the_wheels_stay_on_the_floor_when_accelerating_and_braking_hard(inspector: Inspector):
    weight_n = inspector.model.body_subtreemass[0] * 9.81
    for command in [(0.8, 0.0), (-0.8, 0.0), (0.8, 1.5), (-0.8, -1.5), (0.0, 0.0)]:
        for _ in range(100):
            inspector.drive(*command, inspector.robots.step_s)
            assert wheel_loads_n(inspector).min() > 0.2 * weight_n


def test_at_rest_the_casters_carry_little_of_the_weight(inspector: Inspector):
    inspector.drive(0.0, 0.0, 1.0)
    weight_n = inspector.model.body_subtreemass[0] * 9.81
    assert wheel_loads_n(inspector).sum() > 0.9 * weight_n


@pytest.mark.parametrize("pose", [(3.0, 4.0, 0.0), (12.0, 2.0, 2.5), (5.0, 25.0, -3.0), (8.0, 8.0, math.pi)])
def test_reset_stands_the_robot_at_the_pose_where_it_stays_at_rest(
    inspector: Inspector, pose: tuple[float, float, float]
):
    inspector.drive(0.8, 1.0, 0.5)
    inspector.reset(*pose)
    np.testing.assert_allclose(inspector.pose(), pose, atol=1e-12)
    assert inspector.time_s == 0.0
    assert not inspector.velocity().any()
    inspector.drive(0.0, 0.0, 1.0)
    np.testing.assert_allclose(inspector.pose(), pose, atol=1e-5)
    assert inspector.data.qpos[2] == pytest.approx(0.0, abs=1e-4)


def test_the_home_keyframe_is_where_the_robot_comes_to_rest_by_itself(inspector: Inspector):
    home = inspector.data.qpos.copy()
    inspector.drive(0.0, 0.0, 2.0)
    np.testing.assert_allclose(inspector.data.qpos, home, atol=1e-6)


def test_yaw_lies_above_minus_pi_and_up_to_pi(inspector: Inspector):
    inspector.reset(10.0, 10.0, -math.pi)
    assert inspector.pose()[2] == pytest.approx(math.pi)
    inspector.reset(10.0, 10.0, 5.0)
    assert inspector.pose()[2] == pytest.approx(5.0 - 2.0 * math.pi)


def test_standing_and_driving_on_the_floor_touches_nothing(inspector: Inspector):
    assert inspector.touched() == ()
    inspector.drive(0.8, 1.0, 2.0)
    assert inspector.touched() == ()


def test_contact_is_reported_by_name(inspector: Inspector):
    inspector.reset(18.5, 10.0, 0.0)
    inspector.drive(0.8, 0.0, 1.0)
    assert inspector.touched() == ("equipment/tank",)
    assert inspector.pose()[0] == pytest.approx(19.0 - robot.CHASSIS_RADIUS_M, abs=0.01)


def test_what_is_touched_together_is_reported_sorted(inspector: Inspector):
    inspector.reset(0.5, 0.5, 1.25 * math.pi)
    inspector.drive(0.8, 0.0, 2.0)
    assert inspector.touched() == ("fence/south", "fence/west")


def test_contact_is_forgotten_in_the_next_interval_without_it(inspector: Inspector):
    inspector.reset(18.5, 10.0, 0.0)
    inspector.drive(0.8, 0.0, 1.0)
    inspector.drive(-0.8, 0.0, 1.0)
    inspector.drive(-0.8, 0.0, 0.1)
    assert inspector.touched() == ()


def test_a_contact_in_the_middle_of_an_interval_is_not_missed(inspector: Inspector):
    inspector.reset(18.72, 10.0, 0.0)
    inspector.drive(0.8, 0.0, 0.2)
    assert inspector.touched() == ()  # on its way, 8 cm before the tank it cannot brake any more
    speed = inspector.velocity()[0]
    inspector.drive(-0.8, 0.0, 1.0)
    assert speed > 0.5
    assert inspector.pose()[0] < 18.7
    assert inspector.touched() == ("equipment/tank",)


def test_a_reset_into_equipment_is_reported(inspector: Inspector):
    inspector.reset(19.0, 10.0, 0.0)
    assert inspector.touched() == ("equipment/tank",)


def test_the_frame_of_the_base_is_where_the_robot_stands(inspector: Inspector):
    inspector.reset(5.0, 6.0, 0.4)
    frame = inspector.world_from_base()
    np.testing.assert_allclose(frame[:2, 3], [5.0, 6.0], atol=1e-9)
    np.testing.assert_allclose(frame[:2, 0], [np.cos(0.4), np.sin(0.4)], atol=1e-3)
    np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-12)


def test_the_same_commands_give_bit_identical_trajectories():
    def trajectory(inspector: Inspector) -> np.ndarray:
        inspector.reset(17.0, 9.0, 0.3)
        commands = np.random.default_rng(5).uniform([0.0, -1.5], [0.8, 1.5], size=(60, 2))
        states = []
        for v, yaw_rate in commands.tolist():
            inspector.drive(v, yaw_rate, 0.1)
            states.append(np.concatenate([inspector.data.qpos, inspector.data.qvel, inspector.data.sensordata]))
        return np.array(states)

    inspector = Inspector()
    first = trajectory(inspector)
    assert np.array_equal(first, trajectory(inspector))
    assert np.array_equal(first, trajectory(Inspector()))


def test_what_was_handed_out_does_not_change_afterwards(inspector: Inspector):
    pose, velocity = inspector.pose(), inspector.velocity()
    kept = pose.copy(), velocity.copy()
    inspector.drive(0.8, 0.5, 0.5)
    assert np.array_equal(pose, kept[0])
    assert np.array_equal(velocity, kept[1])


def test_what_is_touched_for_a_moment_between_two_looks_is_told_once():
    inspector = Inspector()
    inspector.reset(18.8002, 10.0, 0.0)  # touching the tank
    assert inspector.robots.touched == [("equipment/tank",)]
    inspector.drive(-0.8, 0.0, 0.1)
    assert inspector.robots.touched == [("equipment/tank",)]
    assert inspector.pose()[0] < 18.79
    inspector.drive(-0.8, 0.0, inspector.robots.step_s)
    assert inspector.robots.touched == [()]


def test_physics_without_looks_moves_as_the_whole_world_does(inspector: Inspector):
    whole, data = inspector.model, inspector.data
    assert whole.ngeom > inspector.robots.physics.ngeom + 40
    inspector.drive(0.7, 1.1, 0.5)
    data.ctrl[:] = inspector.data.ctrl
    mujoco.mj_step(whole, data, nstep=round(0.5 / inspector.robots.step_s))
    assert np.array_equal(data.qpos, inspector.data.qpos)
    assert np.array_equal(data.qvel, inspector.data.qvel)


def test_the_encoders_agree_with_the_distance_driven(inspector: Inspector):
    inspector.drive(0.6, 0.0, 5.0)
    inspector.drive(0.0, 0.0, 1.0)
    angles = [inspector.data.sensor(f"{side}_wheel_angle").data[0] for side in ("left", "right")]
    np.testing.assert_allclose(np.multiply(angles, robot.WHEEL_RADIUS_M), inspector.pose()[0] - 10.0, rtol=0.002)


def test_the_encoders_agree_with_the_angle_turned(inspector: Inspector):
    inspector.drive(0.0, 1.0, 2.5)
    inspector.drive(0.0, 0.0, 1.0)
    left, right = (inspector.data.sensor(f"{side}_wheel_angle").data[0] for side in ("left", "right"))
    turned = (right - left) * robot.WHEEL_RADIUS_M / robot.WHEEL_TRACK_M
    assert turned == pytest.approx(inspector.pose()[2], rel=0.005)


def test_the_gyro_measures_the_yaw_rate_and_the_accelerometer_gravity(inspector: Inspector):
    inspector.drive(0.0, 1.0, 1.0)
    inspector.drive(0.0, 1.0, inspector.robots.step_s)
    assert inspector.data.sensor("gyro").data[2] == pytest.approx(inspector.velocity()[1], rel=1e-4)
    assert inspector.data.sensor("accelerometer").data[2] == pytest.approx(9.81, rel=0.01)


def test_sensors_and_element_sites_belong_to_the_pose_that_is_told(inspector: Inspector):
    inspector.drive(0.8, 0.0, 1.0)
    sites = [inspector.data.site(f"element_{k}").xpos for k in range(1, 7)]
    np.testing.assert_allclose(np.mean(sites, axis=0)[:2], inspector.pose()[:2], atol=2e-3)


def test_the_constants_agree_with_the_xml():
    model = mujoco.MjModel.from_xml_path(str(SCENE))
    wheels = [model.geom("left_wheel"), model.geom("right_wheel")]
    assert model.geom("chassis").size[0] == robot.CHASSIS_RADIUS_M
    assert [wheel.size[0] for wheel in wheels] == [robot.WHEEL_RADIUS_M] * 2
    assert [model.body(f"{side}_wheel").pos[2] for side in ("left", "right")] == [robot.WHEEL_RADIUS_M] * 2
    track = model.body("left_wheel").pos[1] - model.body("right_wheel").pos[1]
    assert track == pytest.approx(robot.WHEEL_TRACK_M)
    fastest = (robot.MAX_SPEED_MPS + 0.5 * robot.WHEEL_TRACK_M * robot.MAX_YAW_RATE_RADPS) / robot.WHEEL_RADIUS_M
    assert model.actuator("left_wheel").ctrlrange[1] > fastest
    for side in ("left", "right"):
        slew_radps2 = model.actuator(f"{side}_wheel").dynprm[7]
        assert slew_radps2 == pytest.approx(robot.MAX_ACCELERATION_MPS2 / robot.WHEEL_RADIUS_M)


def test_no_geom_of_the_robot_can_touch_another():
    model = mujoco.MjModel.from_xml_path(str(FOLDER / "inspector.xml"))
    contype, conaffinity = model.geom_contype, model.geom_conaffinity
    assert not (contype[:, None] & conaffinity[None, :]).any()


def test_wheels_and_casters_lie_inside_the_outline_of_the_chassis():
    model = mujoco.MjModel.from_xml_path(str(FOLDER / "inspector.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name in ("left_wheel", "right_wheel", "front_caster", "rear_caster"):
        geom = model.geom(name)
        half_x, half_y = geom.size[0], geom.size[1] if "wheel" in name else geom.size[0]
        around = np.linspace(0.0, 2.0 * np.pi, 100)
        rim = data.geom(name).xpos[:2] + np.column_stack([half_x * np.cos(around), half_y * np.sin(around)])
        assert np.linalg.norm(rim, axis=1).max() < robot.CHASSIS_RADIUS_M


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((float("nan"), 0.0, 0.1), "`v_mps` and `yaw_rate_radps` must be finite"),
        ((0.1, float("inf"), 0.1), "`yaw_rate_radps` must be finite"),
        ((0.1, 0.0, 0.0), "positive multiple of the physics step"),
        ((0.1, 0.0, 0.0123), "positive multiple of the physics step"),
    ],
)
def test_a_command_that_cannot_be_driven_is_refused(
    inspector: Inspector, arguments: tuple[float, float, float], message: str
):
    with pytest.raises(ValueError, match=message):
        inspector.drive(*arguments)


def test_a_pose_that_is_not_finite_is_refused(inspector: Inspector):
    with pytest.raises(ValueError, match="`poses` must be finite"):
        inspector.reset(1.0, 1.0, float("nan"))
