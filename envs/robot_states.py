"""State and parameters of the simulated robots, as arrays for the compiled functions of the environments."""

import math
from typing import Any, NamedTuple, Self, get_type_hints

import numpy as np
from numpy.typing import NDArray

from dirmusic.arrays import BoolArray, FloatArray
from dirmusic.compiled import Held
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.robot_models.sensors import LIDAR_BEAMS

N_DRAWS = 4
"""Number of standard normal draws per robot and step: x, y and yaw of the pose sensor, and the gyro."""

SPECTRUM_AZIMUTHS_RAD = np.radians(np.arange(0.0, 360.0, 5.0))
"""Azimuths at which the pseudo-spectrum is observed, array frame."""


class RobotStates(NamedTuple):
    """State of all robots, one row per robot. Compiled functions update the arrays in place.

    Attributes:
        n_steps: Number of steps since the start of the episode, shape (n_robots,).
        time_s: Time since the start of the episode, shape (n_robots,).
        true_pose: True pose, x m, y m, yaw in (-pi, pi], shape (n_robots, 3).
        believed_pose: Reading of the pose sensor, same units and shape.
        pose_error: Error of that reading, NaN before the first reading, same units and shape.
        lost_until_s: Time at which the last dropout of the pose sensor ends, shape (n_robots,).
        odometry: Pose estimated from wheels and gyro alone, same units and shape.
        wheels_rad: Angles of the left and right wheels, shape (n_robots, 2).
        metres_per_radian: Wheel radius that the odometry assumes, m per rad, shape (n_robots,).
        gyro_bias_radps: Bias of the gyro, shape (n_robots,).
        battery: State of charge, in [0, 1], shape (n_robots,).
        sources_m: True positions of the sources, world frame, shape (n_robots, n_sources, 2).
        approached: True for sources that the robot has approached, shape (n_robots, n_sources).
        waypoints_visited: True for visited waypoints, shape (n_robots, n_waypoints).
        distance_m: Distance to the nearest source not yet approached, 0 if all are approached, shape (n_robots,).
        success: True if the robot has approached every source, False without sources, shape (n_robots,).
        touched: True if the robot touched anything but the floor in the last step, shape (n_robots,).
        fell_over: True if the robot leans too far to recover, shape (n_robots,).
        terminated: True if the task is done, the robot has fallen over, or its battery is empty, shape (n_robots,).
        truncated: True if the time limit is reached, shape (n_robots,).
        reward: Reward of the last step, shape (n_robots,).
        reward_progress: Reward term for progress, shape (n_robots,).
        reward_time: Reward term for time, shape (n_robots,).
        reward_contact: Reward term for contacts, shape (n_robots,).
        bearing: Cos and sin of the last bearing, world frame, zeros before the first, shape (n_robots, 2).
        bearing_age_s: Time since the last bearing, shape (n_robots,).
        motion_normal: Standard normal draws for the motion sensors, shape (n_robots, N_DRAWS).
        pose_events: Draws for jumps and dropouts of the pose sensor: two uniform ones, and three standard normal ones
            for the size of a jump, shape (n_robots, 5); 0 without jumps and dropouts.
        lidar_normal: Standard normal draws for the lidar, shape (n_robots, n_beams).
        is_usable: True for channels that have not been found faulty, shape (n_robots, n_elements).
        spectrum_gain: Gains of the usable channels towards `SPECTRUM_AZIMUTHS_RAD`, scaled to unit norm, shape
            (n_robots, n_elements, n_azimuths).
    """

    n_steps: FloatArray
    time_s: FloatArray
    true_pose: FloatArray
    believed_pose: FloatArray
    pose_error: FloatArray
    lost_until_s: FloatArray
    odometry: FloatArray
    wheels_rad: FloatArray
    metres_per_radian: FloatArray
    gyro_bias_radps: FloatArray
    battery: FloatArray
    sources_m: FloatArray
    approached: BoolArray
    waypoints_visited: BoolArray
    distance_m: FloatArray
    success: BoolArray
    touched: BoolArray
    fell_over: BoolArray
    terminated: BoolArray
    truncated: BoolArray
    reward: FloatArray
    reward_progress: FloatArray
    reward_time: FloatArray
    reward_contact: FloatArray
    bearing: FloatArray
    bearing_age_s: FloatArray
    motion_normal: FloatArray
    pose_events: FloatArray
    lidar_normal: FloatArray
    is_usable: BoolArray
    spectrum_gain: FloatArray

    @classmethod
    def zeros(cls, n_robots: int, scenario: Scenario) -> Self:
        """Create all-zero states, for robots whose episodes have not started."""
        n_sources, n_elements = len(scenario.sources), scenario.array.n_channels
        shapes = {
            "true_pose": (3,),
            "believed_pose": (3,),
            "pose_error": (3,),
            "odometry": (3,),
            "wheels_rad": (2,),
            "sources_m": (n_sources, 2),
            "approached": (n_sources,),
            "waypoints_visited": (len(scenario.route.stops_m),),
            "bearing": (2,),
            "motion_normal": (N_DRAWS,),
            "pose_events": (5,),
            "lidar_normal": (LIDAR_BEAMS,),
            "is_usable": (n_elements,),
            "spectrum_gain": (n_elements, SPECTRUM_AZIMUTHS_RAD.size),
        }
        arrays: list[Any] = [
            np.zeros((n_robots, *shapes.get(field, ())), np.bool_ if kind == BoolArray else np.float64)
            for field, kind in get_type_hints(cls).items()
        ]
        return cls(*arrays)


