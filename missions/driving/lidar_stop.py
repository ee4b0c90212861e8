"""Speed at which the robot can still stop before an obstacle that its lidar measures."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from dirmusic.angles import unit_vector
from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.sensors import LIDAR_BEAMS

SIDE_M = 0.04
"""Clearance to the side. Assumed; two standard deviations of the lidar noise, small enough for all passages of the
map."""

STOP_M = 0.06
"""Clearance ahead. Assumed; three standard deviations of the lidar noise, or a corner between two beams."""

DEFLECTIONS_RADPS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9)
"""Changes of the yaw rate that are tried when the commanded arc is blocked. Assumed."""

BEAM_RAD = 2.0 * np.pi * np.arange(LIDAR_BEAMS) / LIDAR_BEAMS
"""Directions of the beams in the robot's frame: the first ahead, the next counter-clockwise."""

_BEAMS = unit_vector(BEAM_RAD)


def lookahead_m(robot: RobotDescription) -> FloatArray:
    """Return the distances along the arc that are checked: twice the stopping distance at full speed, at least 0.6 m.

    They are 2 cm apart. Both lengths are assumed.
    """
    stopping_m = robot.max_speed_mps * STEP_S + robot.max_speed_mps**2 / (2.0 * robot.max_acceleration_mps2)
    n_places = 1 + int(np.ceil(max(2.0 * stopping_m, 0.6) / 0.02))
    return 0.02 * np.arange(n_places, dtype=np.float64)


def free_distance(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float, robot: RobotDescription) -> float:
    r"""Return how far the robot can drive on its arc before its circular outline meets a point that a beam measured.

    A point blocks the arc only where the outline covers it and the robot has come nearer to it, so that driving away
    from a close obstacle is always possible. On an arc of curvature :math:`\kappa`, the position after a distance s is

    .. math:: (x, y) = (\sin \kappa s, 1 - \cos \kappa s) / \kappa

    Args:
        lidar_m: Ranges from the centre of the robot, shape (LIDAR_BEAMS,), metres. Objects between two beams are not
            seen; beams are 7 cm apart at the distance where the robot has to start braking.
        v_mps: Forward speed; negative backwards.
        yaw_rate_radps: Yaw rate, counter-clockwise.
        robot: The robot.

    Returns:
        Distance along the arc, metres, at most the last value of `lookahead_m`.
    """
    arc_m, kept_m = lookahead_m(robot), robot.footprint_radius_m + SIDE_M
    if lidar_m.min() > arc_m[-1] + kept_m:
        return float(arc_m[-1])
    half_turn = 0.5 * arc_m * yaw_rate_radps / max(abs(v_mps), 1e-6)
    chord_m = np.copysign(arc_m, v_mps) * np.sinc(half_turn / np.pi)
    distance_m = cdist(chord_m[:, np.newaxis] * unit_vector(half_turn), lidar_m[:, np.newaxis] * _BEAMS)
    is_blocked = (distance_m < kept_m) & (distance_m < distance_m[0])
    return float(arc_m[is_blocked.any(axis=-1).argmax() - 1])  # the last if none is blocked


def safe_speed(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float, robot: RobotDescription) -> float:
    r"""Limit the commanded speed so that the robot can stop in time.

    One step of latency at speed v, then the motors' deceleration a, must end within the free distance s:

    .. math:: v T + v^2 / 2a = s

    Args:
        lidar_m: As in `free_distance`.
        v_mps: Commanded forward speed.
        yaw_rate_radps: Commanded yaw rate; it is not limited, because turning on the spot covers no new ground.
        robot: The robot.

    Returns:
        Forward speed, m/s, of the same sign.
    """
    free_m = max(free_distance(lidar_m, v_mps, yaw_rate_radps, robot) - STOP_M, 0.0)
    slowing = robot.max_acceleration_mps2 * STEP_S
    limit = np.sqrt(slowing**2 + 2.0 * robot.max_acceleration_mps2 * free_m) - slowing
    return float(np.clip(v_mps, -limit, limit))


def safe_command(
    lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float, robot: RobotDescription
) -> tuple[float, float]:
    """Return the commanded speed and yaw rate if they are safe, else a safe speed at the yaw rate that allows the most.

    A slightly different arc is often free, so the robot stays clear of the walls of a passage despite its pose error.
    """
    if safe_speed(lidar_m, v_mps, yaw_rate_radps, robot) == v_mps:
        return v_mps, yaw_rate_radps
    arcs = [(safe_speed(lidar_m, v_mps, yaw_rate_radps + by, robot), by) for by in DEFLECTIONS_RADPS]
    speed_mps, by = max(arcs, key=lambda arc: abs(arc[0]) - 0.1 * abs(arc[1]))  # 1 rad/s costs 0.1 m/s (assumed)
    return speed_mps, yaw_rate_radps + by
