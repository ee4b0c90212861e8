"""Far fields of simulators: one antenna written in the format of each program."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from dirmusic import InputFileError, InputFileWarning, read_pattern
from dirmusic.array.pattern_file import read_any_pattern
from dirmusic.array.spatial_pattern import SpatialPattern
from dirmusic.arrays import FloatArray

FREQUENCIES_HZ = (0.5e9, 1.5e9)


def gain(ahead: FloatArray, left: FloatArray, up: FloatArray, frequency_hz: float) -> FloatArray:
    """Return the gain of an antenna that is stronger to the left and above, and grows with frequency."""
    return frequency_hz / 1e9 * (0.1 + np.exp(1.5 * (ahead - 1.0)) * (1.0 + 0.2 * left + 0.1 * up))


Sample = Callable[[float, float, float], float]
"""Gain for theta, phi (degrees) and frequency."""


def along_x(theta_deg: float, phi_deg: float, frequency_hz: float) -> float:
    theta, phi = np.radians([theta_deg, phi_deg])
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    return float(gain(x, y, z, frequency_hz))


def along_z(theta_deg: float, phi_deg: float, frequency_hz: float) -> float:
    theta, phi = np.radians([theta_deg, phi_deg])
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    return float(gain(z, x, y, frequency_hz))


def nec(sample: Sample) -> Iterator[str]:
    for f in FREQUENCIES_HZ:
        yield "  --------- FREQUENCY --------\n"
        yield f"        FREQUENCY : {f / 1e6:.4E} MHz\n\n  No:  X  Y  Z  1 2 3\n"
        yield "    1  0.1 0.2 0.3 0.4 0.5 0.6\n\n   ---------- RADIATION PATTERNS -----------\n\n"
        yield " ---- ANGLES -----   --- GAINS ---\n  THETA   PHI   VERTC   HORIZ   TOTAL   AXIAL\n DEG DEG DB DB DB\n"
        for phi in range(0, 360, 10):
            for theta in range(0, 181, 10):
                total = 20 * np.log10(sample(theta, phi, f))
                yield f"  {theta:.2f}  {phi:.2f}  {total:.4f}  -999.99  {total:.4f}  0.0000  0.00 LINEAR 1.0E-02 27.4\n"
        yield "\n\n"


def old_nec(sample: Sample) -> Iterator[str]:
    for part in nec(sample):
        yield part.replace("FREQUENCY : ", "FREQUENCY= ").replace("----------", "- - -")


def feko(sample: Sample, *, with_gain: bool = True) -> Iterator[str]:
    yield "##File Type: Far field\n##File Format: 3\n** exported\n"
    for f in FREQUENCIES_HZ:
        yield f"\n#Request Name: FarField1\n#Frequency:   {f:.8E}\n#Coordinate System: Spherical\n"
        yield '#  "Theta"  "Phi"  "Re(Etheta)"  "Im(Etheta)"  "Re(Ephi)"  "Im(Ephi)"'
        yield '  "Gain(Theta)"  "Gain(Phi)"  "Gain(Total)"\n' if with_gain else "\n"
        for phi in range(0, 361, 10):
            for theta in range(0, 181, 10):
                g = sample(theta, phi, f)
                total = f" -1.0 -2.0 {20 * np.log10(g):.5E}" if with_gain else ""
                field = "0 0 0 0" if with_gain else f"{0.6 * g:.6E} {-0.8 * g * 0.6:.6E} {0.8 * g * 0.8:.6E} 0.0"
                yield f"  {theta:.8E}  {phi:.8E}  {field}{total}\n"


def feko_field(sample: Sample) -> Iterator[str]:
    return feko(sample, with_gain=False)


def cst(sample: Sample) -> Iterator[str]:
    yield "// CST Farfield Source File\n\n// Version:\n3.0\n\n// #Frequencies\n2\n\n// Position\n0 0 0\n\n"
    yield "// Radiated/Accepted/Stimulated Power , Frequency\n"
    yield "\n".join(f"4.9e-01\n4.9e-01\n5.0e-01\n{f:.6e}\n" for f in FREQUENCIES_HZ)
    for f in FREQUENCIES_HZ:
        yield "\n\n// >> Total #phi samples, total #theta samples\n37 19\n\n"
        yield "// >> Phi, Theta, Re(E_Theta), Im(E_Theta), Re(E_Phi), Im(E_Phi): \n"
        for phi in range(0, 361, 10):
            for theta in range(0, 181, 10):
                g = sample(theta, phi, f)
                yield f"  {phi:.3f}  {theta:.3f}  {0.6 * g:.8e}  0.0  0.0  {-0.8 * g:.8e}\n"


def hfss(sample: Sample) -> Iterator[str]:
    yield "0 180 19\n-180 180 37\nFrequencies 2\n"
    for f in FREQUENCIES_HZ:
        yield f"Frequency {f:.0f}\n"
        for theta in range(0, 181, 10):
            for phi in range(-180, 181, 10):
                g = sample(theta, phi, f)
                yield f"{0.6 * g:.9e}\t0\t0\t{0.8 * g:.9e}\n"


def ticra(sample: Sample) -> Iterator[str]:
    for phi in range(0, 180, 10):
        yield f"Field data in cuts\n -0.1800000000E+03  0.1000000000E+02  37  {phi:.10E}    3    1    2\n"
        for theta in range(-180, 181, 10):
            g = sample(theta, phi, 1e9)
            yield f"  {0.8 * g:.10E}  0.0E+00  {0.6 * g:.10E}  0.0E+00\n"


@pytest.mark.parametrize("write", [nec, old_nec, feko, feko_field, cst, hfss, ticra])
@pytest.mark.parametrize(("sample", "axis"), [(along_x, "x"), (along_z, "z")])
def test_far_field_is_read_as_simulated(
    tmp_path: Path, write: Callable[[Sample], Iterator[str]], sample: Sample, axis: str
) -> None:
    """Directions, handedness, frequencies and levels agree with the antenna, whichever axis is its boresight."""
    path = tmp_path / "field.txt"
    path.write_text("".join(write(sample)))
    with pytest.warns(InputFileWarning, match=f"far field of .*; the boresight is its {axis} axis"):
        pattern = read_any_pattern(path)
    assert isinstance(pattern, SpatialPattern)
    frequency_hz = np.array(FREQUENCIES_HZ if write is not ticra else [1e9])
    azimuth, elevation = np.radians([0.0, 37.0, -120.0, 179.0, 5.0]), np.radians([0.0, 12.0, -40.0, 3.0, 85.0])
    level = np.cos(elevation)
    towards = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)
    expected = [gain(*towards, f) for f in frequency_hz]
    np.testing.assert_allclose(pattern.gain(azimuth, elevation, frequency_hz), expected, atol=4e-3)
    with pytest.warns(InputFileWarning):
        in_plane = read_pattern(path)
    share = in_plane(azimuth) / in_plane(0.0)
    flat = gain(np.cos(azimuth), np.sin(azimuth), np.zeros(5), 1e9)
    np.testing.assert_allclose(share, flat / flat[0], atol=4e-3)


@pytest.mark.parametrize(
    ("write", "old", "new", "message"),
    [
        (cst, "// Radiated/Accepted/Stimulated Power , Frequency", "// Power", "must list 2 frequencies"),
        (feko, "#Frequency:", "#F:", "far field of FEKO: must state the frequency"),
        (nec, "  90.00  40.00  ", "  90.00  x  ", "far field of NEC: theta 170, phi 40 degrees is missing"),
        (
            hfss,
            "Frequency 1500000000\n",
            "",
            "far field of HFSS: must have rows of 4 numbers|that begin with their frequency",
        ),
        (hfss, "Frequencies 2", "Frequencies 3", "must have 3 blocks that begin with their frequency"),
        (nec, "  120.00  ", "  x  ", "has a gap of 360"),
        (nec, "MHz", "MHz\n FREQUENCY : 1.0 MHz", "several gains: keep the blocks of one antenna and port"),
        (ticra, "    3    1    2", "    9    1    2", "ICOMP must be 1 to 5, got 9"),
    ],
)
def test_incomplete_far_field_is_refused(
    tmp_path: Path, write: Callable[[Sample], Iterator[str]], old: str, new: str, message: str
) -> None:
    (tmp_path / "field.txt").write_text("".join(write(along_x)).replace(old, new))
    with pytest.raises(InputFileError, match=message):
        read_any_pattern(tmp_path / "field.txt")


def test_far_field_that_ends_early_is_refused(tmp_path: Path) -> None:
    text = "".join(feko(along_x))
    (tmp_path / "field.txt").write_text(text[: text.index("  0.00000000E+00  3.40000000E+02", len(text) // 2)])
    with pytest.raises(InputFileError, match=r"must have the same directions|got none from 330 to 360 degrees"):
        read_any_pattern(tmp_path / "field.txt")
