"""Files of instruments: text of many vendors, binary files, and files of other kinds."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.missions.field.instruments import read_record
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
    with h5py.File(tmp_path / "c", "w", userblock_size=512) as file:  # as MATLAB 7.3 writes it
        file["waveforms"], file["sample_rate_hz"] = volts.T, np.array([[1 / STEP_S]])
    with (tmp_path / "c").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")
    for name, expected in (("a", volts), ("b", volts[:1]), ("c", volts)):
        record = read_record(tmp_path / name)
        np.testing.assert_array_equal(record.volts, expected)
        assert record.sample_rate_hz == pytest.approx(1 / STEP_S)


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
        ("lecroy_3.trc", (1, 1, 10040), 1e9),
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
def test_binary_file_is_the_csv_of_the_vendor() -> None:
    volts, text = read_record(SCOPES / "rs_rtp_01.bin").volts[0, 0], np.loadtxt(SCOPES / "rs_rtp_01.Wfm.csv")
    assert np.abs(volts - text).max() < 0.5 * np.diff(np.unique(text)).min()
