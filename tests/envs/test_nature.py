"""Nature that differs from the belief of the robot: each key of `[nature]` changes nature alone."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dirmusic.pulses.batch import PulseBatch
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.episode import Episode, Generators, ResetOptions
from pdpatrol.envs.motion import sense_motion, start_motion
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.robot_states import N_DRAWS, Parameters, RobotStates
from pdpatrol.envs.scenario.array import data_sheet_sha256
from pdpatrol.robot_models.readings import POSE
from pdpatrol.sensing import Surroundings
from pdpatrol.sensing.nature.sources import Emissions, Telegraph
from pdpatrol.sensing.receiver.bank import ReceiverBank

EXACT = {"array.gain_error": 0.0, "array.pointing_error_deg": 0.0, "array.position_error_m": 0.0}
"""An array without drawn errors."""

EXACT_POSE = {"pose_sensor.position_std_m": 0.0, "pose_sensor.heading_std_deg": 0.0}

ROBOT_M = np.array([12.0, 4.0])
OFF_M = np.array([4.0, 2.5, 2.0])
"""Position of the source, robot frame."""


def loaded(settings: dict[str, Any]) -> Scenario:
    receiver = {"noise_v": 1e-5, "bits": 24, "full_scale_v": 5.0, "pretrigger_samples": 60, "gate_samples": 200}
    return load_scenario("bench", {"task.time_limit_s": 600.0, "receiver": receiver, **EXACT, **settings})


def listen(settings: dict[str, Any], *, start_s: float = 0.0, seed: int = 0) -> PulseBatch:
    """Return the pulses of one second in free space, for a robot that faces east and a source at `OFF_M`."""
    scenario, pose = loaded(settings), np.eye(4)
    pose[:2, 3] = ROBOT_M
    options = ResetOptions(sources_m={"gun": pose[:3, 3] + OFF_M})
    episode = Episode.draw(scenario, Surroundings(), Generators.spawn(np.random.default_rng(seed)), options)
    bank = ReceiverBank(scenario.receiver, [episode.listener])
    return bank.listen(pose[np.newaxis], np.array([start_s]), 1.0).pulses


def strengths(settings: dict[str, Any], *, start_s: float = 0.0, seed: int = 0) -> np.ndarray:
    """Return the mean strengths (6,) of these pulses."""
    return listen(settings, start_s=start_s, seed=seed).strengths_v.mean(axis=0)


def paper_gain(angle_deg: np.ndarray) -> np.ndarray:
    """Return eq. (1) of the Dir-MUSIC paper, for angles off the boresight."""
    theta = (207.0 + angle_deg) % 360.0
    terms = ((0.5255, 218.1, 51.73), (0.3405, 304.8, 41.0), (0.6251, 156.1, 109.1))
    return np.sum([a * np.exp(-(((theta - b) / c) ** 2)) for a, b, c in terms], axis=0)


def formula(turn: Rotation, *, radius_m: float = 0.12, scale: float = 1.0) -> np.ndarray:
    """Return the relative strengths (6,) of a ring that is turned about its centre, by eq. (1) and inverse distance."""
    azimuth = np.radians(90.0 - 60.0 * np.arange(6))
    ahead = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(6)])
    left = np.column_stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(6)])
    sight = OFF_M - np.array([0.0, 0.0, 0.6]) - turn.apply(radius_m * ahead)
    range_m = np.linalg.norm(sight, axis=1)
    towards = sight / range_m[:, np.newaxis]
    off = np.arccos(np.sum(turn.apply(ahead) * towards, axis=1))
    cos_roll = np.sum(turn.apply(left) * towards, axis=1) / np.sin(off)
    off_deg = np.degrees(off)
    off_deg = np.where(off_deg <= 120.0, off_deg / scale, 180.0 - (180.0 - off_deg) * (180.0 - 120.0 / scale) / 60.0)
    gain = 0.5 * ((1 + cos_roll) * paper_gain(off_deg) + (1 - cos_roll) * paper_gain(-off_deg))
    return gain / range_m


LEVEL = Rotation.identity()


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, formula(LEVEL)),
        ({"beam_width_scale": 1.05}, formula(LEVEL, scale=1.05)),
        ({"beam_width_scale": 0.8}, formula(LEVEL, scale=0.8)),
        ({"ring_radius_m": 0.3}, formula(LEVEL, radius_m=0.3)),
        ({"mount_yaw_deg": 7.0}, formula(Rotation.from_euler("z", 7.0, degrees=True))),
        ({"mount_tilt_deg": 4.0}, formula(Rotation.from_euler("y", -4.0, degrees=True))),  # the front is raised
        (
            {"mount_tilt_deg": 4.0, "mount_tilt_azimuth_deg": 90.0},  # the left side is raised
            formula(Rotation.from_euler("x", 4.0, degrees=True)),
        ),
    ],
    ids=["as believed", "wide", "narrow", "radius", "yaw", "tilt", "tilt left"],
)
def test_strengths_follow_the_true_array(settings: dict[str, float], expected: np.ndarray) -> None:
    found = strengths({f"nature.array.{key}": value for key, value in settings.items()})
    atol = 0.003 if "mount_tilt_deg" in settings else 3e-4  # a tilt ignores the roll of elements
    np.testing.assert_allclose(found / np.linalg.norm(found), expected / np.linalg.norm(expected), atol=atol)


def test_robot_carries_the_array_as_it_is_mounted() -> None:
    """The first element is on the left; turned by 90 degrees it is at the back, which a tilt by 10 degrees lowers."""
    mount = {"nature.array.ring_radius_m": 0.2, "nature.array.mount_yaw_deg": 90.0, "nature.array.mount_tilt_deg": 10.0}
    site = PatrolEnv(loaded(mount)).simulation.robots.model.site("element_1")
    expected = [-0.2 * np.cos(np.radians(10.0)), 0.0, 0.6 - 0.2 * np.sin(np.radians(10.0))]
    np.testing.assert_allclose(site.pos, expected, atol=1e-12)


@pytest.mark.parametrize("pattern", ["helix", "helix_in_ring"])
def test_scaled_table_equals_the_table_at_scaled_angles(pattern: str) -> None:
    """At 1.1 times each angle from the boresight, a beam 10 % wider has the gain of the original."""
    arrays = [
        Episode.draw(
            loaded({"nature.array.pattern": pattern, "nature.array.beam_width_scale": scale}),
            Surroundings(),
            Generators.spawn(np.random.default_rng(0)),
            ResetOptions(),
        ).listener.array
        for scale in (1.0, 1.1)
    ]
    off, roll = np.meshgrid(np.radians([0.0, 20.0, 50.0, 90.0, 180.0 / 1.1]), np.radians([0.0, 40.0, 90.0, 200.0]))
    gains = []
    for array, scale in zip(arrays, (1.0, 1.1), strict=True):
        psi = np.minimum(scale * off, np.pi)
        x, y, z = np.cos(psi), np.sin(psi) * np.cos(roll), np.sin(psi) * np.sin(roll)
        azimuth = np.arctan2(y, x)[..., np.newaxis] + array.boresights_rad
        gains.append(array.gain(azimuth, np.arcsin(z)[..., np.newaxis])[..., 0])
    np.testing.assert_allclose(gains[1][:, :4], gains[0][:, :4], atol=1e-3)


@pytest.mark.parametrize("key", ["pattern", "gain_error", "pointing_error_deg", "position_error_m", "gain_offset"])
def test_true_array_may_differ_from_the_data_sheet(key: str) -> None:
    """The same value in the data sheet changes the believed array and not the strengths."""
    value = "helix" if key == "pattern" else 0.05
    found = [strengths({f"{table}.{key}": value}) for table in ("array", "nature.array")]
    np.testing.assert_array_equal(found[0], found[1])
    assert not np.array_equal(found[0], strengths({}))


def test_gain_drifts_with_temperature_in_all_channels() -> None:
    drift = {"nature.receiver.temperature_drift_db_per_min": 2.0}
    np.testing.assert_array_equal(strengths(drift), strengths({}))
    np.testing.assert_allclose(strengths(drift, start_s=90.0) / strengths({}), 10 ** (3.0 / 20.0), rtol=1e-3)


def test_drift_of_channels_has_its_spread() -> None:
    spread = {"nature.receiver.temperature_spread_db_per_min": 0.5}
    ratio = [strengths(spread, start_s=60.0, seed=seed) / strengths({}, seed=seed) for seed in range(30)]
    drift_db = 20.0 * np.log10(ratio)
    assert drift_db.std() == pytest.approx(0.5, rel=0.15)
    assert abs(drift_db.mean()) < 0.15


def test_two_faults_of_one_channel_add() -> None:
    fault = {"channel": 2, "kind": "gain_drift", "gain_db": -6.0}
    found = strengths({"nature.receiver.faults": [fault, fault]}) / strengths({})
    np.testing.assert_allclose(found, [1.0, 10 ** (-12.0 / 20.0), 1.0, 1.0, 1.0, 1.0], rtol=1e-3)


@pytest.mark.parametrize(("start_s", "is_bad"), [(0.0, False), (2.0, True), (3.0, False), (6.0, True)])
def test_intermittent_channel_is_bad_and_good_in_turns(start_s: float, is_bad: bool) -> None:
    loose = {"channel": 4, "kind": "intermittent", "gain_db": -20.0, "start_s": 2.0, "bad_s": 1.0, "good_s": 3.0}
    found = strengths({"nature.receiver.faults": [loose]}, start_s=start_s) / strengths({})
    np.testing.assert_allclose(found, [1.0, 1.0, 1.0, 0.1 if is_bad else 1.0, 1.0, 1.0], rtol=2e-3)


@pytest.mark.parametrize("offset_hz", [0.0, 0.1, -0.1])
def test_phases_drift_if_the_mains_is_not_as_believed(offset_hz: float) -> None:
    """If the mains is 0.1 Hz faster than believed, discharges come an eighth of a cycle earlier after 1.25 s."""
    void = {"name": "gun", "position_m": [20.0, 3.0, 1.0], "kind": "void", "pulse_rate_hz": 500.0, "amplitude_v": 2.5}
    settings = {"sources": [void], "nature.receiver.mains_offset_hz": offset_hz}
    early, late = (listen(settings, start_s=start_s).mains_phase_rad for start_s in (0.0, 1.25))
    shift_rad = (
        np.angle(np.exp(2j * late).mean() / np.exp(2j * early).mean()) / 2
    )  # the pattern repeats twice per cycle
    assert shift_rad == pytest.approx(-2 * np.pi * offset_hz * 1.25, abs=0.05)


def test_drawn_drift_is_part_of_the_truth() -> None:
    scenario = loaded({"nature.receiver.temperature_spread_db_per_min": 0.5})
    truth = PatrolEnv(scenario, full_info=True).reset(seed=0)[1]["truth"]
    assert np.ptp(truth["receiver"]["drift_db_per_min"]) > 0.0


def drawn(settings: dict[str, Any], duration_s: float = 600.0, seed: int = 0) -> Emissions:
    """Draw the emissions of the sources and interferers of a scenario."""
    generators = Generators.spawn(np.random.default_rng(seed))
    episode = Episode.draw(loaded(settings), Surroundings(), generators, ResetOptions())
    return episode.listener.scene.draw(0.0, duration_s, generators.nature)


STEADY = {"name": "steady", "position_m": [20.0, 3.0, 1.0], "pulse_rate_hz": 20.0, "amplitude_range_db": 0.0}


@pytest.mark.parametrize("key", ["sources", "interferers"])
def test_duty_interrupts_an_emitter_and_changes_no_other_draw(key: str) -> None:
    """Emissions with pauses are a part of those without; on and off times have their mean durations."""
    item = STEADY | {"amplitude_v": 0.27}
    always, pausing = (drawn({"sources": [], key: [item | duty]}) for duty in ({}, {"duty_s": [6.0, 3.0]}))
    assert np.isin(pausing.time_s, always.time_s).all()
    assert pausing.time_s.size / always.time_s.size == pytest.approx(6.0 / 9.0, abs=0.1)
    kept = np.isin(np.sort(always.time_s), pausing.time_s)
    n_pauses = np.count_nonzero(np.diff(kept.astype(int)) == -1)
    assert n_pauses == pytest.approx(600.0 / 9.0, abs=4 * np.sqrt(600.0 / 9.0))


def test_telegraph_may_be_asked_in_any_order() -> None:
    forth, back = (Telegraph(2.0, 1.0, np.random.default_rng(3)) for _ in range(2))
    time_s = np.arange(0.0, 300.0, 0.1)
    states = [forth.is_on(part) for part in np.split(time_s, 30)]
    np.testing.assert_array_equal(np.concatenate(states), back.is_on(time_s[::-1])[::-1])
    starts = [Telegraph(2.0, 1.0, np.random.default_rng(seed)).is_on(np.zeros(1))[0] for seed in range(600)]
    assert np.mean(starts) == pytest.approx(2.0 / 3.0, abs=0.08)


def test_source_changes_level_rate_and_kind_at_their_times() -> None:
    changes = [
        {"at_s": 200.0, "amplitude_db": 6.0, "pulse_rate_hz": 60.0},
        {"at_s": 400.0, "kind": "corona"},
        {"at_s": 500.0, "pulse_rate_hz": 0.0},
    ]
    found = drawn({"sources": [STEADY | {"conductor_deg": 120.0, "changes": changes}]})
    parts = [np.abs(found.peak_v[(found.time_s >= low) & (found.time_s < high)]) for low, high in
             ((0.0, 200.0), (200.0, 400.0), (400.0, 500.0), (500.0, 600.0))]  # fmt: skip
    sizes = np.array([part.size for part in parts])
    np.testing.assert_allclose(sizes, [4000, 12000, 6000, 0], atol=4 * np.sqrt(12000))
    assert sizes[3] == 0
    np.testing.assert_allclose(parts[0], 0.27)
    np.testing.assert_allclose(parts[1], 0.27 * 10**0.3)
    phase = (50.0 * found.time_s[found.time_s >= 400.0] - 120.0 / 360.0) % 1.0
    assert abs(np.exp(2j * np.pi * phase).mean()) > 0.5  # corona comes mainly in one half cycle
    assert abs(np.exp(2j * np.pi * 50.0 * found.time_s[found.time_s < 400.0]).mean()) < 0.05


def test_interferer_has_kind_and_activity_and_changes_no_other_draw() -> None:
    lamp = STEADY | {"name": "lamp", "amplitude_v": 0.3, "kind": "floating", "active_s": [10.0, 20.0]}
    plain, found = (drawn({"interferers": [item]}) for item in (STEADY | {"name": "lamp", "amplitude_v": 0.3}, lamp))
    time_s = found.time_s[found.source == 1]
    assert time_s.min() >= 10.0
    assert time_s.max() < 20.0
    assert abs(np.exp(4j * np.pi * 50.0 * time_s).mean()) > 0.5  # twice per cycle
    np.testing.assert_array_equal(found.time_s[found.source == 0], plain.time_s[plain.source == 0])


def poses(settings: dict[str, Any], true_pose: np.ndarray, seed: int = 0) -> np.ndarray:
    """Return the readings of the pose sensor (n, 3) at true poses (n, 3), 0.1 s apart."""
    scenario = loaded(settings)
    state, parameters, rng = RobotStates.zeros(1, scenario), Parameters.of(scenario), np.random.default_rng(seed)
    found = []
    for k, pose in enumerate(true_pose):
        readings = np.zeros(8)
        readings[POSE] = pose
        state.motion_normal[0] = rng.standard_normal(N_DRAWS)
        (sense_motion if k else start_motion)(state, parameters, readings, 0)
        found.append(state.believed_pose[0].copy())
    return np.array(found)


PATH = np.array([[3.0, 3.0, 0.0], [10.0, 3.0, 0.5], [10.0, 12.0, -2.0]])
"""True poses; the dock is at the first."""


def test_frame_turns_about_the_dock_and_shifts() -> None:
    found = poses(
        {**EXACT_POSE, "nature.pose_sensor.frame_rotation_deg": 90.0, "nature.pose_sensor.frame_offset_m": [0.5, -1.0]},
        PATH,
    )
    turned = [[3.5, 2.0, np.pi / 2], [3.5, 9.0, 0.5 + np.pi / 2], [-5.5, 9.0, -2.0 + np.pi / 2]]
    np.testing.assert_allclose(found, turned, atol=1e-12)


def test_bias_is_constant_in_the_robot_frame() -> None:
    bias = {"nature.pose_sensor.position_bias_m": [0.2, 0.1], "nature.pose_sensor.heading_bias_deg": 3.0}
    off = poses(EXACT_POSE | bias, PATH) - PATH
    np.testing.assert_allclose(off[0], [0.2, 0.1, np.radians(3.0)], atol=1e-12)
    turned = Rotation.from_euler("z", PATH[:, 2:]).apply([0.2, 0.1, 0.0])
    np.testing.assert_allclose(off[:, :2], turned[:, :2], atol=1e-12)


@pytest.mark.parametrize(("key", "value"), [("position_std_m", 0.5), ("heading_std_deg", 4.0), ("correlation_s", 0.2)])
def test_true_pose_error_may_differ_from_the_believed_one(key: str, value: float) -> None:
    at_rest = np.zeros((50, 3))
    found = [poses({f"{table}.{key}": value}, at_rest) for table in ("pose_sensor", "nature.pose_sensor")]
    np.testing.assert_array_equal(found[0], found[1])
    assert not np.array_equal(found[0], poses({}, at_rest))


def driven(settings: dict[str, Any], n_steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return believed, true and odometry poses (n, 3) of a robot that drives in a small circle."""
    env = PatrolEnv(loaded(EXACT_POSE | settings))
    env.reset(seed=0, options={"start_pose": [20.0, 4.0, 0.0]})
    infos = [env.step(np.array([0.4, 0.9], np.float32))[-1] for _ in range(n_steps)]
    believed, true, odometry = (
        np.array([info[key] for info in infos]) for key in ("believed_pose", "true_pose", "odometry")
    )
    return believed, true, odometry


