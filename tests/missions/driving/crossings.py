"""Missions in which people cross the route of the robot."""

import numpy as np

from pdpatrol.envs import Scenario

SIZE_M = (24.0, 16.0)
DOCK_M, WAYPOINTS_M = (3.0, 3.0), ((20.0, 3.0), (20.0, 12.0), (4.0, 12.0))


def crossing_scenario(seed: int, n_people: int = 3) -> Scenario:
    """Draw a yard in which people walk to and fro across the legs of the route."""
    rng, stops_m = np.random.default_rng(seed), np.array([DOCK_M, *WAYPOINTS_M])
    moving = list[dict[str, object]]()
    for number in range(n_people):
        leg = number % 3
        along = stops_m[leg + 1] - stops_m[leg]
        across = np.array([-along[1], along[0]]) / np.hypot(*along)
        middle_m = stops_m[leg] + rng.uniform(0.3, 0.8) * along
        slant_m = rng.uniform(-1.0, 1.0) * along / np.hypot(*along)
        ends_m = np.clip(
            [middle_m - 4.0 * across - slant_m, middle_m + 4.0 * across + slant_m], 0.5, np.array(SIZE_M) - 0.5
        )
        walk = {"path_m": tuple(map(tuple, ends_m.tolist())), "speed_mps": rng.uniform(0.6, 1.5), "pause_s": (0.0, 8.0)}
        moving.append({"name": f"person_{number}", "kind": "person", **walk})
    return Scenario.model_validate(
        {
            "name": "crossings",
            "yard": {"size_m": SIZE_M, "equipment": (POST,)},
            "route": {"dock_m": DOCK_M, "waypoints_m": WAYPOINTS_M},
            "array": {},
            "task": {"time_limit_s": 300.0},
            "nature": {"moving": tuple(moving)},
        }
    )


POST = {
    "name": "cabinet",
    "kind": "cabinet",
    "shape": "box",
    "position_m": (1.2, 7.5),
    "footprint_m": (1.0, 1.0),
    "height_m": 2.0,
}
