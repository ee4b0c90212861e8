"""Doubts about units and conventions: usual mistakes in a table that would explain why its pulses do not fit.

Many pulses of a sound survey point at one place. If they do not as the survey is given, but would without one of the
usual mistakes, that mistake is likely. If they do, times and levels may still have another unit: directions are then
the same, but findings count as unlikely. Saturated strengths mainly change heights. A doubt is a note; it never changes
the data.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from pyproj import Proj

from dirmusic import GainManifold, TabulatedPattern
from dirmusic.angles import azimuth_of, unit_vector, wrap
from dirmusic.array.manifold import SEARCH_AZIMUTHS_RAD, nearest_search_azimuth
from dirmusic.arrays import FloatArray
from dirmusic.locating.bearing_fit import START_RANGES_M
from dirmusic.locating.pulse_pool import choose_evenly
from pdpatrol.missions.field.field_data import FieldData
from pdpatrol.missions.field.survey import HEADINGS, Heading, SurveyOptions

DIRECTION_MISMATCH, LEAST_MISMATCH = 0.12, 0.24
"""Sines of the angle between the strengths of a pulse and the expected ones, as vectors, at which a pulse counts as
explained by 61 %: beyond the least angle in any direction, and of that least angle (assumed). Errors of an array cause
0.07 to 0.1, and 10 degrees of azimuth cause 0.14. Elevations and reflections increase the least angle."""

MAX_NOISE = 0.15
"""Largest noise of a pulse that is used, relative to its strength (assumed)."""

MAX_PULSES, MAX_LINES = 80, 16
"""Numbers of pulses that are compared, and of those on whose lines of sight places are tried (assumed)."""

LEAST_STEPS = 6
"""Number of poses below which no mistake is doubted: any few lines of sight nearly cross somewhere (assumed)."""

GIVEN_SHARE, FITTED_SHARE, LEAST_GAIN, LEAST_GAIN_RADIANS = 0.9, 0.5, 0.2, 0.08
"""Share of the pulses that are explained as given, up to which a mistake is possible; share without the mistake, from
which on it is likely; and least difference of both, also for headings that all lie within 2 pi degrees, as those in
radians do. In 200 random surveys without a mistake, other shares are at most 0.17 larger
(`tests/missions/field/test_doubts.py`)."""

TIE = 0.03
"""Difference of shares up to which two mistakes are equally likely (assumed)."""

TURN_STEP_DEG, LEAST_TURN_DEG = 10, 20
"""Step and smallest angle of the turns of the array that are tried; the Locator estimates smaller ones."""

LEAST_DECIBELS, MOST_DECIBELS = 2.0, 300.0
"""Median of strengths from which on, and largest strength up to which, they may be decibels (assumed). Receivers
measure less than two volts."""

MAX_SITE_DEG = 0.1
"""Size of a site in degrees, up to which its positions may be degrees: 11 km (assumed)."""

LEAST_SATURATED = 4
"""Number of pulses with the largest strength of a channel, and multiple of those with the next smaller one, from which
on the channel may be saturated (assumed). Of rounded strengths, the largest occur less often than smaller ones."""

MAX_SPEED = 30.0
"""Largest mean speed between poses, m/s, at which times may be seconds. Assumed; times in hours make a walk 3600 times
faster."""

REFINED = (0.08, 0.03)
"""Steps of the grid around a place by which it is refined, relative to its range."""

SQUARE = np.stack(np.meshgrid(np.arange(-3, 4), np.arange(-3, 4)), axis=-1).reshape(-1, 2)
"""Grid around a place, shape (49, 2)."""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Survey as somebody may have meant it; n rows, one for each pulse.

    Attributes:
        place_m: Position of the array, shape (n, 2).
        angle_deg: Heading as written in the table, shape (n,).
        heading: Convention of that angle.
        turn_rad: Turn of the array on its mount, counter-clockwise.
        strengths_v: Shape (n, n_channels).
        weight: Weights of the pulses, with the sum 1, shape (n,).
        manifold: Gains of the array.
    """

    place_m: FloatArray
    angle_deg: FloatArray
    heading: Heading
    turn_rad: float = 0.0
    strengths_v: FloatArray
    weight: FloatArray
    manifold: GainManifold

    @property
    def yaw_rad(self) -> FloatArray:
        """Direction of the array's x axis, counter-clockwise from the x axis of the world, shape (n,)."""
        return np.radians(HEADINGS[self.heading].yaw_deg(self.angle_deg)) + self.turn_rad

    def explained(self) -> float:
        """Return the share of the pulses that point at the place where most lines of sight cross, in [0, 1]."""
        unit = self.strengths_v / np.linalg.norm(self.strengths_v, axis=1, keepdims=True)
        mismatch = 1.0 - np.square(unit @ self.manifold.search_unit_gain)
        least = mismatch.min(axis=1, keepdims=True)
        fit = np.exp(-0.5 * (mismatch - least) / DIRECTION_MISMATCH**2 - 0.5 * least / LEAST_MISMATCH**2)
        lines = np.unique(np.linspace(0, len(fit) - 1, MAX_LINES).astype(int))
        bearing_rad = SEARCH_AZIMUTHS_RAD[mismatch[lines].argmin(axis=1)] + self.yaw_rad[lines]
        along_m = START_RANGES_M[:, np.newaxis, np.newaxis] * unit_vector(bearing_rad)
        places_m = (self.place_m[lines] + along_m).reshape(-1, 2)
        shares = self._fit_at(places_m, fit) @ self.weight
        place_m, share = places_m[shares.argmax()], shares.max()
        for step in REFINED:
            range_m = np.median(np.linalg.norm(place_m - self.place_m, axis=1))
            near_m = place_m + step * range_m * SQUARE
            shares = self._fit_at(near_m, fit) @ self.weight
            place_m, share = near_m[shares.argmax()], shares.max()
        return float(share)

    def _fit_at(self, places_m: FloatArray, fit: FloatArray) -> FloatArray:
        """Return how well each pulse fits a source at each place, in [0, 1], shape (n_places, n).

        Args:
            places_m: Shape (n_places, 2).
            fit: How well each pulse fits each search azimuth, shape (n, n_azimuths).
        """
        sight_m = places_m[:, np.newaxis] - self.place_m
        azimuth = nearest_search_azimuth(azimuth_of(sight_m) - self.yaw_rad)
        is_in_range = np.linalg.norm(sight_m, axis=-1) <= START_RANGES_M[-1]
        return np.where(is_in_range, fit[np.arange(len(fit)), azimuth], 0.0)


