"""Make this example: one discharge, detected from fourteen poses by the simulated array and receiver.

    uv run python examples/locate/make_example.py

The array deviates from its data sheet by 5 % in gain and 2 degrees in pointing, and the poses by 5 cm and half a
degree, as in the shipped scenarios. Nothing obstructs or reflects the pulses.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from dirmusic import cut_windows, pulse_start, pulse_strengths, strength_variance
from pdpatrol.envs.motion import add_pose_error
from pdpatrol.envs.scenario.robot import PoseSensorConfig
from pdpatrol.sensing import ArrayConfig, DischargeSource, HelicalArray, ReceiverConfig, Scene, level_transform
from pdpatrol.sensing.receiver.bank import listen_once

HERE = Path(__file__).parent
SEED = 20
SOURCE = DischargeSource(
    name="bushing", position_m=np.array([14.0, 9.0, 1.9]), amplitude_v=0.27, pulse_rate_hz=6.0, n_shots=6
)
POSES = [  # x m, y m, yaw deg: past the source, then around it
    (4.0, 4.5, 0), (8.0, 4.5, 5), (10.0, 4.8, 10), (12.0, 5.2, 10), (14.0, 5.6, 20), (16.0, 6.4, 35),
    (17.4, 7.8, 60), (17.8, 9.6, 95), (17.0, 11.2, 130), (15.4, 12.2, 165), (11.6, 11.4, 215),
    (10.6, 9.8, 250), (10.6, 8.0, 280), (11.6, 6.6, 320),
]  # fmt: skip
DWELL_S = 20.0
GATE_SAMPLES = 90
VOLTS_PER_COUNT = 2e-5


def main() -> None:
    """Write the waveforms, both tables and the truth."""
    rng = np.random.default_rng(SEED)
    array = HelicalArray.draw(ArrayConfig(), rng)
    config = ReceiverConfig(band_hz="all", gate_samples=240, pretrigger_samples=110, false_alarm_rate_hz=1e-3)
    sensor = PoseSensorConfig()
    error, estimated = np.full(3, np.nan), np.empty(3)
    (HERE / "waveforms").mkdir(exist_ok=True)
    strength_rows: list[list[str]] = []
    waveform_rows: list[list[str]] = []
    for number, (x, y, yaw_deg) in enumerate(POSES, start=1):
        pose = np.array([x, y, np.radians(yaw_deg)])
        world_from_array = level_transform(pose)
        detected = listen_once(config, array, Scene([SOURCE]), rng, world_from_array=world_from_array, duration_s=1.0)
        add_pose_error(pose, error, sensor.correlation(DWELL_S), sensor.std, rng.standard_normal(3), estimated)
        place = [f"{DWELL_S * number:.1f}", *(f"{v:.3f}" for v in estimated[:2]), f"{np.degrees(estimated[2]):.2f}"]
        counts = np.round(detected.waveforms_v / VOLTS_PER_COUNT).astype(np.int16)
        name = f"waveforms/stop_{number:02d}.npz"
        np.savez_compressed(
            HERE / name,
            waveforms=counts,
            sample_rate_hz=config.sample_rate_hz,
            volts_per_count=VOLTS_PER_COUNT,
        )
        waveform_rows.append([*place, name])
        strength_rows += [[*place, *row] for row in strengths_and_deviations(detected.waveforms_v, config.noise_v)]
    pose_columns = ["time_s", "x_m", "y_m", "yaw_deg"]
    write(HERE / "waveforms.csv", [*pose_columns, "waveform"], waveform_rows)
    channels = [f"{kind}_{k + 1}" for kind in ("strength", "std") for k in range(6)]
    write(HERE / "strengths.csv", [*pose_columns, *channels], strength_rows)
    truth = {"name": SOURCE.name, "position_m": SOURCE.position_m.tolist()}
    (HERE / "truth.json").write_text(json.dumps(truth) + "\n", encoding="utf-8")


def strengths_and_deviations(waveforms_v: np.ndarray, noise_v: float) -> list[list[str]]:
    """Return strengths and standard deviations of each pulse as text, to the microvolt."""
    gate = cut_windows(waveforms_v, pulse_start(waveforms_v, GATE_SAMPLES), GATE_SAMPLES)
    strengths = pulse_strengths(gate, noise_v**2)
    deviations = np.sqrt(strength_variance(strengths, noise_v**2, GATE_SAMPLES))
    return [[f"{v:.6f}" for v in (*row, *std)] for row, std in zip(strengths, deviations, strict=True)]


def write(path: Path, header: list[str], rows: list[list[str]]) -> None:
    """Write a table with a header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


if __name__ == "__main__":
    main()
