"""Simulation of the pose sensor, odometry and battery of the robots, and of the progress of their tasks."""

import numpy as np

from dirmusic.angles import wrapped
from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.envs.robot_states import Parameters, RobotStates
from pdpatrol.robot_models.readings import LEAST_UPRIGHT, MOTOR_POWER, POSE, UPRIGHT, VELOCITY, WHEEL_ANGLES

MAX_BEARING_AGE_S = 60.0
"""Upper bound of the observed age of the last bearing. Assumed; an older bearing is of little use to a moving robot."""

STANDING_MPS = 0.05
"""Speed below which a robot at its dock is charged. Assumed; less than that of any drive."""


@compiled
def add_pose_error(
    true_pose: FloatArray, error: FloatArray, correlation: float, std: FloatArray, normal: FloatArray, pose: FloatArray
) -> None:
    """Add a first-order Gauss-Markov error to a pose; all arrays have shape (3,).

    Args:
        true_pose: x m, y m, yaw rad; may be the same array as `pose`.
        error: Error of the previous reading, NaN before the first reading; replaced by the error of this reading.
        correlation: Correlation between the errors of consecutive readings.
        std: Standard deviations of the error.
        normal: Standard normal draws, at least three.
        pose: Receives the pose with the error, yaw in (-pi, pi].
    """
    innovation = np.sqrt(1.0 - correlation * correlation)
    for i in range(3):
        if np.isnan(error[i]):
            error[i] = std[i] * normal[i]
        else:
            error[i] = correlation * error[i] + innovation * std[i] * normal[i]
        pose[i] = true_pose[i] + error[i]
    pose[2] = wrapped(pose[2])


