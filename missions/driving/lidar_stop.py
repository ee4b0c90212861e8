"""How fast the robot may drive so that it can stop before what the lidar sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from envs.patrol_env import STEP_S
from robot_models.robots import CHASSIS_RADIUS_M, LIDAR_BEAMS, MAX_ACCELERATION_MPS2

FloatArray = NDArray[np.float64]

SIDE_M = 0.04
"""Room that is kept to the side (assumed): two deviations of the lidar's noise, and a gap the map allows stays one."""

STOP_M = 0.06
"""Room that is kept ahead (assumed): three deviations of the lidar's noise, or a corner between two beams."""

DEFLECTIONS_RADPS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9)
DEFLECTION_COST_M = 0.1
"""By how much the robot turns off its wish where that is blocked (assumed), and what speed that has to gain it."""

_SPACING_M = 0.02
_ARC_M = _SPACING_M * np.arange(31)
"""Places along the way that are looked at: twice as far as the robot needs to stop from full speed."""

_BEAM_RAD = 2.0 * np.pi * np.arange(LIDAR_BEAMS) / LIDAR_BEAMS
_BEAMS = np.stack([np.cos(_BEAM_RAD), np.sin(_BEAM_RAD)], axis=-1)


def free_way(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float) -> float:
    r"""How far the robot gets on its arc before its outline meets what a beam met.

    A point is in the way where the outline comes over it and nearer to it than now: driving off from something close
    is always free. On an arc of curvature :math:`\kappa`, the place after a way s is

    .. math:: (x, y) = (\sin \kappa s, 1 - \cos \kappa s) / \kappa

    Args:
        lidar_m: Ranges from the middle of the robot, shape (LIDAR_BEAMS,), metres; the first beam ahead, the next
            counter-clockwise. What lies between two beams is not seen: 7 cm where the robot has to start braking.
        v_mps: Forward speed; its sign tells the direction.
        yaw_rate_radps: Counter-clockwise.

    Returns:
        Metres, at most 0.6: as far as is looked.
    """
    near = lidar_m < _ARC_M[-1] + CHASSIS_RADIUS_M + SIDE_M
    points = _BEAMS[near] * lidar_m[near, np.newaxis]
    way = np.copysign(_ARC_M, v_mps)
    half_turn = 0.5 * way * yaw_rate_radps / np.copysign(max(abs(v_mps), 1e-6), v_mps)
    chord = way * np.sinc(half_turn / np.pi)
    places = np.stack([chord * np.cos(half_turn), chord * np.sin(half_turn)], axis=-1)
    distance = np.linalg.norm(points - places[:, np.newaxis], axis=-1)
    meets = ((distance < CHASSIS_RADIUS_M + SIDE_M) & (distance < distance[0])).any(axis=-1)
    return float(_ARC_M[int(meets.argmax()) - 1] if meets.any() else _ARC_M[-1])


def safe_speed(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float) -> float:
    r"""The commanded speed, or as much of it as lets the robot stop in time.

    One step of latency at speed v, then the motors' deceleration a, must end within the free way s:

    .. math:: v T + v^2 / 2a = s

    Args:
        lidar_m: As in `free_way`.
        v_mps: Commanded forward speed.
        yaw_rate_radps: Commanded; it is not limited, turning on the spot sweeps no new ground.

    Returns:
        Forward speed, m/s, of the same sign.
    """
    room_m = max(free_way(lidar_m, v_mps, yaw_rate_radps) - STOP_M, 0.0)
    slowing = MAX_ACCELERATION_MPS2 * STEP_S
    limit = np.sqrt(slowing**2 + 2.0 * MAX_ACCELERATION_MPS2 * room_m) - slowing
    return float(np.copysign(min(abs(v_mps), limit), v_mps))


def safe_command(lidar_m: NDArray[np.floating], v_mps: float, yaw_rate_radps: float) -> tuple[float, float]:
    """The commanded speed and yaw rate where they are safe, else a safe speed and the yaw rate that allows the most.

    A little to the side is often free: so the robot keeps off the walls of a passage though its pose is off.
    """
    turns = [yaw_rate_radps + off for off in DEFLECTIONS_RADPS]
    speeds = [safe_speed(lidar_m, v_mps, turns[0])]
    if speeds[0] != v_mps:
        speeds += [safe_speed(lidar_m, v_mps, turn) for turn in turns[1:]]
    worth = [abs(v) - DEFLECTION_COST_M * abs(off) for v, off in zip(speeds, DEFLECTIONS_RADPS, strict=False)]
    best = int(np.argmax(worth))
    return speeds[best], turns[best]
