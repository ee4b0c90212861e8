"""Field data in other units, in too many rows, or of no use: said in one line, and what Excel writes is read."""

import time
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError, InputFileWarning
from dirmusic.angles import difference
from dirmusic.locating import births
from pdpatrol.missions.cli.locate import LIMITS
from pdpatrol.missions.field import field_data
from pdpatrol.missions.field.array_model import array_model
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.locate_field_data import locate_field_data, rejections
from pdpatrol.missions.field.plausibility import doubts
from pdpatrol.missions.recording import write_recording
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.pulse_counts import in_words
from tests.missions.files import hostile
from tests.missions.files.test_hostile_files import EXAMPLE, POSE_ERROR, SPREAD
from tests.missions.files.test_replayed_files import pdpatrol

TEXT = EXAMPLE.read_text(encoding="utf-8")
STRENGTHS = "time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_3"
MANY = ",".join(["time_s,x_m,y_m,yaw_deg", *(f"strength_{k + 1}" for k in range(200))])
WAVEFORMS = "time_s,x_m,y_m,yaw_deg,waveform"


def scaled(path: Path, column: str, factor: float) -> Path:
    header, *rows = [line.split(",") for line in TEXT.splitlines()]
    k = header.index(column)
    rows = [[*row[:k], f"{float(row[k]) * factor:.6f}", *row[k + 1 :]] for row in rows]
    path.write_text("\n".join(",".join(row) for row in [header, *rows]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("column", "factor", "told"),
    [("yaw_deg", np.pi / 180, "looks like radians"), ("x_m", 1000.0, "looks like millimetres")],
)
def test_other_units_are_told_in_one_line_and_the_work_goes_on(
    tmp_path: Path, column: str, factor: float, told: str
) -> None:
    assert read_field_data(EXAMPLE).notes == ()
    (note,) = read_field_data(scaled(tmp_path / "t.csv", column, factor)).notes
    assert told in note
    assert len(note) < 160  # of an event in a log


def test_sensible_poses_raise_no_doubt() -> None:
    time_s = np.arange(100.0)
    for yaw_deg in (np.zeros(100), np.linspace(-1, 1, 100), np.linspace(-180, 180, 100)):
        for speed_m_s in (0.0, 0.5, 2.0):
            pose = np.column_stack([speed_m_s * time_s, np.full(100, 5.0), np.radians(yaw_deg)])
            assert doubts(time_s, pose) == []


@pytest.mark.parametrize(("size_m", "lasts_s"), [(20_000.0, 1e6), (500.0, 1.0)])
def test_a_site_too_wide_or_crossed_too_fast_looks_like_millimetres(size_m: float, lasts_s: float) -> None:
    pose = np.column_stack([np.linspace(0.0, size_m, 100), np.zeros((100, 2))])
    (doubt,) = doubts(np.linspace(0.0, lasts_s, 100), pose)
    assert "looks like millimetres" in doubt


@pytest.mark.parametrize("separator", [";", "\t", ","])
def test_the_line_that_excel_writes_names_the_separator(tmp_path: Path, separator: str) -> None:
    lines = f"\ufeffsep={separator}\n{TEXT.replace(',', separator)}".replace("\n", "\r\n")
    (tmp_path / "t.csv").write_text(lines, encoding="utf-8", newline="")
    with pytest.warns(InputFileWarning):
        read = read_field_data(tmp_path / "t.csv")
    np.testing.assert_array_equal(read.strengths_v, read_field_data(EXAMPLE).strengths_v)
    (tmp_path / "t.csv").write_text(f"sep=|\n{TEXT}", encoding="utf-8")
    with pytest.raises(InputFileError, match=r"line 1: got 'sep=\|'; allowed are comma, semicolon and tab"):
        read_field_data(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (TEXT.encode("utf-16"), "is UTF-16"),
        (b"PK\x03\x04", "is a ZIP archive or a workbook"),
        (b"\x1f\x8b\x08", "is a compressed file"),
        (f"{STRENGTHS}\n1e300,0,0,0,1,2,3\n".encode(), "line 2: time_s: got 1e300; allowed is -5e.09 to 5e.09 s"),
        (f"{STRENGTHS}\n0,0,0,0,1,2,1e9\n".encode(), "strength_3: got 1e9; allowed is 0 V or more, up to 1e.06"),
        (f"{STRENGTHS}\n0,0,0,0,1,2,{'1' * 90_000}\n".encode(), "strength_3: got 1{40}; allowed"),
        (f"{STRENGTHS}\n0,0,0,0,1,2,{'1' * 140_000}\n".encode(), "line 2: has more than 100000 characters"),
        (f'{STRENGTHS}\n0,0,0,0,1,2,"{"1" * 90_000}\n{"1" * 90_000}\n'.encode(), "line 2: a quoted cell goes on"),
        (f'{STRENGTHS}\n0,0,0,0,1,2,"3\n4"\n1,0,0,0,1,2,3\n'.encode(), "line 2: a quoted cell goes on"),
        (",".join(f"strength_{k}" for k in range(2000)).encode(), "2000 columns; allowed are up to 1000"),
        (f"{MANY}\n{'1,' * 203}1".encode(), "200 strength columns; allowed are 3 or more, up to 32"),
    ],
    ids=range(11),
)  # fmt: skip
def test_what_no_survey_holds_is_refused(tmp_path: Path, data: bytes, told: str) -> None:
    (tmp_path / "t.csv").write_bytes(data)
    with pytest.raises(InputFileError, match=told) as refused:
        read_field_data(tmp_path / "t.csv", noise_v=1e-3)
    assert all(len(fault) < 400 for fault in refused.value.faults)


