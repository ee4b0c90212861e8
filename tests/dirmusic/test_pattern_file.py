"""Pattern files: formats and errors."""

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
)
from dirmusic.angles import difference
from dirmusic.array.beam import Beam, describe_beam
from dirmusic.array.pattern import gain_in_space
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


def msi_block(name: str, rows: list[tuple[float, float]]) -> list[str]:
    """Return a block of an MSI Planet file, whose angles are clockwise, and downwards."""
    largest = max(gain for _, gain in rows)
    clockwise = [f"{-a % 360.0:g} {20 * np.log10(largest / g):.4f}" for a, g in reversed(rows)]
    at = next(k for k, row in enumerate(clockwise) if row.startswith("0 "))
    ordered = clockwise[at:] + clockwise[:at]
    return [f"{name} {len(rows)}", *ordered]


def as_msi(rows: list[tuple[float, float]], vertical: list[tuple[float, float]] | None = None) -> str:
    """Return an MSI Planet file, with the vertical cut of a pattern that is the same in all planes by default."""
    angles, gains = np.transpose(rows)
    across = [(a, 0.5 * (g + float(np.interp(-a, angles, gains, period=360.0)))) for a, g in rows]
    cuts = [*msi_block("HORIZONTAL", rows), *msi_block("VERTICAL", vertical or across)]
    return "\n".join(["NAME x", "GAIN 0 dBi", *cuts])


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


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("a.msi", b"HORIZONTAL 360", b"HORIZONTAL 360 0"),
        ("a.txt", b"NAME x", b"NAME x\nFREQUENCY 0.3\x961 GHz, tilt 0\xb0"),
        ("a.ant", b" ", b"\t"),
        ("a.ptn", b"\n", b"\r\n \t"),
        ("a.pla", b"HORIZONTAL", b"Horizontal"),
    ],
)
def test_dialects_of_msi_are_read_alike(tmp_path: Path, name: str, old: bytes, new: bytes) -> None:
    """A second number after the count, a header in another encoding, tabs, blanks and any name change nothing."""
    (tmp_path / "plain.msi").write_text(as_msi(table(1.0)))
    changed = (tmp_path / "plain.msi").read_bytes().replace(old, new)
    (tmp_path / name).write_bytes(changed)
    assert new in changed
    plain = read_pattern(tmp_path / "plain.msi")
    np.testing.assert_array_equal(read_pattern(tmp_path / name)(OFF), plain(OFF))


def gaussian(width_deg: float, tilt_deg: float = 0.0) -> list[tuple[float, float]]:
    """Tabulate a Gaussian beam whose gain is 3 dB down half the width off its axis, with 26 dB less behind."""
    return [(a, 10 ** (-min(12.04 * ((a - tilt_deg) / width_deg) ** 2, 26.0) / 20)) for a in np.arange(-180.0, 180.0)]


def test_vertical_cut_is_used_where_it_differs(tmp_path: Path) -> None:
    """Both cuts are reproduced, attenuations off both add up, and elevations are upwards where the file's are down."""
    (tmp_path / "p.msi").write_text(as_msi(gaussian(50.0), gaussian(100.0, tilt_deg=-8.0)))
    pattern = read_pattern(tmp_path / "p.msi")
    off, up = np.radians([10.0, -35.0, 120.0]), np.radians([[-60.0], [-8.0], [0.0], [25.0]])
    tilted_up = read_pattern(write(tmp_path / "v.csv", gaussian(100.0, tilt_deg=-8.0)))
    plane = read_pattern(write(tmp_path / "h.csv", gaussian(50.0)))
    expected = plane(off) * tilted_up(up) / tilted_up(0.0)
    np.testing.assert_allclose(gain_in_space(pattern, off, up).gain / pattern(0.0), expected, atol=1e-3)
    np.testing.assert_array_equal(gain_in_space(pattern, off, 0.0).gain, pattern(off))


def test_round_pattern_is_combined_by_angle_and_roll(tmp_path: Path) -> None:
    """A file whose vertical cut is that of a pattern that is the same in all planes gives the same as without it."""
    (tmp_path / "p.msi").write_text(as_msi(table(1.0)))
    (tmp_path / "h.msi").write_text("\n".join(msi_block("HORIZONTAL", table(1.0))))
    first, second = (gain_in_space(read_pattern(tmp_path / name), OFF, 0.5) for name in ("p.msi", "h.msi"))
    np.testing.assert_array_equal(first, second)


def test_vertical_cut_that_cannot_be_used_is_noted(tmp_path: Path) -> None:
    (tmp_path / "p.msi").write_text("\n".join([*msi_block("HORIZONTAL", table()), "VERTICAL 1", "0 0"]))
    with pytest.warns(InputFileWarning, match="VERTICAL is not used, so that heights are uncertain"):
        assert read_pattern(tmp_path / "p.msi").vertical is None


