"""Simulated surveys of waveforms, with the faults that recordings of oscilloscopes have."""

from pathlib import Path

import numpy as np

from dirmusic.arrays import FloatArray
from pdpatrol.missions.report.records import Report
from pdpatrol.sensing import ArrayConfig, DischargeSource, HelicalArray, ReceiverConfig, Scene, level_transform
from pdpatrol.sensing.receiver.bank import listen_once
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


class Recording:
    """Waveforms at ten poses by an array with errors, and the poses as the survey states them.

    Args:
        seed: Seed of the array, the noise, and the errors of the poses: 5 cm and half a degree.
        sources_m: Positions of the sources.

    Attributes:
        poses: x m, y m, yaw deg, shape (10, 3).
        volts: Waveforms at each pose, shape (n_pulses, 6, 600) each.
    """

    def __init__(self, seed: int, *sources_m: tuple[float, float, float]) -> None:
        rng = np.random.default_rng(seed)
        array = HelicalArray.draw(ArrayConfig(), rng)
        self.poses = np.array(POSES) + rng.normal(0.0, [0.05, 0.05, 0.5], (len(POSES), 3))
        self.volts = [
            np.concatenate([self._received(array, rng, pose, source_m) for source_m in sources_m]) for pose in POSES
        ]

    @staticmethod
    def _received(
        array: HelicalArray, rng: np.random.Generator, pose: tuple[float, float, float], source_m: tuple[float, ...]
    ) -> FloatArray:
        source = DischargeSource(
            name="s", position_m=np.array(source_m), amplitude_v=0.27, pulse_rate_hz=6.0, n_shots=N_SHOTS
        )
        x, y, yaw_deg = pose
        at = level_transform(np.array([x, y, np.radians(yaw_deg)]))
        return listen_once(RECEIVER, array, Scene([source]), rng, world_from_array=at, duration_s=1.0).waveforms_v

    def write(self, folder: Path, counts_v: float = 2e-5, offsets_v: FloatArray | float = 0.0) -> Path:
        """Write one file of counts for each pose, and the table of the survey."""
        rows = ["time_s,x_m,y_m,yaw_deg,waveform"]
        for k, (pose, volts) in enumerate(zip(self.poses, self.volts, strict=True)):
            counts = np.round((volts + np.reshape(offsets_v, (-1, 1))) / counts_v).astype(np.int32)
            np.savez(folder / f"s{k}.npz", waveforms=counts, volts_per_count=counts_v, sample_rate_hz=20e9)
            rows.append(f"{20 * k},{pose[0]:.3f},{pose[1]:.3f},{pose[2]:.2f},s{k}.npz")
        (folder / "t.csv").write_text("\n".join(rows))
        return folder / "t.csv"


def clipped(folder: Path, seed: int) -> Report:
    """Locate with an oscilloscope of 8 bits whose rails are between a fifth and the whole of the largest sample."""
    recording = Recording(seed, SOURCE_M)
    rail_v = np.random.default_rng(seed).uniform(0.2, 1.0) * max(np.abs(volts).max() for volts in recording.volts)
    step_v = rail_v / 128
    recording.volts = [np.clip(np.round(v / step_v), -128, 127) * step_v for v in recording.volts]
    return locate(recording.write(folder, step_v), noise_v=None)


def with_offsets(folder: Path, seed: int) -> Report:
    """Locate with weak pulses and offsets of up to five standard deviations of the noise."""
    recording = Recording(seed, SOURCE_M)
    rng = np.random.default_rng(seed)
    recording.volts = [0.3 * volts + rng.normal(0.0, 1e-3, volts.shape) for volts in recording.volts]
    return locate(recording.write(folder, offsets_v=rng.uniform(-5e-3, 5e-3, 6)), noise_v=None)


def in_one_record(folder: Path, seed: int) -> Report:
    """Locate with all pulses of two sources at a pose in one record, in random order."""
    recording = Recording(seed, SOURCE_M, OTHER_M)
    rng = np.random.default_rng(seed)
    recording.volts = [np.concatenate(volts[rng.permutation(len(volts))], axis=-1) for volts in recording.volts]
    return locate(recording.write(folder), noise_v=None)