def waveforms(**changed: object) -> bytes:
    arrays = {**hostile.waveforms(np.random.default_rng(1)), **changed}
    return hostile.packed({name: np.asarray(array) for name, array in arrays.items()})


ENCRYPTED = waveforms().replace(b"PK\x01\x02\x14\x03\x14\x00\x00\x00", b"PK\x01\x02\x14\x03\x14\x00\x01\x00")


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (hostile.bomb(), r"shape \(1000000000000,\) of float64 takes 8e\+06 MB; allowed are up to 512 MB"),
        (hostile.bomb("(1000, 2)"), "does not fit the 128 bytes that are there"),
        (ENCRYPTED, "is encrypted"),
        (waveforms()[:-900], "damaged or cut short"),
        (hostile.packed({"waveforms": np.ones(3)}, 14), "no array sample_rate_hz; it holds waveforms"),
        (waveforms(waveforms=np.array([{}] * 9)), "waveforms: holds a pickle"),
        (waveforms(sample_rate_hz=1.0), "sample_rate_hz: got 1.0; allowed is one number from 1e.06 to 1e.12"),
        (waveforms(sample_rate_hz=[20e9, 20e9]), "sample_rate_hz: got an array of shape"),
        (waveforms(volts_per_count=1e300), "volts_per_count: got 1e.300; allowed"),
        (waveforms(waveforms=np.ones((6, 400)) * 1e200), "samples of 1e.197 V; allowed are up to 1e.06 V"),
        (waveforms(waveforms=np.ones((200, 400))), "200 channels; allowed are 3 or more, up to 32"),
        (waveforms(sample_rate_hz=1e8), "a gate of 4.5 ns has 0 samples at 1e.08 Hz; allowed are 4 or more: --gate-ns"),
        (b"", "is empty"),
    ],
    ids=range(13),
)  # fmt: skip
def test_an_archive_that_is_none_is_refused_once_however_many_rows_name_it(
    tmp_path: Path, data: bytes, told: str
) -> None:
    (tmp_path / "w.npz").write_bytes(data)
    (tmp_path / "t.csv").write_text("\n".join([WAVEFORMS, *(f"{k},0,0,0,w.npz" for k in range(5))]))
    with pytest.raises(InputFileError, match=told) as refused:
        read_field_data(tmp_path / "t.csv")
    (line,) = refused.value.faults
    assert line.startswith(f"{tmp_path / 't.csv'}: line 2: waveform: w.npz: ")
    assert "allow_pickle" not in line


def test_a_wrong_table_of_a_waveform_is_one_line(tmp_path: Path) -> None:
    rows = [f"{k / 20e9:.4e},nan,nan,nan" for k in range(200)]
    (tmp_path / "w.csv").write_text("\n".join(["time_s,channel_1,channel_2,channel_3", *rows]))
    (tmp_path / "t.csv").write_text("\n".join([WAVEFORMS, *(f"{k},0,0,0,w.csv" for k in range(3))]))
    with pytest.raises(InputFileError) as refused:
        read_field_data(tmp_path / "t.csv")
    told = (
        f"{tmp_path / 't.csv'}: line 2: waveform: w.csv: line 2: channel_1: got 'nan'; allowed is a number (and more)"
    )
    assert refused.value.faults == (told,)