def test_jumps_have_their_rate_and_size_and_decay() -> None:
    jumps = {"nature.pose_sensor.jumps_per_min": 15.0, "nature.pose_sensor.jump_std_m": 0.4}
    believed, true, odometry = driven(jumps, 1500)
    np.testing.assert_array_equal(odometry[:300], driven({}, 300)[2])  # no other draw changes
    off_m = (believed - true)[:, :2]
    added_m = off_m[1:] - np.exp(-0.1 / 5.0) * off_m[:-1]
    has_jumped = np.abs(added_m).max(axis=1) > 1e-9
    assert has_jumped.sum() == pytest.approx(150.0 / 4.0, abs=4 * np.sqrt(37.5))
    assert added_m[has_jumped].std() == pytest.approx(0.4, rel=0.2)
    np.testing.assert_allclose(believed[:, 2], true[:, 2], atol=1e-9)


def test_pose_is_dead_reckoned_during_dropouts() -> None:
    """The error grows as that of the odometry in a dropout, and is that of the sensor, here 0, otherwise."""
    dropouts = {"nature.pose_sensor.dropouts_per_min": 6.0, "nature.pose_sensor.dropout_s": 3.0,
                "odometry.wheel_radius_error": 0.2}  # fmt: skip
    believed, true, odometry = driven(dropouts, 2000)
    is_lost = np.abs(believed - true).max(axis=1) > 1e-9
    assert is_lost.mean() == pytest.approx(3.0 / (10.0 + 3.0), abs=0.1)
    ends = np.flatnonzero(np.diff(is_lost.astype(int)))
    lengths = np.diff(ends)[0 if is_lost[ends[0] + 1] else 1 :: 2]
    assert set(lengths.tolist()) == {30}
    lost = np.flatnonzero(is_lost[1:]) + 1
    steps_m = [np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1) for path in (believed, odometry)]
    np.testing.assert_allclose(steps_m[0][lost - 1], steps_m[1][lost - 1], atol=1e-9)