class Mistake(NamedTuple):
    """Usual mistake, and the survey without it.

    Attributes:
        kind: Short name.
        cause: The likely cause of the misfit, in words.
        remedy: What corrects it.
        corrected: The survey as meant.
        least_gain: Difference of the shares of explained pulses from which on the mistake is likely.
    """

    kind: str
    cause: str
    remedy: str
    corrected: Reading
    least_gain: float = LEAST_GAIN


def doubts(data: FieldData, manifold: GainManifold, survey: SurveyOptions) -> list[str]:
    """Return notes on mistakes that would explain why the pulses of a survey do not fit; usually none.

    Args:
        data: The survey.
        manifold: Gains of the live channels according to the data sheet.
        survey: Options by which the survey was read.
    """
    pulses = data.pulses
    energy_v2 = np.square(pulses.strengths_v).sum(axis=1)
    noise_v2 = pulses.variance_v2.sum(axis=1)
    rows = choose_evenly(np.flatnonzero(noise_v2 <= MAX_NOISE**2 * energy_v2), MAX_PULSES)
    saturated = list(_of_saturation(data))
    _, number, count = np.unique(data.step[rows], return_inverse=True, return_counts=True)
    if count.size < LEAST_STEPS:
        return saturated
    at = data.pose[data.step[rows]]
    given = Reading(
        place_m=at[:, :2],
        angle_deg=HEADINGS[survey.heading].yaw_deg(np.degrees(at[:, 2])),
        heading=survey.heading,
        strengths_v=pulses.strengths_v[rows],
        weight=1.0 / (count[number] * count.size),
        manifold=manifold,
    )
    given_share = given.explained()
    if likely := list(_likely(given, given_share, data)):
        notes = [
            f"{mistake.cause}: then {100 * share:.0f} % of the pulses point at one place, as given "
            f"{100 * given_share:.0f} %; if so, {mistake.remedy}"
            for share, mistake in likely
        ]
    elif given_share > FITTED_SHARE:
        notes = [*_of_times(data), *_of_large_strengths(given)]
    else:
        notes = []
    return [*notes, *saturated]


