"""People and vehicles in the environment: their tracks, the lidar, contacts, and errors in their tables."""

import pickle
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import Scenario, ScenarioError, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario.moving import MovingConfig
from tests.envs.helpers import STAND, drive

WALK: dict[str, Any] = {"name": "fitter", "kind": "person", "path_m": ((8.0, 3.0), (8.0, 6.0)), "speed_mps": 1.0}
VAN: dict[str, Any] = WALK | {"name": "van", "kind": "vehicle"}


def scenario(*moving: dict[str, Any]) -> Scenario:
    return load_scenario("one_source", {"nature.moving": moving, "lidar.range_std_m": 0.0, "route.dock_yaw_deg": 0.0})


def started(*moving: dict[str, Any], seed: int = 0) -> tuple[PatrolEnv, dict[str, Any]]:
    env = PatrolEnv(scenario(*moving), terminate_on_approach=False, full_info=True)
    _, info = env.reset(seed=seed, options={"sources": {"discharge": "ct_4/head"}})
    return env, info


def test_track_goes_to_and_fro_or_round() -> None:
    rng = np.random.default_rng(0)
    to_and_fro = MovingConfig.model_validate(WALK | {"pause_s": (2.0, 2.0)}).draw(60.0, rng)
    for time_s, y_m in (
        (0.0, 3.0),
        (2.0, 3.0),
        (3.5, 4.5),
        (5.0, 6.0),
        (7.0, 6.0),
        (8.0, 5.0),
        (10.0, 3.0),
        (13.0, 4.0),
    ):
        np.testing.assert_allclose(to_and_fro.pose(time_s), [8.0, y_m, np.pi / 2], atol=1e-9)
    square = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
    loop = MovingConfig.model_validate(WALK | {"path_m": square, "loop": True}).draw(60.0, rng)
    np.testing.assert_allclose(loop.pose([2.0, 6.0, 14.0, 18.0])[:, :2], [[2, 0], [4, 2], [0, 2], [2, 0]], atol=1e-9)
    np.testing.assert_allclose(loop.pose([2.0, 6.0, 14.0])[:, 2], [0.0, np.pi / 2, -np.pi / 2], atol=1e-9)


def test_pauses_follow_from_the_seed_alone() -> None:
    walk = WALK | {"pause_s": (0.0, 20.0)}
    tracks = [started(walk, seed=seed)[1]["truth"]["moving"] for seed in (3, 3, 4)]
    assert tracks[0] == tracks[1] != tracks[2]
    assert np.ptp(np.diff(tracks[0][0]["time_s"])) > 5.0


def test_lidar_measures_a_person_on_its_track() -> None:
    """The robot stands at (3, 3) and faces east; the person walks away from the beam ahead."""
    env, _ = started(WALK)
    for step in range(1, 30):
        observation, *_ = env.step(STAND)
        across_m = 0.1 * step
        expected_m = 5.0 - np.sqrt(0.25**2 - across_m**2) if across_m < 0.22 else None
        if expected_m is not None:
            assert observation["lidar"][0] == pytest.approx(expected_m, abs=0.02)
        elif across_m > 0.3:
            assert observation["lidar"][0] > 10.0


@pytest.mark.parametrize("table", [WALK, VAN])
def test_contact_has_the_name_of_the_body(table: dict[str, Any]) -> None:
    env, info = started(table | {"pause_s": (3000.0, 3000.0)})
    touched = []
    while not touched and info["time_s"] < 20.0:
        *_, info = env.step(drive(1.0, 0.0))
        touched = info["touched_names"]
    assert touched == (f"moving/{table['name']}",)
    radius_m = env.simulation.robot.footprint_radius_m
    half_m = {"person": 0.25, "vehicle": 0.95}[table["kind"]]
    assert 8.0 - info["true_pose"][0] == pytest.approx(half_m + radius_m, abs=0.2)
    for _ in range(10):
        *_, info = env.step(drive(-1.0, 0.0))
    assert info["touched_names"] == ()


def test_copy_in_the_middle_continues_with_the_same_bodies() -> None:
    env, _ = started(WALK | {"pause_s": (0.0, 3.0)}, VAN | {"path_m": ((5.5, 8.0), (5.5, 16.0))})
    for _ in range(10):
        env.step(drive(0.3, 0.1))
    copy = pickle.loads(pickle.dumps(env))
    for _ in range(20):
        ours, theirs = (each.step(drive(0.5, 0.2))[0] for each in (env, copy))
        for key, value in ours.items():
            np.testing.assert_array_equal(value, theirs[key])


def test_world_without_bodies_is_the_same() -> None:
    """A person behind the fire wall, which the lidar does not see, changes no bit of a mission."""
    hidden = WALK | {"path_m": ((24.0, 26.0), (24.0, 28.0))}
    (env, _), (other, _) = started(), started(hidden)
    for _ in range(40):
        ours, theirs = (each.step(drive(0.6, 0.1))[0] for each in (env, other))
        for key, value in ours.items():
            np.testing.assert_array_equal(value, theirs[key], err_msg=key)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"kind": "horse"}, "nature.moving \"fitter\".kind: must be 'person' or 'vehicle', got 'horse'"),
        ({"path_m": ((8.0, 3.0),)}, 'nature.moving "fitter".path_m: must have at least 2 items'),
        ({"path_m": ((8.0, 3.0), (8.0, 3.1))}, 'nature.moving "fitter".path_m: points must be 0.5 m apart'),
        ({"pause_s": (5.0, 1.0)}, 'nature.moving "fitter".pause_s: must be the shortest and the longest pause'),
        (
            {"path_m": ((12.0, 13.0), (12.0, 21.0))},
            'nature.moving "fitter".path_m: must stay 0.25 m from fence and equipment',
        ),
        (
            {"path_m": ((-1.0, 5.0), (5.0, 5.0))},
            'nature.moving "fitter".path_m: must stay 0.25 m from fence and equipment',
        ),
        ({"path_m": ((3.2, 3.0), (8.0, 3.0))}, 'nature.moving "fitter".path_m: must start'),
    ],
)
def test_error_in_a_table_is_one_line(change: dict[str, Any], line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(WALK | change)
    assert len(caught.value.args) == 1
    assert str(caught.value).splitlines()[-1].partition(": ")[2].startswith(line) or line in str(caught.value)
    assert str(caught.value).count("nature.moving") == 1


def test_names_are_used_once() -> None:
    with pytest.raises(ScenarioError, match=r"nature\.moving\.1\.name: must be used once, got `fitter` again"):
        scenario(WALK, WALK)
