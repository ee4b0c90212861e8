"""Task progress of an episode: approached sources, visited waypoints, reward and termination."""

import numpy as np

from dirmusic.arrays import FloatArray
from dirmusic.compiled import compiled, compiled_inner
from pdpatrol.envs.robot_states import Parameters, RobotStates
from pdpatrol.robot_models.readings import LEAST_UPRIGHT, POSE, UPRIGHT

MAX_BEARING_AGE_S = 60.0
"""Upper bound of the observed age of the last bearing. Assumed; an older bearing is of little use to a moving robot."""


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
    state.terminated[r] = is_done or state.fell_over[r]
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
