"""Each row of the vector environment equals a single environment bit for bit."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.vector_env import PatrolVectorEnv

TRAM = {"name": "tram", "position_m": (-20.0, -8.0, 3.0), "amplitude_v": 3.0, "pulse_rate_hz": 100.0}
MOVING = {"path_m": ((60.0, -8.0, 3.0),), "speed_mps": 20.0}


def brisk(name: str = "one_source", **settings: Any) -> Scenario:  # noqa: ANN401 - as TOML
    """Make a scenario whose episodes end soon, by time or by approach, with other tables replaced."""
    return load_scenario(name, {"task.time_limit_s": 4.0, "task.standoff_m": 10.0, **settings})


def assert_same(native: Any, sync: Any) -> None:  # noqa: ANN401 - any result of a vector environment
    """Compare values, dtypes, and keys with their masks."""
    if isinstance(native, dict):
        assert set(native) == set(sync)
        for key, values in native.items():
            assert_same(values, sync[key])
    elif isinstance(native, tuple):
        for mine, other in zip(native, sync, strict=True):
            assert_same(mine, other)
    else:
        assert native.dtype == sync.dtype
        np.testing.assert_equal(list(native), list(sync))


def assert_rows_equal_singles(
    scenario: Scenario, num_envs: int = 3, num_threads: int = 2, mode: str = "NextStep", n_steps: int = 60
) -> tuple[int, int, int]:
    """Compare all results with those of single environments, including resets of single rows.

    Returns:
        Number of episodes that ended, of steps in which some rows ended and others did not, and of pulses detected.
    """
    rows, singles = (
        gymnasium.make_vec("pdpatrol:PDPatrol-v0", num_envs=num_envs, scenario=scenario, **arguments)
        for arguments in (
            {"autoreset_mode": mode, "num_threads": num_threads},
            {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": mode}},
        )
    )
    assert isinstance(rows.unwrapped, PatrolVectorEnv)
    assert_same(rows.reset(seed=40), singles.reset(seed=40))
    n_over, n_apart, n_detected = 0, 0, 0
    for step in range(n_steps):
        driven = np.random.default_rng(step).uniform(-1, 1, (num_envs, 2)).astype(np.float32)
        result = rows.step(driven)
        assert_same(result, singles.step(driven))
        assert result[0] in rows.observation_space
        if step in (7, 31):  # so that the rows end at different times
            mask = np.arange(num_envs) == step % num_envs
            assert_same(*(envs.reset(options={"reset_mask": mask}) for envs in (rows, singles)))
        over = result[2] | result[3]
        n_over += int(over.sum())
        n_apart += int(over.any() and not over.all())
        n_detected += int(result[0]["detected"].sum())
    return n_over, n_apart, n_detected


@pytest.mark.parametrize(
    ("num_envs", "num_threads", "mode"),
    [
        (1, 1, "NextStep"),
        (3, 2, "NextStep"),
        pytest.param(16, 1, "NextStep", marks=pytest.mark.whole),
        pytest.param(16, 2, "NextStep", marks=pytest.mark.whole),
        (3, 1, "SameStep"),
    ],
)
def test_row_equals_single_environment_to_the_bit(num_envs: int, num_threads: int, mode: str) -> None:
    n_over, n_apart, _ = assert_rows_equal_singles(brisk(), num_envs, num_threads, mode, 170)
    assert n_over >= 3 * num_envs
    assert num_envs == 1 or n_apart > 3


def test_rows_with_faulty_channels_equal_single_environments() -> None:
    fault = {"channel": 2, "kind": "dead", "start_s": 1.0}
    many = [{"name": f"in_{item}", "sites": [f"{item}/*"], "pulse_rate_hz": 60.0} for item in ("vt_west", "vt_east")]
    assert_rows_equal_singles(brisk("two_sources", **{"nature.receiver.faults": [fault], "sources": many}))


def test_rows_with_another_nature_equal_single_environments() -> None:
    """Array, pose sensor and receiver differ from the belief, and an interferer stands inside the fence."""
    nature = {
        "array": {"beam_width_scale": 1.1, "mount_yaw_deg": 2.0},
        "pose_sensor": {"jumps_per_min": 60.0, "jump_std_m": 0.3, "dropouts_per_min": 30.0, "dropout_s": 0.5,
                        "frame_rotation_deg": 1.0},
        "receiver": {"temperature_spread_db_per_min": 2.0, "temperature_drift_db_per_min": 3.0},
    }  # fmt: skip
    lamp = TRAM | {"name": "lamp", "position_m": (8.0, 8.0, 2.0), "duty_s": (0.5, 0.5), "kind": "corona"}
    *_, n_detected = assert_rows_equal_singles(brisk("two_sources", nature=nature, interferers=[lamp]))
    assert n_detected > 10


def test_moving_interferer_is_where_each_row_has_it() -> None:
    *_, n_detected = assert_rows_equal_singles(
        brisk("one_source", **{"interferers": [TRAM | MOVING], "task.time_limit_s": 9.0})
    )
    assert n_detected > 100


def test_truth_has_the_path_of_a_moving_interferer() -> None:
    _, info = PatrolEnv(brisk(interferers=[TRAM, TRAM | MOVING | {"name": "bus"}]), full_info=True).reset(seed=0)
    standing, bus = info["truth"]["interferers"]
    assert not {"path_m", "speed_mps"} & standing.keys()
    assert (bus["position_m"], bus["path_m"], bus["speed_mps"]) == ([-20.0, -8.0, 3.0], [[60.0, -8.0, 3.0]], 20.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "`num_envs` and `max_episode_steps` must be at least 1"),
        ({"num_envs": 2, "render_mode": "rgb_array"}, "make a single environment"),
    ],
)
def test_impossible_argument_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        PatrolVectorEnv(**arguments)


@pytest.mark.parametrize("seed", [np.int64(5), (5, 6), np.array([5, 6]), [5, 6]])
def test_seed_may_be_any_integer_type(seed: object) -> None:
    envs = PatrolVectorEnv(2)
    first, _ = envs.reset(seed=5)
    again, _ = envs.reset(seed=seed)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(first["pose"], again["pose"])