def test_closing_row_measured_apart_is_averaged_with_a_note(tmp_path: Path) -> None:
    """Rows at -180 and 180 degrees that differ by 1.2 dB are replaced by the value midway between them."""
    first = table()[0][1]
    path = write(tmp_path / "p.csv", [*table(), (180.0, first * 10 ** (-1.2 / 20))])
    with pytest.warns(InputFileWarning, match="p.csv: -180 and 180 degrees differ by 1.2 dB: averaged"):
        pattern = read_pattern(path)
    assert 20 * np.log10(pattern(np.pi) / first) == pytest.approx(-0.6, abs=1e-6)
    assert pattern(0.0) == pytest.approx(float(GaussianPattern()(0.0)), abs=1e-6)


@pytest.mark.parametrize("names", ["frequency_hz,angle_deg", "frequency_ghz,azimuth_deg"])
def test_cuts_over_frequency_give_the_rms_over_the_band(tmp_path: Path, names: str) -> None:
    """Gains of 1, 2 and 2 at 1, 2 and 4 GHz have the mean square ((1 + 4) / 2 + 2 * 4) / 3, whatever their order."""
    unit = 1e9 if "hz" in names.split(",")[0].split("_") else 1.0
    rows = [f"{f * unit:g},{a:g},{g * k:.10f}" for f, k in ((4, 2), (1, 1), (2, 2)) for a, g in table()]
    (tmp_path / "p.csv").write_text("\n".join([f"{names},gain", *rows]))
    plain = read_pattern(write(tmp_path / "plain.csv", table()))
    np.testing.assert_allclose(read_pattern(tmp_path / "p.csv")(OFF), np.sqrt(3.5) * plain(OFF), rtol=1e-6)


@pytest.mark.parametrize("turned_deg", [0.0, 30.0, -75.0, 179.0])
def test_main_beam_is_measured_and_a_turned_one_is_named(turned_deg: float) -> None:
    """A Gaussian beam with half the power 25 degrees off its axis, and 20 dB less behind."""
    angle = np.radians(np.arange(-180.0, 180.0))
    off_deg = np.degrees(difference(angle, np.radians(turned_deg)))
    pattern = TabulatedPattern(angle, 10 ** (-np.minimum(3.0103 * np.square(off_deg / 25.0), 20.0) / 20))
    beam = Beam.of(pattern)
    assert np.degrees(difference(beam.strongest_rad, np.radians(turned_deg))) == pytest.approx(0.0, abs=0.06)
    assert np.degrees(difference(beam.middle_rad, np.radians(turned_deg))) == pytest.approx(0.0, abs=0.11)
    assert np.degrees(beam.width_rad) == pytest.approx(50.0, abs=0.2)
    assert 20 * np.log10(beam.front_to_back) == pytest.approx(20.0, abs=0.01)
    text = describe_beam(pattern)
    assert text.startswith(
        f"strongest at {turned_deg:.0f} degrees{', not at 0' if turned_deg else ''}; beam 50 degrees"
    )


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
        ("a.csv", b"angle,gain\n0,1\n", "whose columns are angle_deg and either gain or gain_db, got angle, gain"),
        ("a.csv", b"angle_deg,angle_deg\n0,1\n", "got angle_deg, angle_deg"),
        ("a.csv", b"angle_deg,gain\n0,1\n10\n20,1,3\n", "line 3: must have 2 cells, has 1"),
        ("a.csv", b"angle_deg;gain\n0;1.000,5\n", "line 2: gain: must be an amplitude ratio"),
        ("a.csv", b"\xff\xfea\x00n\x00", "must be UTF-8 text"),
        ("a.csv", b"angle_deg,gain\n0,1e999\n", "1e999"),
        ("a.txt", b"lines\nof\ntext\n", "an MSI Planet file with a line HORIZONTAL, a far field, or a CSV table"),
        ("a.csv", b"angle_deg,gain\n0,1\n90,1\n180,1\n270,1\n360,3\n", "0 and 360 degrees differ by 9.5 dB"),
        ("a.csv", b"frequency_hz,angle_deg,gain\n1e9,0,1\n1e9,9,1\n2e9,0,1\n", "2e\\+09, angle_deg 9 is missing"),
        ("a.csv", b"frequency_hz,angle_deg,gain\n1,0,1\n", "line 2: frequency_hz: must be 1e6 to 1e12 Hz, got '1'"),
        ("a.csv", b"frequency_mhz,angle_deg,gain\n1,0,1\n", "got frequency_mhz, angle_deg, gain"),
        ("none.csv", None, "cannot be read"),
        ("a.msi", b"NAME x\nGAIN 9 dBi\n", "must be an MSI Planet file with a line HORIZONTAL"),
        ("a.msi", b"HORIZONTAL 1\n0 0\nHORIZONTAL 1\n0 0\n", "line 3: must have one line .* HORIZONTAL"),
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
