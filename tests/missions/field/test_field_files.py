"""Files of field data: equivalent formats, unusual units, and invalid files."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError, InputFileWarning
from pdpatrol.missions.field import field_data
from pdpatrol.missions.field.field_data import read_field_data
from tests.missions.field.surveys import EXAMPLE, locate
from tests.missions.files import hostile

TEXT = EXAMPLE.read_text(encoding="utf-8")
HEADER = "time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_3"
WAVEFORMS = "time_s,x_m,y_m,yaw_deg,waveform"


def npz(**changed: object) -> bytes:
    """Return an archive of one pulse in six channels with some arrays changed."""
    arrays = {**hostile.waveforms(np.random.default_rng(9)), **changed}
    return hostile.packed({name: np.asarray(array) for name, array in arrays.items()})


def table_of(folder: Path, name: str, n_rows: int = 1) -> Path:
    """Write a table that names a waveform file in each row."""
    path = folder / "t.csv"
    path.write_text("\n".join([WAVEFORMS, *(f"{k},1,2,90,{name}" for k in range(n_rows))]), encoding="utf-8")
    return path


def with_column(path: Path, column: str, change: Callable[[int, float], float]) -> Path:
    """Write the example with a column changed, row by row."""
    header, *rows = [line.split(",") for line in TEXT.splitlines()]
    at = header.index(column)
    for k, row in enumerate(rows):
        row[at] = f"{change(k, float(row[at])):.6f}"
    path.write_text("\n".join(",".join(row) for row in [header, *rows]), encoding="utf-8")
    return path


def test_waveforms_in_csv_volts_or_counts_are_the_same(tmp_path: Path) -> None:
    counts = hostile.waveforms(np.random.default_rng(9))["waveforms"]
    (tmp_path / "counts.npz").write_bytes(npz(waveforms=counts[np.newaxis]))
    (tmp_path / "volts.npz").write_bytes(npz(waveforms=1e-3 * counts, volts_per_count=1.0))
    lines = ["time_s,channel_1,channel_2,channel_3,channel_4,channel_5,channel_6"]
    lines += [",".join([f"{k / 20e9:.6e}", *(f"{1e-3 * c:.3f}" for c in column)]) for k, column in enumerate(counts.T)]
    (tmp_path / "text.csv").write_text("\n".join(lines))
    first, *others = [read_field_data(table_of(tmp_path, name)) for name in ("volts.npz", "counts.npz", "text.csv")]
    for data in others:
        np.testing.assert_allclose(data.pulses.strengths_v, first.pulses.strengths_v, rtol=1e-9)
        np.testing.assert_allclose(data.pulses.variance_v2, first.pulses.variance_v2, rtol=1e-9)
    assert first.pose[0, 2] == pytest.approx(np.pi / 2)


def test_noise_is_measured_outside_the_gate(tmp_path: Path) -> None:
    noise = np.round(10.0 * np.random.default_rng(1).standard_normal((6, 4000))).astype(np.int16)
    noise[:, :400] += hostile.waveforms(np.random.default_rng(9))["waveforms"]
    (tmp_path / "w.npz").write_bytes(npz(waveforms=noise))
    table = table_of(tmp_path, "w.npz")
    known = read_field_data(table, noise_v=0.01)
    np.testing.assert_allclose(read_field_data(table).pulses.variance_v2, known.pulses.variance_v2, rtol=0.15)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "cannot be read: No such file"),
        (hostile.packed({"x": np.ones(3)}), "must be an .npz archive .*'waveforms is not a file"),
        (hostile.packed({"waveforms": np.zeros(80_000_000)}), "must have at most 512 MB"),
        (npz(waveforms=np.ones(5)), r"waveforms must be numbers .* got float64 of shape \(5,\)"),
        (hostile.packed({"waveforms": np.ones((6, 400), int), "sample_rate_hz": np.array(2e10)}), "volts_per_count"),
        (npz(sample_rate_hz=0.0), r"sample_rate_hz must be from 0.001 to 1e\+15, got 0"),
        (npz(waveforms=np.full((6, 400), np.nan)), r"the largest sample in volts must be from 0 to 1e\+06, got nan"),
        (
            npz(waveforms=np.ones((2, 6 * 10**6))),
            r"samples of a pulse must be from 1 to 1e\+07, got 1.2e\+07",
        ),
        (npz(waveforms=np.ones((6, 50))), "the gate must have 4 to 50 samples; --gate-ns 4.5 is 90"),
    ],
    ids=range(9),
)
def test_broken_waveform_file_is_one_error(tmp_path: Path, data: bytes | None, message: str) -> None:
    if data is not None:
        (tmp_path / "w.npz").write_bytes(data)
    table = table_of(tmp_path, "w.npz", n_rows=5)
    with pytest.raises(InputFileError, match=message) as refused:
        read_field_data(table)
    (line,) = refused.value.faults
    assert line.startswith(f"{table}: line 2: waveform w.npz: ")
    assert len(line) < 400


def test_waveforms_of_two_channels_are_refused(tmp_path: Path) -> None:
    (tmp_path / "w.npz").write_bytes(npz(waveforms=hostile.waveforms(np.random.default_rng(9))["waveforms"][:2]))
    with pytest.raises(InputFileError, match=r"t.csv: must have 3 to 32 channels with a signal, got 2"):
        read_field_data(table_of(tmp_path, "w.npz"), noise_v=0.01)


def test_each_channel_of_a_row_has_a_file_of_its_own(tmp_path: Path) -> None:
    names = [("a.npz", "b.npz", "a.npz"), ("a.npz", "", "c.npz")]
    rows = [f"{k},0,0,0,{','.join(of_row)}" for k, of_row in enumerate(names)]
    (tmp_path / "t.csv").write_text("\n".join(["time_s,x_m,y_m,yaw_deg,waveform_1,waveform_2,waveform_3", *rows]))
    with pytest.raises(InputFileError) as refused:
        read_field_data(tmp_path / "t.csv")
    assert [error.partition(": ")[2] for error in refused.value.faults] == [
        "line 2: must have a different file for each channel, got a.npz twice",
        "line 3: must name a waveform file for each channel",
    ]


def test_repeated_waveform_file_is_noted(tmp_path: Path) -> None:
    (tmp_path / "w.npz").write_bytes(npz(waveforms=hostile.waveforms(np.random.default_rng(9))["waveforms"]))
    notes = read_field_data(table_of(tmp_path, "w.npz", n_rows=3)).notes
    assert any("2 rows with the waveforms of an earlier row" in note for note in notes)


def test_broken_waveform_table_is_one_error(tmp_path: Path) -> None:
    (tmp_path / "w.csv").write_text("time_s,channel_1,channel_2,channel_3\n" + "0,nan,nan,nan\n" * 200)
    with pytest.raises(InputFileError, match=r"line 2: waveform w.csv: line 2 must have 4 numbers") as refused:
        read_field_data(table_of(tmp_path, "w.csv", n_rows=3))
    assert len(refused.value.faults) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{HEADER}\n0,0,0,0,1,2\n", "line 2: must have 7 cells as the header has, got 6"),
        (f"{HEADER}\n0,0,0,0,1,2,x\n", "line 2: strength_3 must be a number, got 'x'"),
        (f"{HEADER}\n0,0,0,0,1,2,nan\n", "line 2: strength_3 must be a number from 0 to 1e.06, got nan"),
        (f"{HEADER}\n1e300,0,0,0,1,2,3\n", r"line 2: time_s must be a number from -5e.09 to 5e.09, got 1e\+300"),
        (f"{HEADER}\n0,0,0,0,1,2,3\n\n-1,0,0,0,1,2,3\n", "line 4: time_s must not decrease: 0 is followed by -1"),
        (f"{HEADER}\n0,0,0,0,0,0,0\n", "must have 3 to 32 channels with a signal, got 0"),
        (f"{HEADER},phase\n0,0,0,0,1,2,3,4\n", "column phase is unknown"),
        (f"{HEADER},std_1\n0,0,0,0,1,2,3,4\n", "column std_2, std_3 is missing"),
        (f"{HEADER[:-11]}\n0,0,0,0,1,1\n", "must have 3 to 32 channels with a signal, got 2"),
        (f"{HEADER},x_m\n0,0,0,0,1,2,3,4\n", "line 1: columns must have different names, got x_m twice"),
        (f",{HEADER}\n0,0,0,0,0,1,2,3\n", "line 1: column 1 must have a name"),
        (f"{HEADER}\ns,m,m,deg,V,V,V\n0,0,0,0,1,2,3\n", "line 2: time_s must be a number, got 's'"),
        (f"{HEADER};\n0;0;0;0;1;2;3\n".replace(",", ";"), "line 1: column 8 must have a name"),
        (
            f'{HEADER}\n0,0,0,0,1,2,"3\n4"\n1,0,0,0,1,2,3\n',
            "line 2: strength_3 must be|line 3: must have 7 cells as the header has, got 1",
        ),
        (TEXT.encode("utf-16"), "must be UTF-8 text"),
        ("", "must have a header and at least one row"),
        (
            f"{HEADER}\n0,0,0,0,-12,-9,-10\n",
            "strengths must be in volts, not in decibels: most are negative, such as -12",
        ),
    ],
    ids=range(17),
)
def test_wrong_table_is_refused_in_one_line(tmp_path: Path, text: str | bytes, message: str) -> None:
    (tmp_path / "t.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputFileError, match=message) as refused:
        read_field_data(tmp_path / "t.csv", noise_v=1.0)
    assert all(len(error) < 400 for error in refused.value.faults)


@pytest.mark.parametrize("separator", [";", "\t", ","])
def test_separators_and_decimal_commas_of_excel_are_read(tmp_path: Path, separator: str) -> None:
    text = TEXT.replace(",", ";").replace(".", ",") if separator == ";" else TEXT.replace(",", separator)
    (tmp_path / "t.csv").write_text(f"\ufeffsep={separator}\n{text}", encoding="utf-8", newline="\r\n")
    noted = pytest.warns(InputFileWarning, match="decimal sign") if separator == ";" else nullcontext()
    with noted:
        data = read_field_data(tmp_path / "t.csv")
    np.testing.assert_array_equal(data.pulses.strengths_v, read_field_data(EXAMPLE).pulses.strengths_v)


def test_separators_at_the_end_of_all_lines_are_skipped(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(TEXT.replace("\n", ",,\n") + ",,,,\n")
    data = read_field_data(tmp_path / "t.csv")
    np.testing.assert_array_equal(data.pulses.strengths_v, read_field_data(EXAMPLE).pulses.strengths_v)


def test_mains_phase_is_periodic(tmp_path: Path) -> None:
    rows = (f"0,0,0,0,1,2,3,{phase_deg}" for phase_deg in (-90, 270, -360, 360))
    (tmp_path / "t.csv").write_text("\n".join([f"{HEADER},mains_phase_deg", *rows]))
    data = read_field_data(tmp_path / "t.csv", noise_v=0.01)
    assert np.allclose(data.pulses.mains_phase_rad, [1.5 * np.pi, 1.5 * np.pi, 0.0, 0.0])


@pytest.mark.whole
def test_rejected_and_unexplained_pulses_are_noted(tmp_path: Path) -> None:
    """Pulses are too weak for a noise of 1 V; with swapped boresights no finding explains them."""
    without_noise = [",".join(line.split(",")[:10]) for line in TEXT.splitlines()]
    (tmp_path / "t.csv").write_text("\n".join(without_noise), encoding="utf-8")
    rejected = locate(tmp_path / "t.csv", noise_v=1.0)
    assert (rejected.pulses.rejected, rejected.n_bearings) == (84, 0)
    assert rejected.notes == (
        "all 84 pulses were rejected: 0 clipped, the others too weak for the noise (deviations, volts?)",
    )
    swapped = locate(EXAMPLE, noise_v=None, boresights_deg=(90.0, -150.0, 30.0, -90.0, 150.0, -30.0))
    assert (swapped.findings, swapped.pulses.unexplained) == ((), 84)
    (note,) = swapped.notes
    assert note.startswith("no finding explains any of 84 pulses: few poses, or wrong boresights")


@pytest.mark.whole
def test_pooled_poses_locate_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = with_column(tmp_path / "t.csv", "time_s", lambda k, time_s: time_s + 0.01 * (k % 6))
    (single,) = locate(table, noise_v=None).findings
    monkeypatch.setattr(field_data, "MAX_STEPS", 20)
    (note,) = read_field_data(table).notes
    assert note == "84 times and poses were pooled into 14: within 1 s, 0.1 m and 2 degrees"
    (pooled,) = locate(table, noise_v=None).findings
    apart_m = np.linalg.norm(np.subtract(single.position_m, pooled.position_m)[:2])
    assert apart_m < 0.1 * single.ellipse95.semi_major_m