NATURE: dict[str, Any] = {
    "array.pattern": "helix_in_ring", "array.beam_width_scale": 1.1, "array.gain_error": 0.2,
    "array.pointing_error_deg": 5.0, "array.position_error_m": 0.01, "array.gain_offset": 0.1,
    "array.ring_radius_m": 0.2, "array.mount_yaw_deg": 5.0, "array.mount_tilt_deg": 3.0,
    "array.mount_tilt_azimuth_deg": 90.0, "pose_sensor.position_std_m": 0.3, "pose_sensor.heading_std_deg": 3.0,
    "pose_sensor.correlation_s": 50.0, "pose_sensor.position_bias_m": [0.1, 0.1], "pose_sensor.heading_bias_deg": 2.0,
    "pose_sensor.jumps_per_min": 1.0, "pose_sensor.jump_std_m": 0.5, "pose_sensor.jump_std_deg": 5.0,
    "pose_sensor.dropouts_per_min": 1.0, "pose_sensor.dropout_s": 5.0,
    "pose_sensor.frame_offset_m": [1.0, 0.0], "pose_sensor.frame_rotation_deg": 1.0,
    "receiver.faults": [{"channel": 1, "kind": "dead"}], "receiver.temperature_drift_db_per_min": 0.5,
    "receiver.temperature_spread_db_per_min": 0.1, "receiver.mains_offset_hz": 0.02,
}  # fmt: skip


def test_nature_does_not_change_what_the_robot_believes() -> None:
    believed = load_scenario("bench")
    scenario = load_scenario("bench", {f"nature.{key}": value for key, value in NATURE.items()})
    assert data_sheet_sha256(scenario.known_array) == data_sheet_sha256(believed.known_array)
    assert scenario.model_copy(update={"nature": believed.nature}) == believed
    assert scenario.pose_sensor.pose_error == believed.pose_sensor.pose_error
