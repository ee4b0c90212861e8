"""How fast the robot may drive so that it can stop before what the lidar sees."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pdpatrol.envs.patrol_env import STEP_S
from pdpatrol.robot_models.description.robot_description import RobotDescription
from pdpatrol.robot_models.sensors import LIDAR_BEAMS

FloatArray = NDArray[np.float64]

SIDE_M = 0.04
"""Room that is kept to the side (assumed): two deviations of the lidar's noise, and a gap the map allows stays one."""

STOP_M = 0.06
"""Room that is kept ahead (assumed): three deviations of the lidar's noise, or a corner between two beams."""

DEFLECTIONS_RADPS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9)
DEFLECTION_COST_M = 0.1
"""By how much the robot turns off its wish where that is blocked (assumed), and what speed that has to gain it."""

SPACING_M = 0.02
LEAST_WAY_M = 0.6
"""Spacing of the places along the way that are looked at, and how far at least (assumed)."""

_BEAM_RAD = 2.0 * np.pi * np.arange(LIDAR_BEAMS) / LIDAR_BEAMS
_BEAMS = np.stack([np.cos(_BEAM_RAD), np.sin(_BEAM_RAD)], axis=-1)


@lru_cache(maxsize=8)
def way_m(robot: RobotDescription) -> FloatArray:
    """Places along the way that are looked at, metres: twice as far as the robot needs to stop from full speed."""
    stops_in_m = robot.max_speed_mps * STEP_S + robot.max_speed_mps**2 / (2.0 * robot.max_acceleration_mps2)
    n_places = 1 + int(np.ceil(max(2.0 * stops_in_m, LEAST_WAY_M) / SPACING_M))
    return SPACING_M * np.arange(n_places, dtype=np.float64)


def free_way(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float, robot: RobotDescription) -> float:
    r"""How far the robot gets on its arc before its outline, taken as a circle, meets what a beam met.

    A point is in the way where the outline comes over it and nearer to it than now: driving off from something close
    is always free. On an arc of curvature :math:`\kappa`, the place after a way s is

    .. math:: (x, y) = (\sin \kappa s, 1 - \cos \kappa s) / \kappa

    Args:
        lidar_m: Ranges from the middle of the robot, shape (LIDAR_BEAMS,), metres; the first beam ahead, the next
            counter-clockwise. What lies between two beams is not seen: 7 cm where the robot has to start braking.
        v_mps: Forward speed; its sign tells the direction.
        yaw_rate_radps: Counter-clockwise.
        robot: Whose way it is.

    Returns:
        Metres, at most as far as is looked.
    """
    arc_m, kept_m = way_m(robot), robot.footprint_radius_m + SIDE_M
    near = lidar_m < arc_m[-1] + robot.footprint_radius_m + SIDE_M
    if not near.any():
        return float(arc_m[-1])
    points = _BEAMS[near] * lidar_m[near, np.newaxis]
    way = np.copysign(arc_m, v_mps)
    half_turn = 0.5 * way * yaw_rate_radps / np.copysign(max(abs(v_mps), 1e-6), v_mps)
    chord = way * np.sinc(half_turn / np.pi)
    places = np.stack([chord * np.cos(half_turn), chord * np.sin(half_turn)], axis=-1)
    distance = np.linalg.norm(points - places[:, np.newaxis], axis=-1)
    meets = ((distance < kept_m) & (distance < distance[0])).any(axis=-1)
    return float(arc_m[int(meets.argmax()) - 1] if meets.any() else arc_m[-1])


def safe_speed(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float, robot: RobotDescription) -> float:
    r"""The commanded speed, or as much of it as lets the robot stop in time.

    One step of latency at speed v, then the motors' deceleration a, must end within the free way s:

    .. math:: v T + v^2 / 2a = s

    Args:
        lidar_m: As in `free_way`.
        v_mps: Commanded forward speed.
        yaw_rate_radps: Commanded; it is not limited, turning on the spot sweeps no new ground.
        robot: Whose way it is.

    Returns:
        Forward speed, m/s, of the same sign.
    """
    room_m = max(free_way(lidar_m, v_mps, yaw_rate_radps, robot) - STOP_M, 0.0)
    slowing = robot.max_acceleration_mps2 * STEP_S
    limit = np.sqrt(slowing**2 + 2.0 * robot.max_acceleration_mps2 * room_m) - slowing
    return float(np.copysign(min(abs(v_mps), limit), v_mps))


def safe_command(
    lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float, robot: RobotDescription
) -> tuple[float, float]:
    """The commanded speed and yaw rate where they are safe, else a safe speed and the yaw rate that allows the most.

    A little to the side is often free: so the robot keeps off the walls of a passage though its pose is off.
    """
    turns = [yaw_rate_radps + off for off in DEFLECTIONS_RADPS]
    speeds = [safe_speed(lidar_m, v_mps, turns[0], robot)]
    if speeds[0] != v_mps:
        speeds += [safe_speed(lidar_m, v_mps, turn, robot) for turn in turns[1:]]
    worth = [abs(v) - DEFLECTION_COST_M * abs(off) for v, off in zip(speeds, DEFLECTIONS_RADPS, strict=False)]
    best = int(np.argmax(worth))
    return speeds[best], turns[best]
