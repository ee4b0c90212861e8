"""Pattern files: formats and errors."""

from pathlib import Path

import numpy as np
import pytest

from dirmusic import GainManifold, GaussianPattern, InputFileError, estimate_bearings, read_pattern
from dirmusic.angles import difference
from tests.dirmusic.scenes import RING

OFF = np.radians(np.linspace(-180.0, 180.0, 1441))
SMOOTH = np.abs(np.abs(np.degrees(OFF) - 153.0)) > 4.0  # eq. (1) has a step there, which no spline follows


def table(step_deg: float = 10.0) -> list[tuple[float, float]]:
    """Tabulate eq. (1), which is not symmetric: angle in degrees and gain."""
    angles = np.arange(-180.0, 180.0, step_deg)
    return list(zip(angles.tolist(), GaussianPattern()(np.radians(angles)).tolist(), strict=True))


def write(path: Path, rows: list[tuple[float, float]], header: str = "angle_deg,gain") -> Path:
    path.write_text("\n".join([header, *(f"{a:g},{g:.10f}" for a, g in rows), ""]))
    return path


def as_msi(rows: list[tuple[float, float]]) -> str:
    """Return an MSI Planet file, whose angles are clockwise."""
    largest = max(gain for _, gain in rows)
    clockwise = [f"{-a % 360.0:g} {20 * np.log10(largest / g):.4f}" for a, g in reversed(rows)]
    at = next(k for k, row in enumerate(clockwise) if row.startswith("0 "))
    ordered = clockwise[at:] + clockwise[:at]
    return "\n".join(["NAME x", "GAIN 0 dBi", f"HORIZONTAL {len(rows)}", *ordered, "VERTICAL 1", "0 0"])


@pytest.mark.parametrize("name", ["p.csv", "p.msi", "p.PLN"])
def test_pattern_of_file_is_neither_mirrored_nor_scaled(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(as_msi(table(1.0))) if name != "p.csv" else write(tmp_path / name, table(1.0))
    pattern, paper = read_pattern(tmp_path / name), GaussianPattern()
    np.testing.assert_allclose(pattern(OFF[SMOOTH]) / pattern(0.0), paper(OFF[SMOOTH]) / paper(0.0), atol=1e-3)
    azimuth = np.radians(np.arange(0.5, 360.0, 7.0))
    strengths = RING.gain(azimuth).T[:, np.newaxis]
    found = estimate_bearings(strengths, GainManifold.ring(6, pattern)).azimuth_rad
    assert np.degrees(np.abs(difference(found, azimuth))).max() < 0.3


@pytest.mark.parametrize("is_measured", [True, False])
def test_pattern_slopes_match_differences(tmp_path: Path, is_measured: bool) -> None:
    pattern = read_pattern(write(tmp_path / "p.csv", table())) if is_measured else GaussianPattern()
    angle, step = OFF[SMOOTH], 1e-6
    expected = (pattern(angle + step) - pattern(angle - step)) / (2 * step)
    np.testing.assert_allclose(pattern.gain_and_slope(angle)[1], expected, atol=1e-6)


def decibels(rows: list[tuple[float, float]]) -> bytes:
    closed = [*rows, (180.0, rows[0][1])]
    return ("# turntable\n\nangle_deg,gain_db\n" + "\n".join(f"{a},{20 * np.log10(g)}" for a, g in closed)).encode()


def semicolons(rows: list[tuple[float, float]]) -> bytes:
    text = "angle_deg;gain\r\n" + "\r\n".join(f"{a};{g:.10f}".replace(".", ",") for a, g in rows)
    return b"\xef\xbb\xbf" + text.encode()


@pytest.mark.parametrize("data", [decibels(table()), semicolons(table())], ids=["decibels", "semicolons"])
def test_variants_of_csv_are_read_alike(tmp_path: Path, data: bytes) -> None:
    """One file has comments, decibels and a closing row, the other decimal commas and a byte-order mark."""
    (tmp_path / "variant.csv").write_bytes(data)
    plain = read_pattern(write(tmp_path / "plain.csv", table()))
    np.testing.assert_allclose(read_pattern(tmp_path / "variant.csv")(OFF), plain(OFF), atol=1e-9)


def rows_with(at: int, row: tuple[float, float]) -> list[tuple[float, float]]:
    return [*table()[:at], row, *table()[at + 1 :]]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (rows_with(5, (-170.0, 0.3)), "line 7: angle_deg: must increase, -140 is followed by -170"),
        (rows_with(5, (-130.0, -0.3)), "line 7: gain: must be an amplitude ratio above 0.*, got '-0.3"),
        (rows_with(35, (185.0, 0.3)), r"strictly increasing within one turn \(2 pi\)"),
        ([row for row in table() if abs(row[0]) > 25], "step of 60.0 degrees after -30.0 degrees"),
        (table()[:3], "n >= 4"),
    ],
)
def test_invalid_row_is_named_by_file_and_line(tmp_path: Path, rows: list[tuple[float, float]], message: str) -> None:
    with pytest.raises(InputFileError, match=f"wrong.csv: .*{message}"):
        read_pattern(write(tmp_path / "wrong.csv", rows))


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.csv", b"", "must have a header"),
        ("a.csv", b"angle,gain\n0,1\n", "columns must be angle_deg and either gain or gain_db, got angle, gain"),
        ("a.csv", b"angle_deg,angle_deg\n0,1\n", "got angle_deg, angle_deg"),
        ("a.csv", b"angle_deg,gain\n0,1\n10\n20,1,3\n", "line 3: must have 2 cells, has 1"),
        ("a.csv", b"angle_deg;gain\n0;1.000,5\n", "line 2: gain: must be an amplitude ratio"),
        ("a.csv", b"\xff\xfea\x00n\x00", "must be UTF-8 text"),
        ("a.csv", b"angle_deg,gain\n0,1e999\n", "1e999"),
        ("a.txt", b"angle_deg,gain\n0,1\n", "name must end in .csv"),
        ("none.csv", None, "cannot be read"),
        ("a.msi", b"NAME x\n", "must have one line that begins with HORIZONTAL, has 0"),
        ("a.msi", b"NAME x\nHORIZONTAL 5\n0 1\n1 1\nVERTICAL 1\n", "line 2: must be .* number of rows, 2"),
        ("a.msi", b"HORIZONTAL 0\n", "number of rows, 0"),
        ("a.msi", b"HORIZONTAL 2\n0 1\n90 -1\n", "line 3: attenuation_db: must be 0 to 200 dB"),
        ("a.msi", b"HORIZONTAL 2\n0 1\n90 1 1\n", "line 3: must have 2 cells, has 3"),
    ],
)  # fmt: skip
def test_invalid_pattern_file_is_refused(tmp_path: Path, name: str, data: bytes | None, message: str) -> None:
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(InputFileError, match=message):
        read_pattern(tmp_path / name)


def test_flat_pattern_is_refused(tmp_path: Path) -> None:
    flat = read_pattern(write(tmp_path / "flat.csv", [(a, 1.0) for a, _ in table()]))
    with pytest.raises(ValueError, match="flat"):
        GainManifold.ring(6, flat)
