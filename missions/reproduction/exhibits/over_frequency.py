"""Past the paper: a helix whose pattern changes over the band, and direction finding that knows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dirmusic import (
    ESTIMATORS,
    ArrayModel,
    ElementSpread,
    GainManifold,
    PulseBatch,
    pulse_strengths,
    strength_variance,
)
from dirmusic.array.bounds import bearing_bound_in_bands
from dirmusic.array.manifold import ring_boresights_rad
from dirmusic.array.pattern_file import read_spatial_pattern
from dirmusic.array.spatial_pattern import SpatialPattern, halves
from dirmusic.bearing.sub_bands import SubBands
from pdpatrol.missions.reproduction import protocol
from pdpatrol.missions.reproduction.exhibit import Campaign, Exhibit, Measured, Row
from pdpatrol.missions.reproduction.methods import error_deg
from pdpatrol.sensing.array.config import SHIPPED_PATTERNS
from pdpatrol.sensing.nature.pulse_shape import damped_pulse

FloatArray = NDArray[np.float64]

SAMPLE_RATE_HZ, BAND_HZ, N_BANDS = 20e9, (1.4e9, 2.2e9), 8
N_GATE, STARTS_AT = 260, 80
"""The gate, and the sample at which the pulse arrives: a gain over frequency without a phase spreads it both ways."""

SNRS_DB = (10.0, 5.0, 0.0, -5.0, -10.0)
LOWERED = 0.9
"""By what the time axis of the other source's pulse is stretched: all its spectrum lies 10 % lower (assumed)."""

N_FINE = 64
"""Bands of the bound: so narrow that the gain is constant in them."""

BIAS_AZIMUTHS_DEG = np.arange(-180.0, 180.0, 1.0)


class HelixRing:
    """Six computed helices in a ring at one place, and how their pulses are received."""

    def __init__(self) -> None:
        self.pattern: SpatialPattern = read_spatial_pattern(SHIPPED_PATTERNS["helix_in_ring"])
        self.boresights_rad = ring_boresights_rad(6)
        edges_hz = np.linspace(*BAND_HZ, N_BANDS + 1).tolist()
        self.bands = SubBands(edges_hz, SAMPLE_RATE_HZ, N_GATE)
        self.fine_hz = np.linspace(*BAND_HZ, N_FINE + 1).tolist()
        self.fine = [self._manifold((low, high)) for low, high in zip(self.fine_hz, self.fine_hz[1:], strict=False)]
        self.array = ArrayModel(
            manifold=self._manifold(BAND_HZ),
            positions_m=np.zeros((6, 3)),
            spread=ElementSpread(gain=0.0, pointing_rad=0.0, offset=0.0),
            band_manifolds=tuple(self._manifold(half) for half in halves(edges_hz)),
        )

    def _manifold(self, band_hz: tuple[float, float]) -> GainManifold:
        return GainManifold(self.pattern.cut(band_hz), self.boresights_rad)

    def spectrum(self, stretch: float) -> NDArray[np.complex128]:
        """That of a pulse of unit energy, what lies outside the band left out, at the frequencies of `waveforms`."""
        time_s = (np.arange(N_GATE) - STARTS_AT) / SAMPLE_RATE_HZ
        spectrum = np.fft.rfft(damped_pulse(stretch * time_s))
        frequency_hz = np.fft.rfftfreq(N_GATE, 1.0 / SAMPLE_RATE_HZ)
        spectrum[(frequency_hz < BAND_HZ[0]) | (frequency_hz > BAND_HZ[1])] = 0.0
        return spectrum / np.sqrt(np.square(np.fft.irfft(spectrum, N_GATE)).sum())

    def waveforms(self, spectrum: NDArray[np.complex128], azimuth_rad: FloatArray) -> FloatArray:
        """Gates without noise of pulses from directions (n,), shape (n, 6, N_GATE)."""
        frequency_hz = np.asarray(np.fft.rfftfreq(N_GATE, 1.0 / SAMPLE_RATE_HZ), dtype=np.float64)
        gain = self.pattern.gain(azimuth_rad[:, np.newaxis] - self.boresights_rad, np.zeros(6), frequency_hz)
        return np.asarray(np.fft.irfft(spectrum * np.moveaxis(gain, 0, -1), N_GATE), dtype=np.float64)

    def bearings_deg(self, waveforms: FloatArray, noise_v2: float) -> tuple[FloatArray, FloatArray]:
        """Bearings by one strength a channel, and by one in each sub-band; each of shape (n,)."""
        noise = np.full(6, noise_v2)
        whole_v, in_bands_v = pulse_strengths(waveforms, noise), self.bands.strengths(waveforms, noise)
        pulses = PulseBatch.detected(
            np.zeros(len(waveforms)),
            whole_v,
            strength_variance(whole_v, noise, N_GATE),
            band_strengths_v=in_bands_v,
            band_variance_v2=self.bands.variance(in_bands_v, noise),
        )
        one, by_band = (ESTIMATORS[name]()(pulses, self.array) for name in ("maximum_likelihood", "sub_bands"))
        return np.degrees(one.azimuth_rad), np.degrees(by_band.azimuth_rad)

    def bound_deg(self, spectrum: NDArray[np.complex128], azimuth_rad: FloatArray, rho: float) -> FloatArray:
        """Cramer-Rao bound where the spectrum is not known, shape of the directions."""
        middle_hz = 0.5 * (np.array(self.fine_hz[1:]) + self.fine_hz[:-1])
        density = np.interp(middle_hz, np.fft.rfftfreq(N_GATE, 1.0 / SAMPLE_RATE_HZ), np.square(np.abs(spectrum)))
        return np.degrees(
            bearing_bound_in_bands(self.fine, azimuth_rad, rho * (density / density.sum())[:, np.newaxis])
        )


