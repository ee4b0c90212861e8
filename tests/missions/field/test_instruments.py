"""Files of instruments: text of many vendors, binary files, and files of other kinds."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.missions.field.instruments import WaveformRecord, matlab, read_record
from pdpatrol.missions.field.instruments.oscilloscope import N_SEGMENTS
from tests.missions.field.dialects import DIALECTS, STEP_S
from tests.missions.field.surveys import SHARED

SCOPES = SHARED / "data" / "scopes"
needs_scopes = pytest.mark.skipif(not SCOPES.exists(), reason="the files of oscilloscopes are not in the repository")


def noise(*shape: int) -> FloatArray:
    """Return samples of 1 mV in steps of a microvolt."""
    return np.round(np.random.default_rng(3).normal(0.0, 1e-3, shape), 6)


@pytest.mark.parametrize("vendor", DIALECTS)
def test_text_of_each_vendor_is_the_same_record(tmp_path: Path, vendor: str) -> None:
    volts = noise(4, 300)
    (tmp_path / "w.csv").write_text(DIALECTS[vendor](volts), encoding="utf-8", newline="\r\n")
    record = read_record(tmp_path / "w.csv")
    np.testing.assert_allclose(record.volts[0], volts, atol=1e-9)
    assert record.sample_rate_hz == pytest.approx(1 / STEP_S, rel=1e-4)


@pytest.mark.parametrize(("delay_s", "digits"), [(5e-3, "{:.10f}"), (4.5e-6, "{:.5e}")])
def test_rate_comes_from_the_whole_span(tmp_path: Path, delay_s: float, digits: str) -> None:
    rows = [f"{digits.format(delay_s + k * STEP_S)},{k % 7},0,1" for k in range(2000)]
    (tmp_path / "w.csv").write_text("\n".join(["time_s,channel_1,channel_2,channel_3", *rows]))
    assert read_record(tmp_path / "w.csv").sample_rate_hz == pytest.approx(1 / STEP_S, rel=1e-3)


def test_millivolts_of_channels_without_times_are_read(tmp_path: Path) -> None:
    volts = noise(3, 50)
    text = DIALECTS["yokogawa"](1e3 * volts).replace('"VUnit",V,V,V', '"VUnit",mV,mV,mV')
    (tmp_path / "w.csv").write_text(text)
    np.testing.assert_allclose(read_record(tmp_path / "w.csv").volts[0], volts, atol=1e-8)


def test_times_that_fall_back_begin_a_segment(tmp_path: Path) -> None:
    volts = noise(3, 2, 100)
    rows = [f"{k * STEP_S:.3e},{v[0]},{v[1]}" for pulse in volts for k, v in enumerate(pulse.T)]
    (tmp_path / "w.csv").write_text("\n".join(["Time,Ampl1,Ampl2", *rows]))
    np.testing.assert_allclose(read_record(tmp_path / "w.csv").volts, volts, atol=1e-9)


def test_numbers_of_rohde_schwarz_need_their_header_file(tmp_path: Path) -> None:
    volts = noise(50)
    (tmp_path / "a.Wfm.csv").write_text("\n".join(f"{v:.6f}" for v in volts))
    with pytest.raises(ValueError, match=r"in the header file a\.csv next to it"):
        read_record(tmp_path / "a.Wfm.csv")
    (tmp_path / "a.csv").write_text(f"Resolution:{STEP_S:g}:\nXStart:-1e-9:\nRecordLength:50:\n")
    for name in ("a.csv", "a.Wfm.csv"):
        record = read_record(tmp_path / name)
        np.testing.assert_allclose(record.volts[0, 0], volts, atol=1e-9)
        assert record.sample_rate_hz == pytest.approx(1 / STEP_S)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "must have contents, is empty"),
        (b"Dear Sir,\nthere is a discharge.\n", "line 2 must be a row of numbers"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(80), "must be text or a binary file of a known oscilloscope"),
        (b"WAVEDESC\0\0\0\0\0\0\0\0LECROY_2_3\0\0\0\0\0\0" + bytes(100), "must be text or a binary file of a known"),
        (b"TDSm\x0e\0\0\0", "must be a TDMS file|must have channels of one length"),
        (b"\x89HDF\r\n\x1a\n" + bytes(20), "must be an HDF5 file"),
        (b"MATLAB 5.0 MAT-file" + bytes(120), "must be a MATLAB file|must have a rate"),
        (b"PK\x03\x04 and more", "must be an .npz archive"),
        (b"Time,CH1,CH2\n0,1,2\n1e-9,2,3\n2e-9,3\n", "line 4 must have 3 numbers as the line before it, got '2e-9,3'"),
        (b"Time (s),CH1 (dBm)\n0,1\n1e-9,2\n2e-9,3\n", "channel 1 must be in volts, got dbm"),
        (b"Time,CH1\n0,1\n1e-9,2\n5e-9,3\n", "the column of times must rise in even steps"),
        (b"0,1\n1,2\n2,3\n3,OVER\n4,5\n5,6\n6,7\n", "line 4 must have 2 numbers, got '3,OVER'"),
    ],
    ids=range(12),
)
def test_other_or_damaged_file_is_one_error(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "w").write_bytes(content)
    with pytest.raises(ValueError, match=message) as refused:
        read_record(tmp_path / "w")
    assert "\n" not in str(refused.value)


ROWS = [(k * STEP_S, *column) for k, column in enumerate(noise(3, 400).T)]


def lines_of(header: str = "time_s,c1,c2,c3", row: str = "{:.5e},{:.5e},{:.5e},{:.5e}") -> list[str]:
    """Return the lines of a file with a time and three channels."""
    return [header, *(row.format(*values) for values in ROWS)]


def changed(lines: list[str], at: int, text: str) -> list[str]:
    """Replace a line, counted from 1."""
    return [*lines[: at - 1], text, *lines[at:]]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (changed(lines_of(), 160, "7.9e-09,4,49754e-03,2.93884e-03,2.71070e-03"), "line 160 must have 4 numbers"),
        (changed(lines_of(), 160, "7.9e-09,1,2,3,9"), "line 160 must have 4 numbers"),
        (changed(lines_of(), 401, lines_of()[-1][:-4]), "line 401 must have 4 numbers .* is the file cut off"),
        (
            changed(lines_of(row="{:.3e},{:+.6f},{:+.6f},{:+.6f}"), 401, "2e-8,+0.001,+0.001,+0.00"),
            "is the file cut off",
        ),
        (changed(changed(lines_of(), 400, "1e-8,1,2,OVER"), 401, "1e-8,1,2,OVER"), "line 400 must be a row of numbers"),
        ([*lines_of()[:200], *lines_of(row="{:.5e},{:.5e},{:.5e}")[200:]], "line 200 must have 3 numbers"),
        (lines_of("time_s,c1 (mV),c2 (pC),c3"), "channel 2 must be in volts, got pc"),
        (["s,mV,mV,counts", *lines_of()[1:]], "channel 3 must be in volts, got counts"),
        (["Vertical Units,VV,V,V", *lines_of()], "channel 1 must be in volts, got vv"),
        (lines_of("Time,CH1,CH2"), "rows must have 3 numbers as the header has names, got 4"),
        (["Sample Interval,5e-11", *lines_of("a,b,c,Time")], "column 4 must be a channel, got times"),
        (changed(lines_of(), 401, "inf,1.00000e-03,1.00000e-03,1.00000e-03"), "times must be finite"),
        (lines_of(row="{:.5e},{:.5e},{:.5e},{:.5e}")[:23], ""),
        (lines_of(row="{:.9f},{:.5e},{:.5e},{:.5e}")[:23], "times must have more digits"),
        (changed(changed(lines_of(), 151, lines_of()[151]), 152, lines_of()[150]), "they first fall in row 151"),
        ([*lines_of(), *lines_of()[101:]], "segments of one length|same times"),
        ([*lines_of()[:201], *lines_of()[201:]], ""),
        (["Record Length,500", *lines_of()], "must have 500 samples as its header states, got 400"),
        (["Segments,2,SegmentSize,500", *lines_of()], "must have 500 samples as its header states, got 400"),
    ],
    ids=range(19),
)
def test_text_that_would_be_misread_is_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    (tmp_path / "w.csv").write_text("\n".join(lines))
    if not message:
        assert read_record(tmp_path / "w.csv").samples.shape == (1, 3, len(lines) - 1)
        return
    with pytest.raises(ValueError, match=message):
        read_record(tmp_path / "w.csv")


@pytest.mark.parametrize(
    ("header", "row", "factor"),
    [
        ("Time in s,CH1 in mV,CH2 in mV,CH3 in mV", "{:.4e},{:.6e},{:.6e},{:.6e}", 1e-3),
        ("t/s;U1/mV;U2/mV;U3/mV", "{:.4e};{:.6e};{:.6e};{:.6e}", 1e-3),
        ("Time (s),CH1 (mV AC),CH2 (mVolt),CH3 (millivolts)", "{:.4e},{:.6e},{:.6e},{:.6e}", 1e-3),
        ("s,mV,mV,mV", "{:.4e},{:.6e},{:.6e},{:.6e}", 1e-3),
        ("time_s,channel_A,channel_B,channel_W", "{:.4e},{:.6e},{:.6e},{:.6e}", 1.0),
        ("t north south west", "{:.4e} {:.6e}  {:.6e} {:.6e}", 1.0),
        ("CH1V,CH2V,CH3V,t0 =-2.5e-09, tInc = 5e-11,", "{1:.6e},{2:.6e},{3:.6e},,", 1.0),
        ("Sample Interval,50,ps\nCH1,CH2,CH3", "{1:.6e},{2:.6e},{3:.6e}", 1.0),
        ("Sample Rate (GS/s),20\nCH1,CH2,CH3", "{1:.6e},{2:.6e},{3:.6e}", 1.0),
        ("Sample Rate,20 GSa/s\nCH1,CH2,CH3", "{1:.6e},{2:.6e},{3:.6e}", 1.0),
        ("Time,A,Time,B,Time,C", "{0:.4e},{1:.6e},{0:.4e},{2:.6e},{0:.4e},{3:.6e}", 1.0),
        ("s,Volts,s,Volts,s,Volts", "{0:.4e},{1:.6e},{0:.4e},{2:.6e},{0:.4e},{3:.6e}", 1.0),
        ("Point,Time,CH1,CH2,CH3", "{4},{0:.4e},{1:.6e},{2:.6e},{3:.6e}", 1.0),
        ("Sample Interval,5e-11\nPoint,Time,CH1,CH2,CH3", "{4},{0:.4e},{1:.6e},{2:.6e},{3:.6e}", 1.0),
    ],
    ids=range(14),
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_text_of_other_programs_is_read(tmp_path: Path, header: str, row: str, factor: float, encoding: str) -> None:
    rows = [row.format(*values, k) for k, values in enumerate(ROWS)]
    (tmp_path / "w.csv").write_text("\n".join([header, *rows, ""]), encoding=encoding)
    record = read_record(tmp_path / "w.csv")
    np.testing.assert_allclose(record.volts[0], factor * np.array(ROWS)[:, 1:].T, atol=1e-9)
    assert record.sample_rate_hz == pytest.approx(1 / STEP_S)


def test_decimal_commas_are_found_in_several_lines(tmp_path: Path) -> None:
    lines = [row.replace(".", ",") for row in lines_of("t;a;b;c", "{:.4e};{:.6f};{:.6f};{:.6f}")]
    (tmp_path / "w.csv").write_text("\n".join([*lines, "2e-08;0;0;0", "2005e-11;0,1;0;0", ""]))
    assert read_record(tmp_path / "w.csv").volts[0, 0, -1] == 0.1


def test_decimal_commas_in_quotation_marks_are_read(tmp_path: Path) -> None:
    rows = [
        ",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(","))
        for line in lines_of(row="{:.4e},{:.7e},{:.7e},{:.7e}")
    ]
    (tmp_path / "w.csv").write_text("\n".join(rows))
    np.testing.assert_allclose(read_record(tmp_path / "w.csv").volts[0], np.array(ROWS)[:, 1:].T, atol=1e-9)


def test_units_left_of_the_rows_are_read(tmp_path: Path) -> None:
    """Older Tektronix oscilloscopes write keys and values to the left of the first rows."""
    keys = ["Record Length,400,Points", "Sample Interval,5e-11,s", "Vertical Units,mV,"] + [",,"] * 397
    rows = [f"{key},{t:.4e},{v:.6e}" for key, (t, v, *_) in zip(keys, ROWS, strict=True)]
    (tmp_path / "w.csv").write_text("\n".join([*rows, ""]))
    np.testing.assert_allclose(read_record(tmp_path / "w.csv").volts[0, 0], 1e-3 * np.array(ROWS)[:, 1], atol=1e-12)


def test_channels_that_start_later_are_refused(tmp_path: Path) -> None:
    for name, late_s in (("a", 0.0), ("b", 4e-9)):
        rows = [f"{t + late_s:.4e},{v:.6e}" for t, v, *_ in ROWS]
        (tmp_path / name).write_text("\n".join(["time,v", *rows, ""]))
    records = [read_record(tmp_path / name) for name in "ab"]
    assert WaveformRecord.join([records[0]] * 2).samples.shape == (1, 2, 400)
    with pytest.raises(ValueError, match="must start at the same time, got 4e-09 s later in file 2"):
        WaveformRecord.join(records)


def test_units_after_names_are_read(tmp_path: Path) -> None:
    volts = noise(2, 100)
    rows = [f"{1e9 * k * STEP_S:.2f},{1e3 * a:.3f},{b:.6f}" for k, (a, b) in enumerate(volts.T)]
    (tmp_path / "w.csv").write_text("\n".join(["time_ns,channel_1_mV,channel_2_V", *rows]))
    record = read_record(tmp_path / "w.csv")
    np.testing.assert_allclose(record.volts[0], volts, atol=1e-9)
    assert record.sample_rate_hz == pytest.approx(1 / STEP_S)


def test_infinite_samples_of_picoscope_are_rails(tmp_path: Path) -> None:
    volts = noise(3, 300)
    text = DIALECTS["picoscope"](np.where(np.abs(volts) > 1.5e-3, np.copysign(np.inf, volts), volts))
    (tmp_path / "w.csv").write_text(text.replace("inf", "∞"), encoding="utf-8")
    (read_v,) = read_record(tmp_path / "w.csv").volts
    np.testing.assert_allclose(read_v, np.clip(volts, -1.5e-3, 1.5e-3), atol=5e-5)
    assert all((channel == channel.max()).sum() > 10 for channel in read_v)


def test_channels_in_columns_are_refused(tmp_path: Path) -> None:
    with (tmp_path / "w").open("wb") as file:
        np.savez(file, waveforms=noise(500, 3), sample_rate_hz=1 / STEP_S)
    with pytest.raises(ValueError, match=r"more samples than channels, got shape \(500, 3\): transpose"):
        read_record(tmp_path / "w")


def test_hdf5_with_two_sets_of_waveforms_is_refused(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "w", "w") as file:
        file["sample_rate_hz"], file["a/waveforms"], file["b/waveforms"] = 1 / STEP_S, noise(3, 500), noise(3, 500)
    with pytest.raises(ValueError, match="one dataset of each name, in all groups together; got several waveforms"):
        read_record(tmp_path / "w")


def test_matlab_and_hdf5_are_read(tmp_path: Path) -> None:
    h5py, savemat = pytest.importorskip("h5py"), pytest.importorskip("scipy.io").savemat
    volts = noise(3, 2, 500)
    savemat(tmp_path / "a", {"waveforms": volts, "sample_rate_hz": 1 / STEP_S}, appendmat=False)
    savemat(tmp_path / "b", {"A": volts[0, 0], "B": volts[0, 1], "Tinterval": STEP_S, "Length": 500.0}, appendmat=False)
    savemat(tmp_path / "d", {"A": volts[0, 0], "B": np.ones(500), "Tinterval": STEP_S}, appendmat=False)
    np.testing.assert_array_equal(read_record(tmp_path / "d").volts[0], [volts[0, 0], np.ones(500)])
    with h5py.File(tmp_path / "c", "w", userblock_size=512) as file:  # as MATLAB 7.3 writes it
        file["waveforms"], file["sample_rate_hz"] = volts.T, np.array([[1 / STEP_S]])
    with (tmp_path / "c").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    for name, expected in (("a", volts), ("b", volts[:1]), ("c", volts)):
        record = read_record(tmp_path / name)
        np.testing.assert_array_equal(record.volts, expected)
        assert record.sample_rate_hz == pytest.approx(1 / STEP_S)


def test_arrays_that_are_too_large_are_not_decompressed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    h5py, savemat = pytest.importorskip("h5py"), pytest.importorskip("scipy.io").savemat
    volts = {name: np.zeros(500) for name in "AB"}
    savemat(tmp_path / "a", {**volts, "Tinterval": STEP_S}, appendmat=False, do_compression=True)
    with h5py.File(tmp_path / "b", "w") as file:
        for name, channel in volts.items():
            file.create_dataset(name, data=channel, compression="gzip")
    monkeypatch.setattr(matlab, "MAX_BYTES", 7000)
    for name in "ab":
        with pytest.raises(ValueError, match=r"must be smaller than 0\.007 MB together"):
            read_record(tmp_path / name)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"A": np.zeros(200), "B": np.zeros(199), "Tinterval": STEP_S}, "must have one length, got A of 200, B of 199"),
        ({"A": np.zeros(200) + 1j, "B": np.zeros(200), "Tinterval": STEP_S}, "must be real numbers"),
        ({"A": np.zeros(200, np.int16), "Tinterval": STEP_S}, "whole numbers need volts_per_count"),
        ({"A": np.zeros(200), "t": np.append(np.arange(199), 260) * STEP_S}, "t must rise in even steps"),
        ({"A": np.zeros(200), "fs": 1e9, "Tinterval": STEP_S}, "must agree with fs, got 2e.10 and 1e.09 Hz"),
    ],
)
def test_ambiguous_matlab_file_is_refused(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    pytest.importorskip("scipy.io").savemat(tmp_path / "a", arrays, appendmat=False)
    with pytest.raises(ValueError, match=message):
        read_record(tmp_path / "a")


def test_datasets_of_hdf5_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    h5py, volts = pytest.importorskip("h5py"), noise(12, 200)
    with h5py.File(tmp_path / "w", "w") as file:
        file["Tinterval"], file["time_ns"] = STEP_S, 1e9 * STEP_S * np.arange(200)
        for k, channel in enumerate(volts, start=1):
            file[f"channel_{k}"] = channel
    np.testing.assert_array_equal(read_record(tmp_path / "w").volts[0], volts)


@pytest.mark.parametrize(
    ("properties", "kind", "message"),
    [
        ({"unit_string": "A"}, np.float64, "c1 must be in volts, got A"),
        ({}, np.int16, "c1 must be scaled to volts, got whole numbers"),
        ({"wf_start_offset": 1e-8}, np.float64, "wf_start_offset must be equal in all channels, got 0 to 1e-08"),
    ],
)
def test_channel_of_tdms_that_is_not_in_volts_or_late_is_refused(
    tmp_path: Path, properties: dict[str, object], kind: type, message: str
) -> None:
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("p", f"c{k}", noise(500).astype(kind if k else np.float64), {"wf_increment": STEP_S} | own)
        for k, own in enumerate(({}, properties))
    ]
    with nptdms.TdmsWriter(tmp_path / "w") as writer:
        writer.write_segment(channels)
    with pytest.raises(ValueError, match=message):
        read_record(tmp_path / "w")


def test_cut_tdms_is_one_error_without_warnings(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "w") as writer:
        writer.write_segment([nptdms.ChannelObject("p", c, noise(500), {"wf_increment": STEP_S}) for c in "ab"])
    (tmp_path / "w").write_bytes((tmp_path / "w").read_bytes()[:-100])
    with pytest.raises(ValueError, match="must have channels of one length"):
        read_record(tmp_path / "w")
    assert capfd.readouterr() == ("", "")


def test_millivolts_of_tdms_are_read(tmp_path: Path) -> None:
    nptdms, volts = pytest.importorskip("nptdms"), noise(500)
    about = {"wf_increment": STEP_S, "unit_string": "mV"}
    with nptdms.TdmsWriter(tmp_path / "w") as writer:
        writer.write_segment([nptdms.ChannelObject("p", "c", 1e3 * volts, about)])
    np.testing.assert_allclose(read_record(tmp_path / "w").volts[0, 0], volts, atol=1e-12)


def isf(unit: str, n: int, n_stated: int) -> bytes:
    """Return a file of a Tektronix oscilloscope with n samples."""
    head = (
        f":WFMPRE:NR_PT {n_stated};BYT_NR 2;BIT_NR 16;ENCDG BIN;BN_FMT RI;BYT_OR MSB;XINCR {STEP_S};XZERO 0.0;PT_OFF 0;"
    )
    head += f'YUNIT "{unit}";YMULT 1.0E-4;YOFF 0.0;YZERO 0.0;XUNIT "s";WFID "Ch1";:CURVE '
    body = np.arange(n, dtype=">i2").tobytes()
    return head.encode() + f"#{len(str(len(body)))}{len(body)}".encode() + body


def test_header_of_a_tektronix_file_is_checked(tmp_path: Path) -> None:
    pytest.importorskip("RigolWFM")
    (tmp_path / "w.isf").write_bytes(isf("V", 200, 200))
    np.testing.assert_allclose(read_record(tmp_path / "w.isf").volts[0, 0], 1e-4 * np.arange(200), atol=1e-9)
    for content, message in (
        (isf("A", 200, 200), "must be in volts, got A"),
        (isf("V", 150, 200), "must have 200 samples"),
    ):
        (tmp_path / "w.isf").write_bytes(content)
        with pytest.raises(ValueError, match=message):
            read_record(tmp_path / "w.isf")


def test_groups_of_tdms_are_segments(tmp_path: Path) -> None:
    nptdms, volts = pytest.importorskip("nptdms"), noise(3, 2, 500)
    with nptdms.TdmsWriter(tmp_path / "w") as writer:
        for k, pulse in enumerate(volts):
            channels = [
                nptdms.ChannelObject(f"p{k}", f"c{c}", v, {"wf_increment": STEP_S}) for c, v in enumerate(pulse)
            ]
            writer.write_segment(channels)
    record = read_record(tmp_path / "w")
    np.testing.assert_array_equal(record.volts, volts)
    assert (record.channels, record.sample_rate_hz) == (("c0", "c1"), pytest.approx(1 / STEP_S))


def test_channels_of_sigmf_are_read(tmp_path: Path) -> None:
    sigmf, volts = pytest.importorskip("sigmf"), noise(2, 500)
    volts.T.astype("<f4").tofile(tmp_path / "w.sigmf-data")
    about = {"core:datatype": "rf32_le", "core:sample_rate": 1 / STEP_S, "core:num_channels": 2}
    recording = sigmf.SigMFFile(data_file=tmp_path / "w.sigmf-data", global_info=about)
    recording.add_capture(0)
    recording.tofile(tmp_path / "w.sigmf-meta")
    for name in ("w.sigmf-meta", "w.sigmf-data"):
        np.testing.assert_allclose(read_record(tmp_path / name).volts[0], volts, atol=1e-9)


@needs_scopes
@pytest.mark.parametrize(
    ("name", "shape", "rate_hz"),
    [
        ("DHO824-ch12.bin", (1, 2, 10000), 2.5e6),
        ("DS1102E-B.wfm", (1, 1, 16384), 1e8),
        ("DS1102E-B.csv", (1, 1, 600), 5e7),
        ("DS2072A-5.wfm", (1, 2, 14000), 1e9),
        ("DS2072A-5.csv", (1, 2, 1400), 1e8),
        ("MSO5000-A.bin", (1, 4, 1000), 2e5),
        ("agilent_1.bin", (1, 1, 2000), 2e6),
        ("agilent_3.bin", (1, 2, 4000), 2e9),
        ("lecroy_3.trc", (20, 1, 502), 1e9),
        ("lecroy_4.trc", (1, 1, 502), 1e9),
        ("rs_rtp_01.bin", (1, 1, 4000), 8e5),
        ("rs_rtp_01.Wfm.bin", (1, 1, 4000), 8e5),
    ],
)
def test_files_of_oscilloscopes_have_the_shape_of_their_headers(
    name: str, shape: tuple[int, ...], rate_hz: float
) -> None:
    record = read_record(SCOPES / name)
    assert (record.samples.shape, record.sample_rate_hz) == (shape, pytest.approx(rate_hz, rel=1e-6))


@needs_scopes
def test_segments_of_different_lengths_are_refused(tmp_path: Path) -> None:
    data = bytearray((SCOPES / "lecroy_3.trc").read_bytes())
    data[data.index(b"WAVEDESC") + N_SEGMENTS] = 7
    (tmp_path / "seven.trc").write_bytes(data)
    with pytest.raises(ValueError, match="must have 7 segments of one length as its header states, got 10040 samples"):
        read_record(tmp_path / "seven.trc")


@needs_scopes
def test_binary_file_is_the_csv_of_the_vendor() -> None:
    volts, text = read_record(SCOPES / "rs_rtp_01.bin").volts[0, 0], np.loadtxt(SCOPES / "rs_rtp_01.Wfm.csv")
    assert np.abs(volts - text).max() < 0.5 * np.diff(np.unique(text)).min()
