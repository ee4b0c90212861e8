"""Comparison of a recording with its scenario: rows of the gap report, and the scenario with the fitted values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from threadpoolctl import threadpool_limits

from dirmusic import InputFileError
from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs.scenario import Scenario
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.gap.noise_free import NoiseFreeDrive
from pdpatrol.missions.field.gap.recorded_strengths import NoiseEstimate, PulseGroups, estimate_noise, group_pulses
from pdpatrol.missions.field.gap.sources import RecordedSource, agreements, choose_sources
from pdpatrol.missions.field.gap.world_fit import RATIOS, DriveFit, WorldFit
from pdpatrol.missions.field.locate_field_data import FieldLocator
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.sensing.array.helical_array import SHIPPED_PATTERNS
from pdpatrol.sensing.radio.materials import GroundName

SIGMAS = 3.0
"""Half-width of the intervals in standard deviations. If errors are normal, about ten rows hold together with more than
95 %; in recordings of the simulator, 39 of 40 did."""

TAIL = 0.00135
"""Probability beyond each end of such an interval."""

MODEL_WIDTH, MODEL_DB, MODEL_RATIO = 0.008, 0.15, 0.05
"""Standard deviations of errors of the model itself: relative width of the beam, gain of a channel or noise, and
logarithm of the pose errors. Assumed; without them, recordings of the simulator itself left the intervals too often. A
larger one of the pose errors would hide pose errors twice as large as stated."""

LEAST_EVIDENCE = 8.0
"""Difference of the log evidence from which on a ground is excluded: 3000 to 1 (assumed)."""


@dataclass(frozen=True, kw_only=True)
class GapRow:
    """Row of the gap report.

    Attributes:
        quantity: Name of the compared quantity.
        unit: Unit of the numbers; empty for the ground.
        estimate: Value by the recording.
        interval: Lower and upper end; for the ground, all materials that are not excluded.
        expected: Value by the scenario.
        is_claimed: True if the interval excludes the expected value.
    """

    quantity: str
    unit: str
    estimate: float | str
    interval: tuple[float, float] | tuple[str, ...]
    expected: float | str
    is_claimed: bool

    @classmethod
    def of(cls, quantity: str, unit: str, estimate: float, std: float) -> GapRow:
        """Make the row of an estimate with a standard deviation, which is expected to be 0."""
        return cls.within(quantity, unit, estimate, (estimate - SIGMAS * std, estimate + SIGMAS * std), 0.0)

    @classmethod
    def within(
        cls, quantity: str, unit: str, estimate: float, interval: tuple[float, float], expected: float
    ) -> GapRow:
        """Make the row of an estimate with an interval."""
        low, high = map(float, interval)
        is_claimed = not low <= expected <= high
        return cls(
            quantity=quantity,
            unit=unit,
            estimate=float(estimate),
            interval=(low, high),
            expected=float(expected),
            is_claimed=is_claimed,
        )


@dataclass(frozen=True, kw_only=True)
class Gap:
    """Gap report.

    Attributes:
        rows: The comparisons.
        scenario: The scenario that the recording was compared with.
        sources: Sources, in order of those of the fit.
        fit: World with the likeliest ground.
        believed: World fitted with the ground of the scenario.
        groups: Recorded strengths.
        noise: Noise of the receiver.
        pose: Recorded pose of each step of the groups, shape (n_steps, 3).
    """

    rows: tuple[GapRow, ...]
    scenario: Scenario
    sources: tuple[RecordedSource, ...]
    fit: WorldFit
    believed: WorldFit
    groups: PulseGroups
    noise: NoiseEstimate
    pose: FloatArray


def survey_of(scenario: Scenario, yard: Path) -> SurveyOptions:
    """Return the options by which `locate` reads a survey made with the array and pose sensor of a scenario.

    Raises:
        InputFileError: If its elements are not level or not on the ring.
    """
    array, sensor, boresights_deg = scenario.array, scenario.pose_sensor, None
    if array.elements:
        if any(element.elevation_deg != 0.0 or element.position_m is not None for element in array.elements):
            raise InputFileError([f"{yard}: array.elements: must be level and on the ring, for a gap report"])
        boresights_deg = tuple(element.azimuth_deg for element in array.elements)
    elif array.n_channels != 6:
        boresights_deg = tuple(90.0 - 360.0 / array.n_channels * k for k in range(array.n_channels))
    return SurveyOptions(
        pattern=None if array.pattern is None else SHIPPED_PATTERNS.get(array.pattern, Path(array.pattern)),
        boresights_deg=boresights_deg,
        ring_radius_m=array.ring_radius_m,
        height_m=array.height_m,
        gain_error=array.gain_error,
        pointing_error_deg=array.pointing_error_deg,
        gain_offset=array.gain_offset,
        position_std_m=sensor.position_std_m,
        heading_std_deg=sensor.heading_std_deg,
        pose_correlation_s=sensor.correlation_s,
        yard=yard,
    )


def compare(
    data: FieldData, scenario: Scenario, survey: SurveyOptions, progress: Callable[[float], None] = lambda share: None
) -> Gap:
    """Locate the sources of a recording, simulate the same drive, and compare both.

    Args:
        data: The recording.
        scenario: Yard, array, receiver, ground and pose errors as they are believed.
        survey: Options of `survey_of`.
        progress: Called with the share of the locating that was done since the last call.

    Raises:
        InputFileError: If the channels differ from those of the scenario, or the recording cannot be compared because
            nothing is confirmed, or because there are too few pulses.
    """
    n = scenario.array.n_channels
    if data.channels.size != n:
        raise InputFileError([f"{data.path}: must have {n} live channels as the scenario, got {data.channels.size}"])
    locator = FieldLocator(data, survey)
    locator.add(data, progress)
    locator.finish()
    if not any(finding.state == "confirmed" for finding in locator.findings):
        raise InputFileError([f"{data.path}: must have a confirmed finding, got none"])
    found = choose_sources(data, scenario, locator.findings)
    groups, group = group_pulses(data.pulses.strengths_v[found.pulse], data.step[found.pulse], found.source)
    noise = estimate_noise(data.pulses.strengths_v[found.pulse], group, scenario.receiver)
    if noise is None:
        must = "must have at least 3 pulses of a source at each of 2 poses, well above the noise"
        raise InputFileError([f"{data.path}: {must}"])
    steps, at = np.unique(groups.step, return_inverse=True)
    groups = groups._replace(step=at.astype(np.intp))
    pose = data.pose[steps]
    fitter = DriveFit(scenario, groups, noise.variance_v2, data.time_s[steps], pose, found.sources)
    believed_ground = scenario.radio.ground
    grounds: tuple[GroundName, ...] = (believed_ground, "gravel", "wet_soil")
    with threadpool_limits(limits=1):  # threads of small matrices wait for one another
        fits: dict[GroundName, WorldFit] = {ground: fitter.solve(ground) for ground in dict.fromkeys(grounds)}
    best = max(fits.values(), key=lambda fit: fit.log_evidence)
    rows = [
        GapRow.of("noise floor", "dB", noise.db, float(np.hypot(noise.std_db, MODEL_DB))),
        GapRow.of("beam width", "%", 100 * (best.world.beam_width - 1), 100 * np.hypot(best.width_std, MODEL_WIDTH)),
        *_gain_rows(best, scenario),
        _ground_row(fits, believed_ground),
        _pose_row(best),
        _unexplained_row(data, scenario, best, noise),
    ]
    return Gap(
        rows=tuple(rows),
        scenario=scenario,
        sources=found.sources,
        fit=best,
        believed=fits[believed_ground],
        groups=groups,
        noise=noise,
        pose=pose,
    )


def _gain_rows(fit: WorldFit, scenario: Scenario) -> list[GapRow]:
    """Return the gain of each channel relative to the median channel; the intervals include their spread."""
    n, db = fit.log_gain.size, 20.0 / np.log(10.0)
    gain_db = db * (fit.log_gain - np.median(fit.log_gain))
    relative = np.eye(n) - 1.0 / n
    variance = np.diag(relative @ fit.log_gain_covariance @ relative.T) + (1.0 + 0.5 * np.pi / n) * (
        scenario.array.gain_error**2
    )
    std_db = np.hypot(db * np.sqrt(variance), MODEL_DB)
    return [GapRow.of(f"gain of channel {k + 1}", "dB", gain_db[k], std_db[k]) for k in range(n)]


def _ground_row(fits: dict[GroundName, WorldFit], expected: GroundName) -> GapRow:
    """Return the material of the ground that explains the levels best."""
    evidence = {ground: fit.log_evidence for ground, fit in fits.items()}
    best = max(evidence, key=lambda ground: evidence[ground])
    possible = tuple(ground for ground in evidence if evidence[ground] > evidence[best] - LEAST_EVIDENCE)
    return GapRow(
        quantity="ground",
        unit="",
        estimate=best,
        interval=possible,
        expected=expected,
        is_claimed=expected not in possible,
    )


def _pose_row(fit: WorldFit) -> GapRow:
    """Return the errors of the poses relative to the stated ones."""
    total, middle = np.cumsum(fit.ratio_density), np.log(pose_ratio(fit))
    edges = np.log(RATIOS) + 0.5 * np.log(RATIOS[1] / RATIOS[0])
    ends = np.interp([TAIL, 1.0 - TAIL], total, edges) - middle
    low, high = middle + np.sign(ends) * np.hypot(ends, SIGMAS * MODEL_RATIO)
    return GapRow.within("pose errors", "times", float(np.exp(middle)), (np.exp(low), np.exp(high)), 1.0)


def pose_ratio(fit: WorldFit) -> float:
    """Return the mean estimate of the pose errors relative to the stated ones."""
    return float(np.exp(fit.ratio_density @ np.log(RATIOS)))


def _unexplained_row(data: FieldData, scenario: Scenario, fit: WorldFit, noise: NoiseEstimate) -> GapRow:
    """Return the share of pulses whose strength ratios no source causes at the recorded pose.

    It is compared with the share of pulses that are simulated in the fitted world at poses with errors.
    """
    steps, count = np.unique(data.step, return_counts=True)
    n_sources = len(fit.log_level)
    row = np.arange(steps.size)
    drive = NoiseFreeDrive(
        scenario=scenario, step=np.repeat(row, n_sources), source=np.tile(np.arange(n_sources), steps.size)
    )
    rng, scale = np.random.default_rng(0), np.exp(fit.log_gain + fit.log_level[drive.source, np.newaxis])
    off = pose_ratio(fit) * scenario.pose_sensor.std * rng.standard_normal((steps.size, 3))
    model = drive.strengths(data.pose[steps], fit.world) * scale
    simulated = drive.strengths(data.pose[steps] + off, fit.world) * scale
    simulated = simulated + np.sqrt(noise.variance_v2) * rng.standard_normal(model.shape)
    at = np.searchsorted(steps, data.step)
    recorded = data.pulses.strengths_v
    level_v = np.linalg.norm(simulated, axis=1)
    weight = (level_v >= np.linalg.norm(recorded, axis=1).min()).astype(np.float64)
    model = model.reshape(steps.size, n_sources, -1)
    total_v2 = noise.variance_v2 * model.shape[2]

    def unexplained(strengths_v: FloatArray, step: IntArray) -> FloatArray:
        """Return 1 for pulses that no source causes, else 0."""
        agreement = agreements(strengths_v, model[step], np.full(len(strengths_v), total_v2))
        return (agreement.max(axis=1) == 0.0).astype(np.float64)

    of_recorded = np.bincount(at, unexplained(recorded, at), steps.size) / count
    n_simulated = np.bincount(drive.step, weight, steps.size)
    of_simulated = np.bincount(drive.step, weight * unexplained(simulated, drive.step), steps.size)
    of_simulated /= np.maximum(n_simulated, 1.0)
    share = count / count.sum()
    estimate, expected = float(share @ of_recorded), float(share @ of_simulated)
    apart = of_recorded - of_simulated - (estimate - expected)
    std = float(np.sqrt(np.square(share * apart).sum() + 0.25 * np.square(share).sum() * 0.01))
    ends = max(estimate - SIGMAS * std, 0.0), min(estimate + SIGMAS * std, 1.0)
    return GapRow.within("pulses unexplained", "%", 100 * estimate, (100 * ends[0], 100 * ends[1]), 100 * expected)


def fitted_scenario(gap: Gap, name: str) -> str:
    """Return the scenario with the fitted values as TOML; only gains of channels that clearly differ are changed."""
    scenario, fit = gap.scenario, gap.fit
    sensor, ratio = scenario.pose_sensor, pose_ratio(fit)
    data = scenario.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    gains = [row for row in gap.rows if row.quantity.startswith("gain of channel")]
    faults: list[dict[str, Any]] = [
        {"channel": k + 1, "kind": "gain_drift", "gain_db": row.estimate}
        for k, row in enumerate(gains)
        if row.is_claimed
    ]
    data["name"] = name
    data["receiver"] = data.get("receiver", {}) | {"noise_v": scenario.receiver.noise_v * 10 ** (gap.noise.db / 20)}
    data["radio"] = data.get("radio", {}) | {"ground": fit.world.ground}
    data["nature"] = {
        "array": {"beam_width_scale": fit.world.beam_width},
        "pose_sensor": {
            "position_std_m": ratio * sensor.position_std_m,
            "heading_std_deg": ratio * sensor.heading_std_deg,
        },
    } | ({"receiver": {"faults": faults}} if faults else {})
    rate_hz = float(np.median(gap.groups.n_pulses))
    data["sources"] = [
        {
            "name": f"source_{number}",
            "position_m": np.round(position_m, 6).tolist(),
            "amplitude_v": float(np.exp(level + np.median(fit.log_gain))),
            "amplitude_range_db": 0.0,
            "pulse_rate_hz": rate_hz,
            "polarisation": axis.tolist(),
        }
        for number, (position_m, level, axis) in enumerate(
            zip(fit.world.positions_m, fit.log_level, fit.world.axes, strict=True), start=1
        )
    ]
    return tomlkit.dumps(data)