def _likely(given: Reading, given_share: float, data: FieldData) -> Iterator[tuple[float, Mistake]]:
    """Yield the likely mistakes, the best one first, with the share of the pulses that are explained without each."""
    if given_share > GIVEN_SHARE:
        return
    mistakes = [*_of_headings(given), *_of_places(given), *_of_values(given)]
    if data.channels.size == data.n_recorded:  # else the options would not match the channels
        mistakes += _of_array(given)
    best = dict[str, tuple[float, Mistake]]()
    for mistake in mistakes:
        share = mistake.corrected.explained()
        if share >= max(FITTED_SHARE, given_share + mistake.least_gain) and share > best.get(mistake.kind, (0.0,))[0]:
            best[mistake.kind] = share, mistake
    most = max((share for share, _ in best.values()), default=0.0)
    yield from sorted((each for each in best.values() if each[0] >= most - TIE), key=lambda each: -each[0])


def _of_saturation(data: FieldData) -> Iterator[str]:
    """Yield the doubt that strengths of channels end at the full scale of the receiver."""
    for channel, strength_v in zip(data.channels + 1, data.pulses.strengths_v.T, strict=True):
        value_v, count = np.unique(strength_v, return_counts=True)
        if count.size > 1 and count[-1] >= LEAST_SATURATED * max(1, count[-2]):
            yield (
                f"channel {channel} may be saturated: {count[-1]} pulses have exactly its largest strength, "
                f"{value_v[-1]:.3g} V, which makes heights wrong; if so, leave them out"
            )


def _of_times(data: FieldData) -> Iterator[str]:
    """Yield the doubt that the column time_s does not hold seconds."""
    path_m = float(np.linalg.norm(np.diff(data.pose[:, :2], axis=0), axis=1).sum())
    duration_s = float(data.time_s[-1] - data.time_s[0])
    if path_m > MAX_SPEED * duration_s:
        yield (
            f"time_s may not hold seconds: the poses are {path_m:.3g} m apart along the path and {duration_s:.3g} s in "
            "time; if so, convert it to seconds, because the errors of poses of about the same time count as one"
        )


def _of_large_strengths(given: Reading) -> Iterator[str]:
    """Yield the doubt that strengths are multiples of a smaller unit, which changes their level only."""
    median_v = float(np.median(given.strengths_v.max(axis=1)))
    if median_v >= LEAST_DECIBELS:
        yield (
            f"strengths may be millivolts or microvolts: the median of the strongest channel is {median_v:.3g} V, and "
            "receivers measure less than 2 V; if so, convert them and their deviations to volts"
        )


def _of_headings(given: Reading) -> Iterator[Mistake]:
    """Yield mistakes in the column yaw_deg."""
    for name, convention in HEADINGS.items():
        if name != given.heading:
            yield Mistake(
                name, f"yaw_deg may hold {convention.text}", f"use --heading {name}", replace(given, heading=name)
            )
    if 0.0 < np.abs(given.angle_deg).max() <= 2 * np.pi:
        meant = replace(given, angle_deg=np.degrees(given.angle_deg))
        yield Mistake("radians", "yaw_deg may hold radians", "convert it to degrees", meant, LEAST_GAIN_RADIANS)


