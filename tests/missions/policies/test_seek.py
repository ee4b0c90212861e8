"""Duration of the pursuit of a candidate, and the distance from which it is viewed."""

import numpy as np
import pytest

from dirmusic.locating.finding import State
from pdpatrol.envs import load_scenario
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.seek import PATIENCE_S, UNDETECTED_S, Seek
from pdpatrol.missions.policies.viewpoints import MAX_ELEVATION_RAD, best_viewpoint
from tests.missions.steps import candidate

SITE_MAP = SiteMap(load_scenario("one_source"))


def phase_at(seek: Seek, time_s: float, state: State, detected_s: float | None = None) -> str:
    """Return the phase of a robot in the south of the yard with one candidate, detected now or at the given time."""
    observation = {
        "pose": np.array([16.0, 5.0, 1.0, 0.0], dtype=np.float32),
        "time": np.array([time_s], dtype=np.float32),
    }
    detected_s = time_s if detected_s is None else detected_s
    seek(observation, [candidate((9.5, 8.0, 1.5), 0.1 * np.eye(3), state=state, last_detected_s=detected_s)], SITE_MAP)
    return str(seek.phase)


def test_candidate_that_is_outside_at_times_is_pursued() -> None:
    seek = Seek()
    for k in range(20):
        assert phase_at(seek, 0.2 * k, "outside").startswith("patrol")
        assert phase_at(seek, 0.2 * k + 0.1, "candidate") == "seek 1"


@pytest.mark.parametrize(("longest_s", "detected_s"), [(PATIENCE_S, None), (UNDETECTED_S, 0.0)])
def test_candidate_is_left_without_improvement_or_detection(longest_s: float, detected_s: float | None) -> None:
    """A candidate that was not detected is pursued again once it is detected."""
    seek, n_steps = Seek(), round(longest_s / 0.1)
    phases = [phase_at(seek, 0.1 * k, "candidate", detected_s) for k in range(n_steps + 5)]
    assert set(phases[:n_steps]) == {"seek 1"}
    assert phases[-1].startswith("patrol")
    later_s = 0.1 * len(phases)
    assert phase_at(seek, later_s, "candidate", detected_s).startswith("patrol")
    if detected_s is not None:
        assert phase_at(seek, later_s + 0.1, "candidate", detected_s=later_s) == "seek 1"


def test_high_candidate_is_viewed_from_afar_with_planar_pattern() -> None:
    unsure = SiteMap(load_scenario("one_source", {"array.pattern_error": 0.02}))
    start, head_m = np.array([16.0, 5.0]), np.array([13.0, 9.1, 3.2])
    views = {site_map: best_viewpoint(head_m, start[np.newaxis], site_map.reach(start))
             for site_map in (SITE_MAP, unsure)}  # fmt: skip
    elevation_rad = {
        site_map: np.arctan2(head_m[2] - site_map.antenna_height_m, np.linalg.norm(view - head_m[:2]))
        for site_map, view in views.items()
        if view is not None
    }
    assert elevation_rad[unsure] <= MAX_ELEVATION_RAD + 1e-9
    assert elevation_rad[SITE_MAP] > MAX_ELEVATION_RAD