def over_frequency(campaign: Campaign) -> Exhibit:
    """Bearings beside the bound where the pattern changes over the band: narrow-band, and in sub-bands."""
    ring = HelixRing()
    usual, lowered = ring.spectrum(1.0), ring.spectrum(LOWERED)
    cells = [(snr_db, usual, "") for snr_db in SNRS_DB] + [(0.0, lowered, ", spectrum 10 % lower")]
    rows: list[Row] = []
    curves: list[tuple[float, float, float, float]] = []
    for cell, (snr_db, spectrum, label) in enumerate(cells):
        rng, rho = campaign.rng(13, cell), float(protocol.energy_to_noise(snr_db))
        truths, narrow, by_band = list[FloatArray](), list[FloatArray](), list[FloatArray]()
        for n in campaign.chunks():
            true_deg = rng.uniform(-180.0, 180.0, n)
            waveforms = np.sqrt(rho) * ring.waveforms(spectrum, np.radians(true_deg))
            found = ring.bearings_deg(waveforms + rng.standard_normal(waveforms.shape), 1.0)
            for errors, found_deg in zip((narrow, by_band), found, strict=True):
                errors.append(error_deg(found_deg, true_deg))
            truths.append(true_deg)
        limit = ring.bound_deg(spectrum, np.radians(np.concatenate(truths)), rho)
        limit_deg = float(np.sqrt(np.square(limit).mean()))
        ratios = [Measured.rms(np.concatenate(errors), limit_deg) for errors in (narrow, by_band)]
        rows.append(
            Row(
                label=f"{snr_db:g} dB{label} ({limit_deg:.3f} deg)",
                paper_method=ratios[0],
                best_method=ratios[1],
                unit="RMSE / bound",
            )
        )
        if not label:
            curves.append((snr_db, limit_deg, limit_deg * ratios[0].value, limit_deg * ratios[1].value))
    bias = [_bias_deg(ring, spectrum) for spectrum in (usual, lowered)]
    return Exhibit(
        name="over_frequency",
        title="Over frequency: root mean square error over the Cramer-Rao bound, a pattern that changes over the band",
        rows=tuple(rows),
        notes=(
            "first: one strength a channel, and the pattern's root mean square over the band for a flat spectrum; "
            f"second: strengths in {N_BANDS} sub-bands, their patterns, and a free spectrum",
            "the pattern is the computed helix among its neighbours, in the plane and known to both",
            "the paper has one pattern for all frequencies",
        ),
        results={
            f"{method}_bias_deg{which}": float(np.sqrt(np.square(values).mean()))
            for which, both in zip(("", "_lower"), bias, strict=True)
            for method, values in zip(("narrow_band", "sub_bands"), both, strict=True)
        },
        data={"curves": np.array(curves), "bias_deg": np.array(bias)},
    )


def _bias_deg(ring: HelixRing, spectrum: NDArray[np.complex128]) -> tuple[FloatArray, FloatArray]:
    """Errors without noise towards `BIAS_AZIMUTHS_DEG`, narrow-band and in sub-bands."""
    waveforms = ring.waveforms(spectrum, np.radians(BIAS_AZIMUTHS_DEG))
    narrow, by_band = ring.bearings_deg(waveforms, 1e-12)
    return error_deg(narrow, BIAS_AZIMUTHS_DEG), error_deg(by_band, BIAS_AZIMUTHS_DEG)
