"""Files with data from the field: formats that mean the same, and every way a file can be wrong."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dirmusic import GainManifold, InputFileError
from pdpatrol.missions.field.field_data import read_field_data


def npz(path: Path, waveforms: np.ndarray, **more: object) -> None:
    np.savez(path, allow_pickle=False, waveforms=waveforms, **{"sample_rate_hz": 20e9, **more})  # pyright: ignore


def one_row(path: Path, name: str) -> Path:
    path.write_text(f"time_s,x_m,y_m,yaw_deg,waveform\n0,1,2,90,{name}\n")
    return path


def a_pulse(n_samples: int = 400) -> np.ndarray:
    pulse = np.zeros(n_samples)
    pulse[200:230] = np.sin(np.arange(30))
    clean = GainManifold.ring(6).gain(0.5)[:, np.newaxis] * pulse
    return clean + 0.01 * np.random.default_rng(9).standard_normal((6, n_samples))


def test_waveforms_from_csv_and_npz_in_volts_or_counts_are_the_same(tmp_path: Path) -> None:
    x = np.round(a_pulse(), 3)
    npz(tmp_path / "volts.npz", x)
    npz(tmp_path / "counts.npz", np.round(1000 * x).astype(np.int16)[np.newaxis], volts_per_count=1e-3)
    lines = ["time_s,channel_1,channel_2,channel_3,channel_4,channel_5,channel_6"]
    lines += [",".join([f"{k / 20e9:.6e}", *(f"{v:.3f}" for v in column)]) for k, column in enumerate(x.T)]
    (tmp_path / "text.csv").write_text("\n".join(lines))
    read = [read_field_data(one_row(tmp_path / "t.csv", name)) for name in ("volts.npz", "counts.npz", "text.csv")]
    for data in read[1:]:
        np.testing.assert_allclose(data.strengths_v, read[0].strengths_v, rtol=1e-9)
        np.testing.assert_allclose(data.variance_v2, read[0].variance_v2, rtol=1e-9)
    assert read[0].pose[0, 2] == pytest.approx(np.pi / 2)


def test_the_noise_of_a_waveform_is_measured_outside_its_gate(tmp_path: Path) -> None:
    npz(tmp_path / "w.npz", a_pulse(4000))
    data = read_field_data(one_row(tmp_path / "t.csv", "w.npz"))
    told = read_field_data(tmp_path / "t.csv", noise_v=0.01)
    np.testing.assert_allclose(data.variance_v2, told.variance_v2, rtol=0.15)


def with_nan(x: np.ndarray) -> np.ndarray:
    x[3, 7] = np.nan
    return x


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda p: npz(p, with_nan(a_pulse())), "NaN or infinite samples in channel 4"),
        (lambda p: npz(p, with_nan(a_pulse()) * np.inf), "NaN or infinite samples"),
        (lambda p: npz(p, a_pulse()[:2]), "2 channels; allowed are 3 or more"),
        (lambda p: npz(p, a_pulse()[:, :50]), "50 samples; allowed are as many as the gate has, 90"),
        (lambda p: npz(p, np.ones(5)), r"shape \(5,\)"),
        (lambda p: npz(p, a_pulse().astype(np.int16)), "volts_per_count"),
        (lambda p: npz(p, a_pulse(), sample_rate_hz=0.0), "sample_rate_hz: got"),
        (lambda p: np.savez(p, x=np.ones(3)), "no array waveforms, sample_rate_hz"),
        (lambda p: p.write_bytes(b"PK\x03\x04 broken"), "cannot be read"),
        (lambda p: np.savez(p, waveforms=np.array([{}]), sample_rate_hz=1.0), "cannot be read|pickle"),
        (lambda p: None, "no such file"),
    ],
)
def test_a_broken_waveform_is_refused_by_line_and_file(
    tmp_path: Path, make: Callable[[Path], object], told: str
) -> None:
    make(tmp_path / "w.npz")
    with pytest.raises(InputFileError, match=told) as refused:
        read_field_data(one_row(tmp_path / "t.csv", "w.npz"))
    assert refused.value.faults[0].startswith(f"{tmp_path / 't.csv'}: line 2: waveform: w.npz: ")


HEADER = "time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_3"


def test_a_phase_of_the_mains_is_the_same_a_turn_earlier_or_later(tmp_path: Path) -> None:
    rows = (f"0,0,0,0,1,2,3,{phase_deg}" for phase_deg in (-90, 270, -360, 360))
    (tmp_path / "t.csv").write_text("\n".join([f"{HEADER},mains_phase_deg", *rows]))
    data = read_field_data(tmp_path / "t.csv", noise_v=0.01)
    assert np.allclose(data.mains_phase_rad, [1.5 * np.pi, 1.5 * np.pi, 0.0, 0.0])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"{HEADER}\n0,0,0,0,1,2\n", "line 2: got 6 cells; allowed are 7"),
        (f"{HEADER}\n0,0,0,0,1,2,nan\n", "line 2: strength_3: got 'nan'; allowed is a number"),
        (f"{HEADER}\n0,0,0,0,1,2,-1\n", "line 2: strength_3: got -1; allowed is 0 V or more"),
        (f"{HEADER}\n0,0,0,0,1,2,3\n\n-1,0,0,0,1,2,3\n", "line 4: time_s: -1 after 0"),
        (f"{HEADER}\n0,0,0,1e4,1,2,3\n", "line 2: yaw_deg: got 1e4; allowed is -720 to 720"),
        (f"{HEADER}\n0,4e6,0,0,1,2,3\n", "line 2: x_m: got 4e6; allowed is .* in a frame of the site"),
        (f"{HEADER}\n0,0,0,0,0,0,0\n", "no channel gave anything"),
        (f"{HEADER}\n0,0,0,0,1,0,1\n", "only 2 channels gave anything; allowed are 3"),
        (f"{HEADER},phase\n0,0,0,0,1,2,3,4\n", "unknown column phase"),
        (f"{HEADER},mains_phase_deg\n0,0,0,0,1,2,3,400\n", "line 2: mains_phase_deg: got 400"),
        (f"{HEADER},std_1\n0,0,0,0,1,2,3,4\n", "columns std_1; allowed are std_1 to std_3"),
        (f"{HEADER},waveform\n0,0,0,0,1,2,3,w.npz\n", "has both of strength_1"),
        ("time_s,x_m,y_m,yaw_deg\n0,0,0,0\n", "has neither of strength_1"),
        ("time_s,x_m,yaw_deg,strength_1,strength_2,strength_4\n0,0,0,1,1,1\n", "no column y_m"),
        ("time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_4\n0,0,0,0,1,1,1\n", "allowed are strength_1 to"),
        ("time_s,x_m,y_m,yaw_deg,strength_1,strength_2\n0,0,0,0,1,1\n", "2 strength columns; allowed are 3"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_refused_by_line(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputFileError, match=told):
        read_field_data(tmp_path / "t.csv", noise_v=1.0)


def test_strengths_without_any_deviation_are_refused(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{HEADER}\n0,0,0,0,1,2,3\n")
    with pytest.raises(InputFileError, match="no columns std_1 to std_3 and no --noise-v"):
        read_field_data(tmp_path / "t.csv")
