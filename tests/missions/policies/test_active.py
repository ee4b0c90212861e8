"""Viewpoints of the policy `active`."""

import numpy as np
import pytest

from dirmusic import Finding
from pdpatrol.envs import load_scenario
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.policies.seek import KNOWN_M, Active
from pdpatrol.missions.policies.viewpoints import expected_information, likely_place
from tests.missions.steps import candidate

SITE_MAP = SiteMap(load_scenario("quiet_yard"))
POSE = np.array([4.0, 5.0, 0.0])


def seen(x_m: float, y_m: float, along_m: float, across_m: float) -> Finding:
    """Return a candidate with standard deviations along and across the line of sight from `POSE`."""
    sight_m = np.array([x_m, y_m]) - POSE[:2]
    ahead = sight_m / np.linalg.norm(sight_m)
    across = np.array([-ahead[1], ahead[0]])
    covariance_m2 = np.diag([0.0, 0.0, 1.0])
    covariance_m2[:2, :2] = along_m**2 * np.outer(ahead, ahead) + across_m**2 * np.outer(across, across)
    return candidate((x_m, y_m, 1.5), covariance_m2)


def test_likely_place_is_farther_and_inside_the_fence() -> None:
    accurate, away = seen(16.0, 9.0, 0.3, 0.1), seen(-60.0, 5.0, 0.1, 0.1)  # the second is outside the yard
    np.testing.assert_allclose(likely_place(accurate, POSE, SITE_MAP), accurate.position_m, atol=0.1)
    np.testing.assert_array_equal(likely_place(away, POSE, SITE_MAP), away.position_m)
    near = likely_place(seen(9.0, 5.0, 3.0, 0.3), POSE, SITE_MAP)
    assert near[0] > 11.0
    assert near[1] == pytest.approx(5.0)
    assert POSE[0] < likely_place(seen(90.0, 5.0, 60.0, 2.0), POSE, SITE_MAP)[0] < SITE_MAP.yard.size_m[0]
    at_the_robot = candidate((16.0, 5.0, 1.5), np.eye(3))
    place_m = likely_place(at_the_robot, np.array([16.0, 5.0, 0.3]), SITE_MAP)
    np.testing.assert_allclose(place_m, at_the_robot.position_m)


def test_integrate_sums_along_the_path() -> None:
    paths = SITE_MAP.reach(POSE)
    length_m = paths.integrate(np.ones(len(SITE_MAP.centres_m)))
    reached = np.isfinite(paths.length_m)
    for cell in np.random.default_rng(0).choice(np.flatnonzero(reached), 40):
        path_m = paths.path(cell)
        assert length_m[cell] == pytest.approx(np.linalg.norm(np.diff(path_m, axis=0), axis=-1).sum())
        along = paths.cell_after(2.0)[cell]
        assert along in paths.cells(cell)
        assert along == cell or 2.0 <= paths.length_m[along] < 3.2
    assert not length_m[~reached].any()


def test_information_is_across_and_larger_from_near() -> None:
    target_m = np.array([16.0, 5.0, 0.9])
    near, far, beyond = expected_information(np.array([[13.0, 5.0], [8.0, 5.0], [4.0, 5.0]]), target_m, SITE_MAP)
    assert near[1, 1] > 4.0 * far[1, 1] > 0.0
    assert near[0, 0] == pytest.approx(0.0, abs=1e-3 * near[1, 1])
    assert not beyond.any()


@pytest.mark.parametrize(
    ("worse", "at_most"),
    [
        ({"array.gain_error": 0.15, "array.pointing_error_deg": 6.0}, 0.13),
        ({"pose_sensor.heading_std_deg": 5.0}, 0.25),
        ({"pose_sensor.position_std_m": 0.5}, 0.15),
    ],
    ids=["array", "heading", "place"],
)
def test_information_falls_with_uncertain_array_or_pose(worse: dict[str, float], at_most: float) -> None:
    place_m, target_m = np.array([[12.0, 5.0]]), np.array([16.0, 5.0, 0.9])
    known = expected_information(place_m, target_m, SITE_MAP)[0, 1, 1]
    less = expected_information(place_m, target_m, SiteMap(load_scenario("quiet_yard", worse)))[0, 1, 1]
    assert 0.0 < less < at_most * known


def viewpoint(policy: Active, target: Finding, pose: np.ndarray) -> np.ndarray:
    """Return the next viewpoint of a candidate that has been viewed from the pose alone."""
    view = policy.viewpoint(target, pose[np.newaxis, :2], pose, SITE_MAP.reach(pose))
    assert view is not None
    return view


def test_active_keeps_a_nearly_best_viewpoint() -> None:
    policy, target = Active(), seen(16.0, 5.0, 2.0, 0.2)
    view = viewpoint(policy, target, POSE)
    sight_m = target.position_m[:2] - view
    assert np.linalg.norm(sight_m) < 5.0
    assert abs(np.arctan2(sight_m[1], sight_m[0])) > np.radians(30.0)
    moved = seen(16.0, 4.2, 2.0, 0.2)
    np.testing.assert_array_equal(viewpoint(policy, moved, POSE), view)
    assert not np.array_equal(viewpoint(Active(), moved, POSE), view)


def test_active_views_accurate_candidate_from_another_side() -> None:
    target = seen(16.0, 5.0, 0.1, 0.1)
    assert target.semi_major_m <= KNOWN_M
    assert np.linalg.norm(viewpoint(Active(), target, np.array([13.0, 5.0, 0.0])) - [13.0, 5.0]) > 1.0