class Parameters(NamedTuple):
    """Parameters that all robots share.

    Attributes:
        step_s: Duration of a step.
        max_steps: Number of steps after which an episode is truncated.
        pose_std: True standard deviations of the pose sensor's error in x, y and yaw, shape (3,).
        pose_correlation: Correlation between the pose sensor's errors in successive steps.
        jump_std: Standard deviations by which the pose sensor's error jumps, in x, y and yaw, shape (3,).
        jump_probability: Probability of a jump in a step.
        dropout_probability: Probability that a dropout of the pose sensor begins in a step.
        dropout_s: Duration of a dropout.
        pose_bias: Constant error of the pose sensor: forward m, left m, yaw rad, shape (3,).
        frame: Displacement and rotation of the localisation against the map, x m, y m, yaw rad, shape (3,).
        gyro_noise_rad: Standard deviation of the gyro noise per step.
        idle_w: True constant load of the battery.
        drive_j_per_m: True energy per metre against rolling resistance.
        charge_w: True power into the battery while the robot stands at the dock.
        capacity_wh: True capacity of the battery.
        stops_m: Positions of the waypoints, in order, and of the dock, shape (n_waypoints + 1, 2).
        standoff_m: Distance within which a source counts as approached.
        stop_radius_m: Distance within which a waypoint or the dock counts as reached.
        terminate_on_approach: Whether an episode ends once all sources are approached.
        reward_per_metre: Reward per metre of progress towards the nearest source not yet approached.
        reward_per_second: Reward per second.
        reward_per_contact_step: Reward of a step in contact with anything but the floor.
        lidar_std_m: Standard deviation of the lidar ranges.
        noise_v: Standard deviation of the receiver noise in one sample.
    """

    step_s: float
    max_steps: int
    pose_std: FloatArray
    pose_correlation: float
    jump_std: FloatArray
    jump_probability: float
    dropout_probability: float
    dropout_s: float
    pose_bias: FloatArray
    frame: FloatArray
    gyro_noise_rad: float
    idle_w: float
    drive_j_per_m: float
    charge_w: float
    capacity_wh: float
    stops_m: FloatArray
    standoff_m: float
    stop_radius_m: float
    terminate_on_approach: bool
    reward_per_metre: float
    reward_per_second: float
    reward_per_contact_step: float
    lidar_std_m: float
    noise_v: float

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        *,
        step_s: float = STEP_S,
        terminate_on_approach: bool = True,
        max_episode_steps: int | None = None,
    ) -> Self:
        """Derive the parameters from a scenario.

        Args:
            scenario: The scenario.
            step_s: Duration of a step.
            terminate_on_approach: Whether an episode ends once all sources are approached.
            max_episode_steps: Maximum number of steps of an episode, in addition to the scenario's time limit.
        """
        task, odometry, true_pose = scenario.task, scenario.odometry, scenario.nature.pose_sensor
        pose_sensor = true_pose.applied_to(scenario.pose_sensor)
        battery = scenario.nature.battery.applied_to(scenario.battery)
        return cls(
            step_s=step_s,
            max_steps=math.ceil(min(task.time_limit_s / step_s - 1e-6, max_episode_steps or math.inf)),
            pose_std=pose_sensor.std,
            pose_correlation=pose_sensor.correlation(step_s),
            jump_std=true_pose.jump_std,
            jump_probability=1.0 - math.exp(-true_pose.jumps_per_min / 60.0 * step_s),
            dropout_probability=1.0 - math.exp(-true_pose.dropouts_per_min / 60.0 * step_s),
            dropout_s=true_pose.dropout_s,
            pose_bias=true_pose.bias,
            frame=true_pose.frame,
            gyro_noise_rad=math.radians(odometry.gyro_noise_deg_per_sqrt_min) / 60.0**0.5 * step_s**0.5,
            idle_w=battery.idle_w,
            drive_j_per_m=battery.drive_j_per_m,
            charge_w=battery.charge_w,
            capacity_wh=battery.capacity_wh,
            stops_m=np.array([*scenario.route.stops_m, scenario.route.dock_m]),
            standoff_m=task.standoff_m,
            stop_radius_m=task.waypoint_radius_m,
            terminate_on_approach=terminate_on_approach,
            reward_per_metre=task.reward_per_metre,
            reward_per_second=task.reward_per_second,
            reward_per_contact_step=task.reward_per_contact_step,
            lidar_std_m=scenario.lidar.range_std_m,
            noise_v=scenario.receiver.noise_v,
        )


HeldRobots = Held[tuple[RobotStates, Parameters, tuple[NDArray[np.float32], NDArray[np.float32]]]]
"""Argument of the compiled functions: states, parameters, and lower and upper bounds of the observation vectors."""