def test_where_all_pulses_are_rejected_it_is_said_why(tmp_path: Path) -> None:
    data = read_field_data(EXAMPLE)
    turned = array_model(data, SPREAD, None, (90.0, -150.0, 30.0, -90.0, 150.0, -30.0), 0.12, 0.6)
    log = locate_field_data(data, turned, POSE_ERROR)
    (why,) = rejections(log)
    assert why.startswith(f"all pulses were rejected: {data.strengths_v.shape[0]} no plane wave from one direction")
    assert in_words(make_report(log, 0.0).pulses).startswith("No discharge found. 84 pulses: all rejected, as no plane")
    right = array_model(data, SPREAD, None, None, 0.12, 0.6)
    assert rejections(locate_field_data(data, right, POSE_ERROR)) == []


def test_many_times_of_few_places_are_pooled_and_locate_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    header, *rows = [line.split(",") for line in TEXT.splitlines()]
    for k, row in enumerate(rows):
        row[0] = f"{float(row[0]) + 0.01 * (k % 6):.3f}"
    (tmp_path / "t.csv").write_text("\n".join(",".join(row) for row in [header, *rows]))
    single = read_field_data(tmp_path / "t.csv")
    monkeypatch.setattr(field_data, "MOST_STEPS", 20)
    pooled = read_field_data(tmp_path / "t.csv")
    assert single.notes == ()
    assert pooled.notes == ("84 times and poses, pooled into 14: within 1 s, 0.1 m and 2 degrees",)
    np.testing.assert_array_equal(pooled.strengths_v, single.strengths_v)
    found = []
    for data in (single, pooled):
        log = locate_field_data(data, array_model(data, SPREAD, None, None, 0.12, 0.6), POSE_ERROR)
        (finding,) = make_report(log, 0.0).findings
        found.append(finding)
    apart_m = np.linalg.norm(np.subtract(found[0].position_m, found[1].position_m)[:2])
    assert apart_m < 0.1 * found[0].ellipse95.semi_major_m


def test_every_option_of_locate_has_bounds_that_are_told(tmp_path: Path) -> None:
    values = {"--boresights-deg": ["nan"], "--yard-m": ["1e300", "5"]}
    wrong = [word for option in LIMITS for word in (option, *values.get(option, ["1e308"]))]
    done = pdpatrol("locate", str(EXAMPLE), *wrong, cwd=tmp_path)
    assert done.returncode == 2
    lines = done.stderr.strip().splitlines()
    assert len(lines) == len(LIMITS)
    assert all(f"{option}: got " in done.stderr for option in LIMITS)
    assert "--gate-ns: got 1e+308; allowed is above 0, 0.001 to 1e+06 ns" in lines
    assert list(tmp_path.iterdir()) == []


def test_bearings_near_each_other_are_counted_as_pair_by_pair() -> None:
    rng = np.random.default_rng(5)
    for n in (1, 6, 700):
        bearing_rad = rng.uniform(-9.0, 9.0, n)
        by_pairs = (np.abs(difference(bearing_rad[:, np.newaxis], bearing_rad)) < 0.14).sum(axis=0)
        np.testing.assert_array_equal(births._neighbours(bearing_rad, 0.14), by_pairs)


def test_a_survey_of_days_is_looked_at_ever_less_often(tmp_path: Path) -> None:
    header, *rows = TEXT.splitlines()
    hours = [f"{3600.0 * hour},{row.split(',', 1)[1]}" for hour, row in zip(range(600), cycle(rows), strict=False)]
    (tmp_path / "t.csv").write_text("\n".join([header, *hours]))
    data = read_field_data(tmp_path / "t.csv")
    looks = locate_field_data(data, array_model(data, SPREAD, None, None, 0.12, 0.6), POSE_ERROR).column(
        "likelihood", "step"
    )
    assert (np.diff(looks[:100]) == 1).all()  # hour by hour for four days
    assert np.diff(looks)[-10:-1].min() >= 5
    assert looks[-1] == len(hours) - 1


@pytest.mark.slow
def test_a_survey_of_five_times_the_pulses_takes_about_five_times_the_work(tmp_path: Path) -> None:
    header, *rows = [line.split(",") for line in TEXT.splitlines()]
    spent_s: list[float] = []
    for n_rounds in (1, 100, 500):  # the first compiles
        lines = [",".join([f"{float(row[0]) + 3600.0 * k:.1f}", *row[1:]]) for k in range(n_rounds) for row in rows]
        (tmp_path / "t.csv").write_text("\n".join([",".join(header), *lines]))
        before_s = time.process_time()
        data = read_field_data(tmp_path / "t.csv")
        log = locate_field_data(data, array_model(data, SPREAD, None, None, 0.12, 0.6), POSE_ERROR)
        assert len(make_report(log, 0.0).findings) == 1
        write_recording(log, tmp_path / "t.rrd")
        spent_s.append(time.process_time() - before_s)
    assert spent_s[2] < 8.0 * spent_s[1]
