"""Patterns from files: round trips, dialects, and every way in which a file can be wrong."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from dirmusic import (
    GainManifold,
    GaussianPattern,
    InputFileError,
    InputFileWarning,
    TabulatedPattern,
    estimate_bearings,
    read_pattern,
    write_pattern,
)

OFF = np.radians(np.linspace(-180.0, 180.0, 1441))
SMOOTH = np.abs(np.abs(np.degrees(OFF) - 153.0)) > 4.0  # eq. (1) has a step there, which no spline follows


@pytest.mark.parametrize(("name", "most"), [("p.csv", 1e-9), ("p.msi", 2e-5), ("p.PLN", 2e-5)])
def test_a_pattern_written_and_read_again_is_the_same_on_its_nodes(tmp_path: Path, name: str, most: float) -> None:
    pattern = TabulatedPattern(np.radians(np.arange(360)), GaussianPattern()(np.radians(np.arange(360))))
    write_pattern(pattern, tmp_path / name)
    again = read_pattern(tmp_path / name)
    nodes = np.radians(np.arange(-180.0, 180.0))
    scale = 1.0 if name.endswith("csv") else pattern(nodes).max()  # MSI keeps the gain relative to the peak
    np.testing.assert_allclose(scale * again(nodes), pattern(nodes), atol=most)


@pytest.mark.parametrize("name", ["p.csv", "p.msi"])
def test_a_pattern_from_a_file_points_to_the_same_side_and_gives_the_same_bearings(tmp_path: Path, name: str) -> None:
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
def test_slopes_of_all_patterns_are_their_differences(tmp_path: Path, name: str | None) -> None:
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


def test_decibels_comments_and_a_closing_row_are_understood(tmp_path: Path) -> None:
    rows = table()
    plain = read_pattern(write(tmp_path / "plain.csv", rows))
    closed = [*rows, (180.0, rows[0][1])]
    decibel = [(a, 20 * np.log10(g)) for a, g in closed]
    text = "# measured on a turntable\n\nangle_deg,gain_db\n" + "\n".join(f"{a},{g}" for a, g in decibel) + "\n\n"
    (tmp_path / "decibel.csv").write_text(text)
    np.testing.assert_allclose(read_pattern(tmp_path / "decibel.csv")(OFF), plain(OFF), atol=1e-7)


def test_semicolons_decimal_commas_and_a_byte_order_mark_are_understood_and_flagged(tmp_path: Path) -> None:
    rows = table()
    plain = read_pattern(write(tmp_path / "plain.csv", rows))
    text = "angle_deg;gain\r\n" + "\r\n".join(f"{a};{g:.8f}".replace(".", ",") for a, g in rows)
    (tmp_path / "german.csv").write_bytes(b"\xef\xbb\xbf" + text.encode())
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", InputFileWarning)
        pattern = read_pattern(tmp_path / "german.csv")
    assert [next(word for word in ("byte-order mark", "semicolons") if word in str(w.message)) for w in told] == [
        "byte-order mark",
        "semicolons",
    ]
    np.testing.assert_allclose(pattern(OFF), plain(OFF), atol=1e-12)


def broken(rows: list[tuple[float, float]], at: int, row: tuple[float, float]) -> list[tuple[float, float]]:
    return [*rows[:at], row, *rows[at + 1 :]]


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (broken(table(), 5, (-140.0, 0.3)), r"line 7: angle_deg: -140 is there twice"),
        (broken(table(), 5, (-170.0, 0.3)), r"line 7: angle_deg: -170 goes back"),
        (broken(table(), 5, (-130.0, -0.3)), r"line 7: gain: got -0.3\d*; allowed is an amplitude ratio above 0"),
        (broken(table(), 5, (-130.0, np.nan)), r"line 7: gain: got 'nan'; allowed is a number"),
        (broken(table(), 35, (185.0, 0.3)), r"line 37: angle_deg: 185 is past one turn"),
        ([*table(), (180.0, 0.9)], r"line 38: gain: 0.9 one turn after"),
        ([row for row in table() if abs(row[0]) > 25], "gap of 60.0 degrees after -30.0 degrees"),
        (table(90.0), "gap"),
        (table()[:3], "n >= 4"),
    ],
)
def test_a_wrong_row_is_named_by_file_and_line(tmp_path: Path, rows: list[tuple[float, float]], told: str) -> None:
    with pytest.raises(InputFileError, match=told) as refused:
        read_pattern(write(tmp_path / "wrong.csv", rows))
    assert all("wrong.csv: " in fault for fault in refused.value.faults)


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("a.csv", b"", "no line in it"),
        ("a.csv", b"angle_deg,gain\n", "no row"),
        ("a.csv", b"angle,gain\n0,1\n", "columns angle, gain; allowed are angle_deg and either gain or gain_db"),
        ("a.csv", b"angle_deg,gain,gain_db\n0,1,0\n", "either"),
        ("a.csv", b"angle_deg,angle_deg\n0,1\n", "there twice"),
        ("a.csv", b"angle_deg,gain\n0,1\n10\n20,1,3\n", r"line 3: got 1 cells(.|\n)*line 4: got 3 cells"),
        ("a.csv", b"angle_deg,gain\n0,1_000\n", "got '1_000'; allowed is a number"),
        ("a.csv", b"angle_deg;gain\n0;1.000,5\n", "allowed is a number"),
        ("a.csv", b"\xff\xfea\x00n\x00", "no UTF-8"),
        ("a.csv", b"angle_deg,gain\n0,1e999\n", "1e999"),
        ("a.txt", b"angle_deg,gain\n0,1\n", "ends in `.txt`"),
        ("none.csv", None, "cannot be read"),
        ("a.msi", b"NAME x\n", "0 lines begin with HORIZONTAL"),
        ("a.msi", b"NAME x\nHORIZONTAL many\n0 1\n", "line 2: got 'HORIZONTAL many'"),
        ("a.msi", b"NAME x\nHORIZONTAL 5\n0 1\n1 1\nVERTICAL 1\n", "announces 5 rows; 2 follow"),
        ("a.msi", b"HORIZONTAL 4\n0 1\n90 -1\n180 1\n270 1\n", "line 3: attenuation_db: got -1"),
        ("a.msi", b"HORIZONTAL 4\n0 1\n90 1 1\n180 1\n270 1\n", "line 3: got 3 values"),
    ],
)
def test_a_file_that_is_no_pattern_says_why(tmp_path: Path, name: str, data: bytes | None, told: str) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputFileWarning)
        with pytest.raises(InputFileError, match=told):
            read_pattern(tmp_path / name)


def test_a_flat_pattern_tells_no_direction(tmp_path: Path) -> None:
    flat = read_pattern(write(tmp_path / "flat.csv", [(a, 1.0) for a, _ in table()]))
    with pytest.raises(ValueError, match="flat"):
        GainManifold.ring(6, flat)