@compiled
def start_motion(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Initialise the sensors of robot `r` at the start of an episode; arguments as in `sense_motion`."""
    state.pose_error[r] = np.nan
    state.n_steps[r], state.time_s[r], state.battery[r], state.lost_until_s[r] = 0.0, 0.0, 1.0, 0.0
    sense_pose(state, parameters, reading, r)
    for k in range(3):
        state.odometry[r, k] = state.believed_pose[r, k]


@compiled
def sense_motion(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Update the sensors of robot `r` after a step.

    Args:
        state: State of all robots; updated.
        parameters: Parameters of the sensors and the battery.
        reading: Row of the robot in `pdpatrol.robot_models.readings.Readings.values`.
        r: Row of the robot.
    """
    step_s, wheels_rad, odometry = parameters.step_s, reading[WHEEL_ANGLES], state.odometry[r]
    turned_rad = wheels_rad[0] - state.wheels_rad[r, 0] + wheels_rad[1] - state.wheels_rad[r, 1]
    drift_rad = state.gyro_bias_radps[r] * step_s + parameters.gyro_noise_rad * state.motion_normal[r, 3]
    turn_rad = wrapped(reading[POSE][2] - state.true_pose[r, 2]) + drift_rad
    path_m, along = 0.5 * turned_rad * state.metres_per_radian[r], odometry[2] + 0.5 * turn_rad
    odometry[0] += path_m * np.cos(along)
    odometry[1] += path_m * np.sin(along)
    odometry[2] = wrapped(odometry[2] + turn_rad)
    state.n_steps[r] += 1
    state.time_s[r] = state.n_steps[r] * step_s
    use_battery(state, parameters, reading, r)
    events, believed = state.pose_events[r], state.believed_pose[r]
    if events[0] < parameters.jump_probability:
        for k in range(3):
            state.pose_error[r, k] += parameters.jump_std[k] * events[2 + k]
    if events[1] < parameters.dropout_probability and state.time_s[r] >= state.lost_until_s[r]:
        state.lost_until_s[r] = state.time_s[r] + parameters.dropout_s - 1e-9
    x, y, yaw = believed[0], believed[1], believed[2]
    sense_pose(state, parameters, reading, r)
    if state.time_s[r] < state.lost_until_s[r]:
        believed[0] = x + path_m * np.cos(yaw + 0.5 * turn_rad)
        believed[1] = y + path_m * np.sin(yaw + 0.5 * turn_rad)
        believed[2] = wrapped(yaw + turn_rad)


@compiled_inner
def use_battery(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Discharge the battery of robot `r` for one step, or charge it if the robot stands at its dock."""
    dock_m, speed_mps = parameters.stops_m[len(parameters.stops_m) - 1], abs(reading[VELOCITY][0])
    from_dock_m = np.hypot(dock_m[0] - reading[POSE][0], dock_m[1] - reading[POSE][1])
    power_w = -parameters.idle_w - parameters.drive_j_per_m * speed_mps - reading[MOTOR_POWER]
    if from_dock_m <= parameters.stop_radius_m and speed_mps < STANDING_MPS:
        power_w = parameters.charge_w
    charge = state.battery[r] + power_w * (parameters.step_s / 3600.0) / parameters.capacity_wh
    state.battery[r] = min(max(charge, 0.0), 1.0)


@compiled_inner
def sense_pose(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Read the pose sensor of robot `r`, and store its true pose and wheel angles."""
    pose, wheels_rad = reading[POSE], reading[WHEEL_ANGLES]
    for k in range(3):  # assigning the whole row would take 2 s to compile
        state.true_pose[r, k] = pose[k]
    for k in range(wheels_rad.size):
        state.wheels_rad[r, k] = wheels_rad[k]
    believed, frame, bias = state.believed_pose[r], parameters.frame, parameters.pose_bias
    dock_m = parameters.stops_m[len(parameters.stops_m) - 1]
    east_m, north_m, cos, sin = pose[0] - dock_m[0], pose[1] - dock_m[1], np.cos(frame[2]), np.sin(frame[2])
    yaw = pose[2] + frame[2]
    # Added to the true position, so that a frame without error changes no bit.
    believed[0] = pose[0] + (cos - 1.0) * east_m - sin * north_m + frame[0]
    believed[1] = pose[1] + (cos - 1.0) * north_m + sin * east_m + frame[1]
    believed[0] += bias[0] * np.cos(yaw) - bias[1] * np.sin(yaw)
    believed[1] += bias[0] * np.sin(yaw) + bias[1] * np.cos(yaw)
    believed[2] = yaw + bias[2]
    add_pose_error(
        believed, state.pose_error[r], parameters.pose_correlation, parameters.pose_std, state.motion_normal[r],
        believed,
    )  # fmt: skip


@compiled_inner
def nearest_distance(state: RobotStates, r: int, x: float, y: float) -> float:
    """Return the horizontal distance from (x, y) to the nearest source that robot `r` has not yet approached."""
    nearest_m, sources_m = np.inf, state.sources_m[r]
    for s in range(len(sources_m)):
        if not state.approached[r, s]:
            nearest_m = min(nearest_m, np.hypot(sources_m[s, 0] - x, sources_m[s, 1] - y))
    return 0.0 if np.isinf(nearest_m) else nearest_m


@compiled
def visit(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Mark the sources and waypoints that robot `r` has reached, and set the flags that end its episode."""
    x, y, sources_m, stops_m = reading[POSE][0], reading[POSE][1], state.sources_m[r], parameters.stops_m
    approached, visited, n_waypoints = state.approached[r], state.waypoints_visited[r], len(stops_m) - 1
    all_approached, route_done = len(sources_m) > 0, n_waypoints > 0
    for s in range(len(sources_m)):
        if np.hypot(sources_m[s, 0] - x, sources_m[s, 1] - y) <= parameters.standoff_m:
            approached[s] = True
        all_approached = all_approached and approached[s]
    for k in range(n_waypoints):
        away_m = np.hypot(stops_m[k, 0] - x, stops_m[k, 1] - y)
        visited[k] = visited[k] or away_m <= parameters.stop_radius_m
        route_done = route_done and visited[k]
    from_dock_m = np.hypot(stops_m[n_waypoints, 0] - x, stops_m[n_waypoints, 1] - y)
    is_done = route_done and from_dock_m <= parameters.stop_radius_m
    is_done = is_done or (parameters.terminate_on_approach and all_approached)
    state.success[r] = all_approached
    state.distance_m[r] = nearest_distance(state, r, x, y)
    state.fell_over[r] = reading[UPRIGHT] < LEAST_UPRIGHT
    state.terminated[r] = is_done or state.fell_over[r] or state.battery[r] == 0.0
    state.truncated[r] = state.n_steps[r] >= parameters.max_steps


@compiled_inner
def start_progress(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Initialise the progress of robot `r` at the start of an episode; arguments as in `advance_progress`."""
    state.approached[r], state.waypoints_visited[r] = False, False
    state.bearing[r], state.bearing_age_s[r] = 0.0, MAX_BEARING_AGE_S
    state.reward[r], state.reward_progress[r], state.reward_time[r], state.reward_contact[r] = 0.0, 0.0, 0.0, 0.0
    visit(state, parameters, reading, r)
    state.terminated[r] = state.fell_over[r]


@compiled_inner
def advance_progress(state: RobotStates, parameters: Parameters, reading: FloatArray, r: int) -> None:
    """Update progress, reward and termination of robot `r` after a step.

    Args:
        state: State of all robots; updated in place.
        parameters: Parameters that all robots share.
        reading: Row of the robot in `pdpatrol.robot_models.readings.Readings`.
        r: Index of the robot.
    """
    nearer_m = state.distance_m[r] - nearest_distance(state, r, reading[POSE][0], reading[POSE][1])
    state.reward_progress[r] = parameters.reward_per_metre * nearer_m
    state.reward_time[r] = parameters.reward_per_second * parameters.step_s
    state.reward_contact[r] = parameters.reward_per_contact_step * state.touched[r]
    state.reward[r] = state.reward_progress[r] + state.reward_time[r] + state.reward_contact[r]
    state.bearing_age_s[r] = min(state.bearing_age_s[r] + parameters.step_s, MAX_BEARING_AGE_S)
    visit(state, parameters, reading, r)