def _of_places(given: Reading) -> Iterator[Mistake]:
    """Yield mistakes in the columns x_m and y_m."""
    low_m, high_m = given.place_m.min(axis=0), given.place_m.max(axis=0)
    size_m = (high_m - low_m).max()
    if size_m > START_RANGES_M[-1]:
        meant = replace(given, place_m=1e-3 * given.place_m)
        yield Mistake("millimetres", "x_m and y_m may be millimetres", "convert them to metres", meant)
    exchanged = replace(given, place_m=given.place_m[:, ::-1])
    yield from _with_any_heading("exchanged", "x_m and y_m may be exchanged", "exchange them", exchanged)
    for axis, text in enumerate(("longitude and latitude", "latitude and longitude")):
        longitude_deg, latitude_deg = given.place_m[:, axis], given.place_m[:, 1 - axis]
        if 0.0 < size_m <= MAX_SITE_DEG and np.abs(latitude_deg).max() <= 85.0 and np.abs(longitude_deg).max() <= 180.0:
            ground = Proj(proj="aeqd", lat_0=latitude_deg[0], lon_0=longitude_deg[0], ellps="WGS84")
            place_m = np.stack(ground(longitude_deg, latitude_deg), axis=-1)
            text, remedy = f"x_m and y_m may be {text} in degrees", "convert them to metres east and north"
            yield from _with_any_heading("degrees", text, remedy, replace(given, place_m=place_m))


def _with_any_heading(kind: str, cause: str, remedy: str, meant: Reading) -> Iterator[Mistake]:
    """Yield a mistake in the places, alone and together with one in the heading, which may be of a compass."""
    yield Mistake(kind, cause, remedy, meant)
    for name, convention in HEADINGS.items():
        if name != meant.heading:
            both = f"{cause}, and yaw_deg {convention.text}"
            yield Mistake(kind, both, f"{remedy}, and use --heading {name}", replace(meant, heading=name))


def _of_values(given: Reading) -> Iterator[Mistake]:
    """Yield mistakes in the strengths, and in the gains of a pattern from a file."""
    strengths_v = given.strengths_v
    if np.median(strengths_v) >= LEAST_DECIBELS and strengths_v.max() <= MOST_DECIBELS:
        volts = 10 ** ((strengths_v - strengths_v.max()) / 20)
        yield Mistake(
            "decibels",
            "strengths may be decibels instead of volts",
            "convert them by 10^(dB / 20)",
            replace(given, strengths_v=volts),
        )
    pattern = given.manifold.pattern
    if isinstance(pattern, TabulatedPattern):
        upright = TabulatedPattern(pattern.off_boresight_rad, 1.0 / pattern.table_gain)
        yield Mistake(
            "pattern upside down",
            "--pattern may state attenuation as gain",
            "change the sign of its decibels",
            replace(given, manifold=GainManifold(upright, given.manifold.boresights_rad)),
        )


def _of_array(given: Reading) -> Iterator[Mistake]:
    """Yield mistakes in the order of the channels, and turns of the array, of its pattern or of its elements."""
    n = given.manifold.n_elements
    boresights_deg = np.degrees(given.manifold.boresights_rad)
    for kind, order in (("order reversed", np.arange(n)[::-1]), ("order rotated", np.arange(n))):
        for shift in range(n):
            chosen = np.roll(order, shift)
            if not np.array_equal(chosen, np.arange(n)):
                yield Mistake(
                    kind,
                    f"channels may be in another order: {' '.join(map(str, chosen + 1))}",
                    f"use --boresights-deg {_in_words(boresights_deg[chosen])}",
                    replace(given, manifold=given.manifold.take(chosen)),
                )
    for turn_deg in range(LEAST_TURN_DEG, 361 - LEAST_TURN_DEG, TURN_STEP_DEG):
        yield Mistake(
            "turned",
            f"the array, or the zero of its pattern, may be turned by about {_in_words(np.array([turn_deg]))} degrees",
            f"use --boresights-deg {_in_words(boresights_deg + turn_deg)}",
            replace(given, turn_rad=np.radians(turn_deg)),
        )


def _in_words(angles_deg: FloatArray) -> str:
    """Return angles in (-180, 180], separated by spaces."""
    return " ".join(f"{np.degrees(wrap(np.radians(angle_deg))):.0f}" for angle_deg in angles_deg)
