"""Simulated surveys of waveforms, with the faults that recordings of oscilloscopes have."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.envs.random_yard import random_source, random_yard
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.missions.report.records import Report
from pdpatrol.sensing import ArrayConfig, DischargeSource, HelicalArray, ReceiverConfig, Scene, level_transform
from pdpatrol.sensing.receiver.bank import listen_once
from tests.missions.field.drawn_surveys import PATHS, draw_poses, position_of
from tests.missions.field.surveys import locate

SOURCE_M, OTHER_M = (14.0, 9.0, 1.5), (9.5, 7.0, 1.5)
POSES = [  # x m, y m, yaw deg
    (5.0, 4.5, 0), (8.0, 4.5, 5), (11.0, 4.8, 10), (14.0, 5.2, 20), (16.5, 6.4, 35), (17.8, 8.8, 95), (16.8, 11.2, 130),
    (14.0, 12.4, 165), (11.2, 11.0, 215), (10.6, 8.6, 250),
]  # fmt: skip
RECEIVER = ReceiverConfig(
    band_hz="all", gate_samples=600, pretrigger_samples=250, full_scale_v=2.0, bits=16, false_alarm_rate_hz=1e-3
)
N_SHOTS = 3


@dataclass
class Recording:
    """Waveforms at several poses by an array with errors, and the poses as the survey states them.

    Attributes:
        poses: x m, y m, yaw deg, with errors of 5 cm and half a degree, shape (n_poses, 3).
        volts: Waveforms at each pose, shape (n_pulses, 6, 600) each.
        sources_m: Positions of the sources, shape (n_sources, 3).
    """

    poses: FloatArray
    volts: list[FloatArray]
    sources_m: FloatArray

    def write(self, folder: Path, counts_v: float = 2e-5, offsets_v: FloatArray | float = 0.0) -> Path:
        """Write one file of counts for each pose, and the table of the survey."""
        rows = ["time_s,x_m,y_m,yaw_deg,waveform"]
        for k, (pose, volts) in enumerate(zip(self.poses, self.volts, strict=True)):
            counts = np.round((volts + np.reshape(offsets_v, (-1, 1))) / counts_v).astype(np.int32)
            np.savez(folder / f"s{k}.npz", waveforms=counts, volts_per_count=counts_v, sample_rate_hz=20e9)
            rows.append(f"{20 * k},{pose[0]:.3f},{pose[1]:.3f},{pose[2]:.2f},s{k}.npz")
        (folder / "t.csv").write_text("\n".join(rows))
        return folder / "t.csv"


@dataclass
class Located:
    """Report of a survey, and the positions of its sources, shape (n_sources, 3)."""

    report: Report
    sources_m: FloatArray


Draw = Callable[[int, int], Recording]
"""Function that draws a recording for a seed and a number of sources."""


def in_free_field(seed: int, n_sources: int = 1) -> Recording:
    """Draw array, noise and errors of the poses; poses and sources are always the same."""
    sources = [_source(place_m, 0.27, N_SHOTS) for place_m in (SOURCE_M, OTHER_M)[:n_sources]]
    poses = np.column_stack([np.array(POSES)[:, :2], np.radians(np.array(POSES)[:, 2])])
    return _record(np.random.default_rng(seed), poses, Scene(sources))


def in_random_yard(seed: int, n_sources: int = 1) -> Recording:
    """Draw yard, sources of any strength, array, and up to 24 poses outside of equipment, until 5 have pulses."""
    rng = np.random.default_rng([43, seed])
    while len((drawn := _in_yard(rng, n_sources)).volts) < 5:
        pass
    return drawn


def _in_yard(rng: np.random.Generator, n_sources: int) -> Recording:
    yard = random_yard(rng, int(rng.integers(0, 7))).yard
    sources_m = [position_of(random_source(yard, rng), yard) for _ in range(n_sources)]
    poses = draw_poses(str(rng.choice(PATHS)), int(rng.integers(8, 25)), sources_m[0], rng)
    n_shots = int(rng.integers(1, 5))
    sources = [_source(place_m, 10 ** rng.uniform(-1.0, 0.0), n_shots) for place_m in sources_m]
    return _record(rng, poses[yard.clearance(poses[:, :2]) > 0.5], Scene(sources, surroundings_of(yard)))


def _source(place_m: Sequence[float] | FloatArray, amplitude_v: float, n_shots: int) -> DischargeSource:
    return DischargeSource(
        name="s", position_m=np.array(place_m), amplitude_v=amplitude_v, pulse_rate_hz=2.0 * n_shots, n_shots=n_shots
    )


def _record(rng: np.random.Generator, poses: FloatArray, scene: Scene) -> Recording:
    """Record at true poses x m, y m, yaw rad, shape (n_poses, 3); those without a pulse are left out."""
    array, recorded = HelicalArray.draw(ArrayConfig(), rng), list[FloatArray]()
    for pose in poses:
        detected = listen_once(RECEIVER, array, scene, rng, world_from_array=level_transform(pose), duration_s=1.0)
        recorded.append(detected.waveforms_v)
    stated = poses + rng.normal(0.0, [0.05, 0.05, np.radians(0.5)], poses.shape)
    stated[:, 2] = np.degrees(stated[:, 2])
    kept = [k for k, volts in enumerate(recorded) if len(volts)]
    return Recording(stated[kept], [recorded[k] for k in kept], scene.positions_m)


def clipped(folder: Path, seed: int, draw: Draw = in_free_field) -> Located:
    """Locate with an oscilloscope of 8 bits whose rails are between a fifth and the whole of the largest sample."""
    recording = draw(seed, 1)
    rail_v = np.random.default_rng(seed).uniform(0.2, 1.0) * max(np.abs(volts).max() for volts in recording.volts)
    step_v = rail_v / 128
    recording.volts = [np.clip(np.round(v / step_v), -128, 127) * step_v for v in recording.volts]
    return Located(locate(recording.write(folder, step_v), noise_v=None), recording.sources_m)


def with_offsets(folder: Path, seed: int, draw: Draw = in_free_field) -> Located:
    """Locate with weak pulses and offsets of up to five standard deviations of the noise."""
    recording, rng = draw(seed, 1), np.random.default_rng(seed)
    share = 0.3 if draw is in_free_field else 1.0  # in a yard, sources of any strength are drawn
    recording.volts = [share * volts + rng.normal(0.0, 1e-3, volts.shape) for volts in recording.volts]
    table = recording.write(folder, offsets_v=rng.uniform(-5e-3, 5e-3, 6))
    return Located(locate(table, noise_v=None), recording.sources_m)


def in_one_record(folder: Path, seed: int, draw: Draw = in_free_field) -> Located:
    """Locate with all pulses of two sources at a pose in one record, in random order."""
    recording, rng = draw(seed, 2), np.random.default_rng(seed)
    recording.volts = [np.concatenate(volts[rng.permutation(len(volts))], axis=-1) for volts in recording.volts]
    return Located(locate(recording.write(folder), noise_v=None), recording.sources_m)
