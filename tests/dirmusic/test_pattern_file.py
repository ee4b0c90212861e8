"""Pattern files: round trips, formats and errors."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import (
    GainManifold,
    GaussianPattern,
    InputFileError,
    TabulatedPattern,
    estimate_bearings,
    read_pattern,
    write_pattern,
)

OFF = np.radians(np.linspace(-180.0, 180.0, 1441))
SMOOTH = np.abs(np.abs(np.degrees(OFF) - 153.0)) > 4.0  # eq. (1) has a step there, which no spline follows


@pytest.mark.parametrize(("name", "most"), [("p.csv", 1e-9), ("p.msi", 2e-5), ("p.PLN", 2e-5)])
def test_written_pattern_reads_back_equal(tmp_path: Path, name: str, most: float) -> None:
    pattern = TabulatedPattern(np.radians(np.arange(360)), GaussianPattern()(np.radians(np.arange(360))))
    write_pattern(pattern, tmp_path / name)
    again = read_pattern(tmp_path / name)
    nodes = np.radians(np.arange(-180.0, 180.0))
    scale = 1.0 if name.endswith("csv") else pattern(nodes).max()  # MSI keeps the gain relative to the peak
    np.testing.assert_allclose(scale * again(nodes), pattern(nodes), atol=most)


@pytest.mark.parametrize("name", ["p.csv", "p.msi"])
def test_pattern_from_file_is_not_mirrored(tmp_path: Path, name: str) -> None:
    # eq. (1) is not symmetric: a file read mirrored would be off by degrees
    write_pattern(GaussianPattern(), tmp_path / name)
    pattern = read_pattern(tmp_path / name)
    np.testing.assert_allclose(
        pattern(OFF[SMOOTH]) / pattern(0.0), GaussianPattern()(OFF[SMOOTH]) / GaussianPattern()(0.0), atol=1e-3
    )
    azimuth = np.radians(np.arange(0.5, 360.0, 7.0))
    strengths = GainManifold.ring(6).gain(azimuth).T[:, np.newaxis]
    found = estimate_bearings(strengths, GainManifold.ring(6, pattern)).azimuth_rad
    assert np.degrees(np.abs(np.angle(np.exp(1j * (found - azimuth))))).max() < 0.3


@pytest.mark.parametrize("name", ["p.csv", "p.msi", None])
def test_pattern_slopes_match_differences(tmp_path: Path, name: str | None) -> None:
    pattern = GaussianPattern()
    if name:
        write_pattern(pattern, tmp_path / name)
        pattern = read_pattern(tmp_path / name)
    angle, step = OFF[SMOOTH], 1e-6
    difference = (pattern(angle + step) - pattern(angle - step)) / (2 * step)
    np.testing.assert_allclose(pattern.derivative(angle), difference, atol=1e-6)


def table(step_deg: float = 10.0, first: float = -180.0) -> list[tuple[float, float]]:
    angles = np.arange(first, first + 360.0, step_deg)
    return list(zip(angles.tolist(), GaussianPattern()(np.radians(angles)).tolist(), strict=True))


def write(path: Path, rows: list[tuple[float, float]], header: str = "angle_deg,gain") -> Path:
    path.write_text("\n".join([header, *(f"{a:g},{g:.8f}" for a, g in rows), ""]))
    return path


def test_decibels_comments_and_closing_row_are_read(tmp_path: Path) -> None:
    rows = table()
    plain = read_pattern(write(tmp_path / "plain.csv", rows))
    closed = [*rows, (180.0, rows[0][1])]
    decibel = [(a, 20 * np.log10(g)) for a, g in closed]
    text = "# measured on a turntable\n\nangle_deg,gain_db\n" + "\n".join(f"{a},{g}" for a, g in decibel) + "\n\n"
    (tmp_path / "decibel.csv").write_text(text)
    np.testing.assert_allclose(read_pattern(tmp_path / "decibel.csv")(OFF), plain(OFF), atol=1e-7)


def test_semicolons_decimal_commas_and_byte_order_mark_are_read(tmp_path: Path) -> None:
    rows = table()
    plain = read_pattern(write(tmp_path / "plain.csv", rows))
    text = "angle_deg;gain\r\n" + "\r\n".join(f"{a};{g:.8f}".replace(".", ",") for a, g in rows)
    (tmp_path / "german.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    np.testing.assert_allclose(read_pattern(tmp_path / "german.csv")(OFF), plain(OFF), atol=1e-12)


def broken(rows: list[tuple[float, float]], at: int, row: tuple[float, float]) -> list[tuple[float, float]]:
    return [*rows[:at], row, *rows[at + 1 :]]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (broken(table(), 5, (-170.0, 0.3)), "line 7: angle_deg: must increase, -140 is followed by -170"),
        (broken(table(), 5, (-130.0, -0.3)), r"line 7: gain: must be an amplitude ratio above 0 .*, got -0.3\d*"),
        (broken(table(), 35, (185.0, 0.3)), "line 37: angle_deg: must lie within one turn from -180, got 185"),
        ([*table(), (180.0, 0.9)], "line 38: gain: must be 0.1.* as one turn before, got 0.9"),
        ([row for row in table() if abs(row[0]) > 25], "gap of 60.0 degrees after -30.0 degrees"),
        (table()[:3], "n >= 4"),
    ],
)
def test_invalid_row_is_named_by_file_and_line(tmp_path: Path, rows: list[tuple[float, float]], message: str) -> None:
    with pytest.raises(InputFileError, match=message) as refused:
        read_pattern(write(tmp_path / "wrong.csv", rows))
    assert all("wrong.csv: " in fault for fault in refused.value.faults)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.csv", b"", "must have a header"),
        ("a.csv", b"angle,gain\n0,1\n", "columns must be angle_deg and either gain or gain_db, got angle, gain"),
        ("a.csv", b"angle_deg,angle_deg\n0,1\n", "got angle_deg, angle_deg"),
        (
            "a.csv",
            b"angle_deg,gain\n0,1\n10\n20,1,3\n",
            r"line 3: must have 2 cells .*, has 1(.|\n)*line 4",
        ),
        ("a.csv", b"angle_deg;gain\n0;1.000,5\n", "must be a number, got '1.000,5'"),
        ("a.csv", b"\xff\xfea\x00n\x00", "must be UTF-8 text"),
        ("a.csv", b"angle_deg,gain\n0,1e999\n", "1e999"),
        ("a.txt", b"angle_deg,gain\n0,1\n", "name must end in .csv"),
        ("none.csv", None, "cannot be read"),
        ("a.msi", b"NAME x\n", "must have one line that begins with HORIZONTAL, has 0"),
        ("a.msi", b"NAME x\nHORIZONTAL 5\n0 1\n1 1\nVERTICAL 1\n", "must be followed by 5 >= 4 rows, has 2"),
        (
            "a.msi",
            b"HORIZONTAL 4\n0 1\n90 -1\n180 1\n270 1\n",
            "line 3: attenuation_db: must be 0 to 200 dB",
        ),
        (
            "a.msi",
            b"HORIZONTAL 4\n0 1\n90 1 1\n180 1\n270 1\n",
            "line 3: must have angle and attenuation",
        ),
    ],
)
def test_invalid_pattern_file_is_refused(tmp_path: Path, name: str, data: bytes | None, message: str) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(InputFileError, match=message):
        read_pattern(tmp_path / name)


def test_flat_pattern_is_refused(tmp_path: Path) -> None:
    flat = read_pattern(write(tmp_path / "flat.csv", [(a, 1.0) for a, _ in table()]))
    with pytest.raises(ValueError, match="flat"):
        GainManifold.ring(6, flat)
