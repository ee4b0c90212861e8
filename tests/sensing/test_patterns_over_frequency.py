"""Patterns over azimuth, elevation and frequency: from the file to the signals of the channels."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dirmusic import GainPattern, InputFileError
from dirmusic.array.pattern_file import read_any_pattern, read_spatial_pattern
from dirmusic.array.spatial_pattern import SpatialPattern, frequency_weights
from dirmusic.arrays import FloatArray
from dirmusic.bearing.sub_bands import SubBands
from pdpatrol.sensing import (
    ArrayConfig,
    DischargeSource,
    HelicalArray,
    ReceiverConfig,
    TrueArrayConfig,
)
from pdpatrol.sensing.array.helical_array import SHIPPED_PATTERNS, ElementConfig
from pdpatrol.sensing.radio.arrivals import arrive
from pdpatrol.sensing.radio.geometry import Frame, Vector
from pdpatrol.sensing.radio.ray_paths import PATH, RayPaths
from pdpatrol.sensing.receiver.front_end import PHASES
from pdpatrol.sensing.receiver.receiver import Receiver
from pdpatrol.sensing.receiver.sampling import Signal, add_emission
from tests.sensing.listening import listen, table_of

HELIX = SHIPPED_PATTERNS["helix_in_ring"]
RECEIVER = Receiver(ReceiverConfig(), 6)
RATE_HZ = ReceiverConfig().sample_rate_hz
DEG = np.pi / 180.0


def array_with(pattern: GainPattern | SpatialPattern, config: ArrayConfig) -> HelicalArray:
    return replace(HelicalArray.draw(config, np.random.default_rng(1)), pattern=pattern)


def recorded(array: HelicalArray, from_m: FloatArray, n_samples: int, start_s: float) -> FloatArray:
    """Return the channels after the filter for a pulse of 1 V at 1 m, shape (n_elements, n_samples)."""
    row = np.zeros(1, PATH)
    row["x"], row["y"], row["z"] = from_m
    row["coefficient"] = 1.0
    paths, axes = RayPaths(row, np.array([0, 1])), (Vector(*axis) for axis in [*np.eye(3), np.zeros(3)])
    arrivals = arrive(paths, Frame(*axes), table_of(array))
    volts, pulse = np.zeros((array.n_elements, n_samples)), RECEIVER.sampler(array).pulse
    for e in range(array.n_elements):
        add_emission(volts[e], e, start_s, Signal(1.0, 0.0, arrivals.delay_s, arrivals.amplitude), pulse)
    return volts


@pytest.mark.parametrize("tilt_deg", [0.0, 25.0])
def test_flat_table_is_received_like_its_pattern(tilt_deg: float) -> None:
    """A table without frequency dependence gives the signals of the plane pattern from which it was made."""
    config = ArrayConfig(
        elements=tuple(ElementConfig(azimuth_deg=90.0 - 60.0 * k, elevation_deg=tilt_deg) for k in range(6))
    )
    plane = array_with(HelicalArray.nominal(config).cut(), config)
    azimuth, elevation = np.radians(np.arange(-180, 180, 5)), np.radians(np.arange(-90, 91, 5))
    single = ArrayConfig(elements=tuple(ElementConfig(azimuth_deg=90.0 * k) for k in range(3)))
    one = HelicalArray.nominal(single)
    at, up = np.meshgrid(azimuth, elevation, indexing="ij")
    gain = one.gain(at[..., np.newaxis] + one.boresights_rad[0], up[..., np.newaxis])[..., 0]
    table = SpatialPattern([1.3e9, 1.8e9, 2.3e9], azimuth, elevation, np.stack([gain, gain, gain]))
    spatial = array_with(table, config)
    rng = np.random.default_rng(4)
    for place in rng.normal(0.0, 5.0, (30, 3)):
        start_s = float(np.linalg.norm(place)) / 299_792_458.0 - 2e-9
        by_plane, by_table = (recorded(array, place, 200, start_s) for array in (plane, spatial))
        np.testing.assert_allclose(by_table, by_plane, atol=0.01 / float(np.linalg.norm(place)))


def test_received_pulse_is_spectrum_times_gain() -> None:
    """The reference is the discrete Fourier transform of the whole pulse, times the gain at each frequency."""
    config = ArrayConfig()
    array, pattern = array_with(read_spatial_pattern(HELIX), config), read_spatial_pattern(HELIX)
    n, fine = 4096, 8
    frequency_hz = np.fft.rfftfreq(n * fine, 1.0 / (fine * RATE_HZ))
    table = RECEIVER.front_end.pulse_table.sine_v[0]
    whole = np.zeros(n * fine)
    known = table[:: PHASES // fine].T.ravel()
    begin = n * fine // 4
    whole[begin : begin + known.size] = known
    worst = list[float]()
    for azimuth_deg, elevation_deg in ((0.0, 0.0), (75.0, 10.0), (-160.0, -20.0), (40.0, 60.0)):
        azimuth, elevation, length_m = azimuth_deg * DEG, elevation_deg * DEG, 8.0
        place = length_m * np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        place = place + array.positions_m.mean(axis=0)
        start_s = length_m / 299_792_458.0 - 10e-9
        volts = recorded(array, place, 700, start_s)
        for e in range(6):
            sight = place - array.positions_m[e]
            range_m = float(np.linalg.norm(sight))
            own = np.arctan2(sight[1], sight[0]) - array.boresights_rad[e], np.arcsin(sight[2] / range_m)
            gain = array.gain_factors[e] * pattern.gain(*own, frequency_hz) + array.gain_offsets[e]
            wave = np.fft.irfft(np.fft.rfft(whole) * gain.reshape(-1), n * fine) / range_m
            shift = (range_m / 299_792_458.0 - start_s) * RATE_HZ * fine
            at = np.arange(700) * fine - shift + begin
            expected = np.interp(at, np.arange(n * fine), wave)
            worst.append(float(np.linalg.norm(volts[e] - expected) / np.linalg.norm(expected)))
    assert np.median(worst) < 0.02
    assert max(worst) < 0.06


def test_burst_is_received_with_gain_at_its_frequency() -> None:
    bands_hz = RECEIVER.front_end.bands_hz(read_spatial_pattern(HELIX).frequency_hz)
    table = RECEIVER.front_end.pulse_in_bands(*bands_hz.tolist())
    gain = 0.2 + 0.3 * (bands_hz - 1.4e9) / 1e9
    assert table.steady_share @ gain == pytest.approx(0.2 + 0.3 * 0.35)


def test_gain_is_linear_between_frequencies_constant_outside() -> None:
    known = np.array([1.0, 2.0, 4.0])
    values = np.array([3.0, 5.0, 4.0])
    weights = frequency_weights(np.array([0.5, 1.0, 1.5, 3.0, 9.0]), known)
    np.testing.assert_allclose(weights @ values, [3.0, 3.0, 4.0, 4.5, 4.0])


ROWS = [
    f"{f},{a},{e},{1 + 0.5 * np.cos(a * DEG) * np.cos(e * DEG) + 0.01 * e * DEG + f}"
    for f in (1.5, 2.0)
    for a in range(-180, 180, 30)
    for e in range(-90, 91, 30)
]
HEADER = "frequency_ghz,azimuth_deg,elevation_deg,gain"


def test_table_rows_may_come_in_any_order(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\n".join([HEADER, *ROWS]), encoding="utf-8")
    closed = [row.replace(",-180,", ",180,", 1) for row in ROWS if ",-180," in row]
    (tmp_path / "b.csv").write_text("\n".join([HEADER, *closed, *ROWS[::-1]]), encoding="utf-8")
    first, second = (read_any_pattern(tmp_path / name) for name in ("a.csv", "b.csv"))
    assert isinstance(first, SpatialPattern)
    assert isinstance(second, SpatialPattern)
    np.testing.assert_array_equal(first.table_gain, second.table_gain)
    towards = np.radians([10.0, 200.0]), np.radians([5.0, -40.0]), [1.5e9, 1.75e9]
    expected = 1 + 0.5 * np.cos(towards[0]) * np.cos(towards[1]) + 0.01 * towards[1] + np.array([[1.5], [1.75]])
    np.testing.assert_allclose(first.gain(*towards), expected, atol=0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows[1:], "frequency_ghz 1.5, azimuth_deg -180, elevation_deg -90 is missing"),
        (lambda rows: [*rows, rows[5]], "elevation_deg 60 is repeated"),
        (lambda rows: [rows[0].replace("1.5,", "x,", 1), *rows[1:]], "line 2: frequency_ghz: must be .*, got 'x'"),
        (lambda rows: [*rows[:-1], rows[-1].rsplit(",", 1)[0] + ",-0.2"], "line 169: gain: must be an .*, got '-0.2'"),
        (lambda rows: [row for row in rows if row.split(",")[1] not in ("0", "30")], "has a gap of 90.0 degrees"),
        (lambda rows: [row for row in rows if float(row.split(",")[2]) > 0], "on both sides of 0"),
    ],
)  # fmt: skip
def test_invalid_table_is_refused_with_file_and_line(change: object, message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join([HEADER, *change(ROWS)]), encoding="utf-8")  # pyright: ignore[reportCallIssue]
    with pytest.raises(InputFileError, match=message) as refused:
        read_any_pattern(path)
    assert str(path) in str(refused.value)


def test_sub_band_strengths_match_their_definition() -> None:
    config = ReceiverConfig(n_bands=4, gate_samples=160)
    array = HelicalArray.draw(ArrayConfig(), np.random.default_rng(2), TrueArrayConfig(pattern="helix_in_ring"))
    gun = DischargeSource(
        name="gun", position_m=np.array([6.0, 2.0, 1.0]), amplitude_v=0.3, pulse_rate_hz=200.0, n_shots=20
    )
    found, whole = (
        listen(gun, seed=3, duration_s=0.1, array=array, n_bands=n_bands, gate_samples=160) for n_bands in (4, 0)
    )
    assert found.pulses.n_pulses == 20
    receiver = Receiver(config, 6)
    bands = SubBands(config.band_edges_hz, config.sample_rate_hz, 160, receiver.front_end.correlation)
    energy_v2 = np.square(np.einsum("kes,bls->kbel", found.waveforms_v, bands.lines)).sum(axis=-1)
    pulse_v2 = energy_v2 - bands.noise_samples[:, np.newaxis] * receiver.noise_variance_v2
    np.testing.assert_allclose(found.pulses.band_strengths_v, np.sqrt(np.maximum(pulse_v2, 0.0)), rtol=1e-9)
    in_band = np.square(found.pulses.band_strengths_v).sum(axis=1) / np.square(found.pulses.strengths_v)
    assert 0.85 < np.median(in_band) < 1.0
    assert whole.pulses.band_strengths_v.shape == (20, 0, 6)
    np.testing.assert_array_equal(whole.pulses.strengths_v, found.pulses.strengths_v)
