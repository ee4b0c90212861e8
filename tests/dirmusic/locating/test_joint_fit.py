"""Sources and array fitted together: accuracy, stated regions and error levels, with and without mismatch."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline
from scipy.stats import binom, chi2

from dirmusic import ArrayModel, GainManifold
from dirmusic.array.pattern_file import read_spatial_pattern
from dirmusic.arrays import FloatArray
from dirmusic.locating.joint_fit import (
    TILT_PRIOR_RAD,
    UNEXPLAINED_PRIOR,
    WIDENING_PRIOR,
    YAW_PRIOR_RAD,
    JointEstimate,
    JointFit,
)
from dirmusic.locating.measurement import PooledPulses
from pdpatrol.sensing.array.helical_array import SHIPPED_PATTERNS
from tests.dirmusic.locating.forward_model import (
    ARRAY,
    BOARD_RAD,
    BOARDS_M,
    GRAVEL,
    POSE_ERROR,
    START,
    WET_SOIL,
    Nature,
    Survey,
    drawn_errors,
    survey,
)

SHARES = np.array([0.5, 0.68, 0.9, 0.95])
FAR = 1e-9
"""Probability of a coverage outside the band when the stated one is right."""


class Outcome:
    """Surveys of one nature with their fits.

    Attributes:
        miss_m: Errors of the positions, shape (n, 3).
        covariance_m2: Stated covariances, shape (n, 3, 3).
    """

    def __init__(self, surveys: list[Survey], array: ArrayModel = ARRAY) -> None:
        self.surveys, self.fits = surveys, [each.fit(array) for each in surveys]
        self.miss_m = np.array([fit.positions_m[0] - own.place_m for fit, own in zip(self.fits, surveys, strict=True)])
        self.covariance_m2 = np.array([fit.covariances_m2[0] for fit in self.fits])

    def n_inside(self, dimensions: int) -> FloatArray:
        """Return how many truths lie in the regions of `SHARES`, on plan or in space."""
        miss_m, covariance_m2 = self.miss_m[:, :dimensions], self.covariance_m2[:, :dimensions, :dimensions]
        square = np.einsum("ki,ki->k", miss_m, np.linalg.solve(covariance_m2, miss_m[..., np.newaxis])[..., 0])
        return (square[:, np.newaxis] < chi2.ppf(SHARES, dimensions)).sum(axis=0)

    @property
    def height_bias(self) -> float:
        """Mean error of the height in stated deviations."""
        return float((self.miss_m[:, 2] / np.sqrt(self.covariance_m2[:, 2, 2])).mean())


def surveyed(make: Callable[[np.random.Generator], Nature], n: int, *, interferes: bool = False) -> list[Survey]:
    generators = [np.random.default_rng([9, k]) for k in range(n)]
    return [survey(rng, make(rng), interferes=interferes) for rng in generators]


def believed(rng: np.random.Generator) -> Nature:
    """Draw a nature by the priors, without ground."""
    errors = drawn_errors(rng, yaw_rad=rng.normal(0.0, YAW_PRIOR_RAD))
    about_x, about_y = rng.normal(0.0, TILT_PRIOR_RAD, 2)
    return Nature(errors=errors, widening=rng.normal(0.0, WIDENING_PRIOR), tilt_rad=(about_x, about_y))


@cache
def in_free_field() -> Outcome:
    surveys = list[Survey]()
    for k in range(150):
        rng = np.random.default_rng([9, k])
        unexplained = UNEXPLAINED_PRIOR[0] * np.exp(rng.normal(0.0, UNEXPLAINED_PRIOR[1]))
        surveys.append(survey(rng, believed(rng), unexplained=unexplained))
    return Outcome(surveys)


@pytest.mark.whole
@pytest.mark.parametrize("dimensions", [2, 3])
def test_regions_in_free_field_cover_as_stated(dimensions: int) -> None:
    """If all is drawn by the priors, regions hold the stated share, within the binomial band of 99 %."""
    n_inside = in_free_field().n_inside(dimensions)
    low, high = binom.interval(0.99, len(in_free_field().surveys), SHARES)
    assert (n_inside >= low).all()
    assert (n_inside <= high).all()


@pytest.mark.whole
@pytest.mark.parametrize("dimensions", [2, 3])
def test_error_in_free_field_is_near_the_bound(dimensions: int) -> None:
    """Over natures drawn by the priors, the root mean square error is at most 1.1 times that of the information."""
    outcome = in_free_field()
    square_m2 = np.square(outcome.miss_m[:, :dimensions]).sum(axis=-1)
    bound_m2 = np.trace(outcome.covariance_m2[:, :dimensions, :dimensions], axis1=1, axis2=2)
    assert np.sqrt(np.mean(square_m2 / bound_m2)) <= 1.10


MISMATCHES: dict[str, Callable[[np.random.Generator], Nature]] = {
    "wider 5 %": lambda rng: Nature(errors=drawn_errors(rng), widening=0.05),
    "narrower 5 %": lambda rng: Nature(errors=drawn_errors(rng), widening=-0.05),
    "wider 15 %": lambda rng: Nature(errors=drawn_errors(rng), widening=0.15),
    "narrower 15 %": lambda rng: Nature(errors=drawn_errors(rng), widening=-0.15),
    "tilt": lambda rng: Nature(errors=drawn_errors(rng), tilt_rad=(np.radians(2.0), 0.0)),
    "yaw": lambda rng: Nature(errors=drawn_errors(rng, yaw_rad=np.radians(2.0))),
    "gravel": lambda rng: Nature(errors=drawn_errors(rng), permittivity=GRAVEL),
    "wet soil": lambda rng: Nature(errors=drawn_errors(rng), permittivity=WET_SOIL),
}


@pytest.mark.parametrize(
    "name", ["wider 5 %", *(pytest.param(name, marks=pytest.mark.whole) for name in MISMATCHES if name != "wider 5 %")]
)
def test_regions_hold_when_nature_differs(name: str) -> None:
    """With a beam, mount or ground unlike the data sheet, 95 % regions hold the truth and heights are unbiased."""
    outcome = Outcome(surveyed(MISMATCHES[name], 60, interferes=name in {"gravel", "wet soil"}))
    least = binom.ppf(0.01, 60, 0.95)
    assert outcome.n_inside(2)[-1] >= least
    assert outcome.n_inside(3)[-1] >= least
    assert abs(outcome.height_bias) < 0.45  # 3 deviations of the mean of 60 would be 0.39


def test_height_regions_cover_the_mirror_image() -> None:
    """A level array hardly distinguishes a source below its plane from one above, so the deviation covers both."""
    place_m, surveys = np.array([0.3, -0.2, 0.3]), list[Survey]()
    for k in range(16):
        rng = np.random.default_rng([11, k])
        surveys.append(
            survey(rng, Nature(errors=drawn_errors(rng), permittivity=GRAVEL), interferes=True, place_m=place_m)
        )
    outcome = Outcome(surveys)
    sigmas = np.abs(outcome.miss_m[:, 2]) / np.sqrt(outcome.covariance_m2[:, 2, 2])
    assert (outcome.miss_m[:, 2] > 0.4).any()
    assert np.count_nonzero(sigmas < 1.96) >= binom.ppf(0.01, 16, 0.95)


@pytest.mark.whole
def test_widening_of_the_beam_is_found() -> None:
    """A beam 15 % wider or narrower is found with its stated deviation, and far from 0."""
    for name, widening in (("wider 15 %", 0.15), ("narrower 15 %", -0.15)):
        fits = Outcome(surveyed(MISMATCHES[name], 20)).fits
        z = [(fit.state[3] - widening) / np.sqrt(fit.covariance[3, 3]) for fit in fits]
        assert np.sqrt(np.square(z).mean()) < 1.5
        assert abs(np.mean([fit.state[3] for fit in fits]) - widening) < 0.05


@cache
def helix() -> tuple[Callable[[FloatArray, FloatArray], FloatArray], ArrayModel]:
    """Return the gain of the computed helix in its ring, and an array whose data sheet is its cut in the plane."""
    pattern = read_spatial_pattern(SHIPPED_PATTERNS["helix_in_ring"])
    azimuth_rad, elevation_rad = np.radians(np.arange(-180.0, 181.0, 2.0)), np.radians(np.arange(-90.0, 91.0, 2.0))
    at, up = np.meshgrid(azimuth_rad, elevation_rad, indexing="ij")
    of_band = pattern.gain(at.ravel(), up.ravel(), np.linspace(1.4e9, 2.2e9, 33))
    gain = np.sqrt(np.square(of_band).mean(axis=0)).reshape(at.shape)
    spline = RectBivariateSpline(azimuth_rad, elevation_rad, gain)
    array = ArrayModel(manifold=GainManifold(pattern.cut(), BOARD_RAD), positions_m=BOARDS_M, spread=ARRAY.spread)
    return lambda off, up: spline.ev(np.mod(off + np.pi, 2 * np.pi) - np.pi, up), array


@pytest.mark.whole
def test_regions_hold_with_computed_helices() -> None:
    """With helices known in the plane only, 95 % regions hold the truth."""
    gain, array = helix()
    outcome = Outcome(surveyed(lambda rng: Nature(errors=drawn_errors(rng), gain_of_direction=gain), 40), array)
    assert outcome.n_inside(2)[-1] >= binom.ppf(0.01, 40, 0.95)


@pytest.mark.parametrize("unexplained", [0.02, pytest.param(0.1, marks=pytest.mark.whole)])
def test_regions_hold_with_any_multipath(unexplained: float) -> None:
    """Neighbouring pulses share it, and the array explains a part, so that its size is known within 2.5 times only."""
    surveys = [
        survey(rng, Nature(errors=drawn_errors(rng)), unexplained=unexplained)
        for rng in (np.random.default_rng([10, k]) for k in range(60))
    ]
    outcome = Outcome(surveys)
    assert (outcome.n_inside(2)[2:] >= binom.ppf(0.01, 60, SHARES[2:])).all()
    assert (outcome.n_inside(3)[2:] >= binom.ppf(0.01, 60, SHARES[2:])).all()
    found = np.median([fit.levels.unexplained for fit in outcome.fits])
    assert unexplained / 2.5 < found < 2.5 * unexplained


@pytest.mark.whole
def test_source_below_the_array_is_not_certain_on_the_wrong_side() -> None:
    """A source near the plane of the array is within 4 stated deviations, mostly within 3, from any start."""
    z, apart = [], []
    for k in range(30):
        rng = np.random.default_rng([11, k])
        own = survey(rng, Nature(errors=drawn_errors(rng)), place_m=np.array([0.0, 0.0, rng.uniform(0.05, 1.15)]))
        fits = [own.fit(start_m=np.array([0.3, 0.2, height_m])) for height_m in (0.2, 1.6)]
        miss_m = np.array([fit.positions_m[0, 2] - own.place_m[2] for fit in fits])
        z += list(miss_m / np.sqrt([fit.covariances_m2[0, 2, 2] for fit in fits]))
        apart.append(abs(z[-1] - z[-2]))
    assert np.abs(z).max() < 4.0
    assert np.mean(np.abs(z) > 3.0) < 0.1
    assert np.quantile(apart, 0.75) < 0.01


@pytest.mark.whole
def test_known_errors_are_used() -> None:
    """Errors learned in one mission make the region of a short one smaller, and it still holds the truth."""
    n_inside, ratio = 0, []
    for k in range(30):
        rng = np.random.default_rng([12, k])
        nature = Nature(errors=drawn_errors(rng))
        learned = survey(rng, nature).fit().errors
        own = survey(rng, nature, n=6)
        before, after = own.fit(), own.fit(replace(ARRAY, errors=learned))
        areas = [np.sqrt(np.linalg.det(fit.covariances_m2[0, :2, :2])) for fit in (before, after)]
        miss_m = (after.positions_m[0] - own.place_m)[:2]
        n_inside += int(miss_m @ np.linalg.solve(after.covariances_m2[0, :2, :2], miss_m) < chi2.ppf(0.95, 2))
        ratio.append(areas[1] / areas[0])
    assert np.median(ratio) < 0.9
    assert n_inside >= binom.ppf(0.01, 30, 0.95)


def joined(surveys: list[Survey]) -> PooledPulses:
    """Concatenate the pulses of surveys."""
    columns: list[Any] = [np.concatenate(column) for column in zip(*(own.pulses for own in surveys), strict=True)]
    return PooledPulses(*columns)


def joint(surveys: list[Survey], order: list[int]) -> JointEstimate:
    """Fit two surveys of one array together, numbered by `order`."""
    n = surveys[0].time_s.size
    pulses = joined(surveys)
    start_m = np.array([own.place_m + 0.3 for own in surveys])[np.argsort(order)]
    time_s = np.concatenate([own.time_s for own in surveys])
    source = np.repeat(np.array(order, dtype=np.intp), n)
    level_db = np.concatenate([own.level_db for own in surveys])
    return JointFit(pulses, level_db, time_s, source, np.ones(2 * n), ARRAY, POSE_ERROR).solve(start_m, None, START, 2)


def test_two_sources_share_the_array() -> None:
    """Fitted together, the errors of the array are known better than from either; the order does not matter."""
    rng = np.random.default_rng(13)
    nature = Nature(errors=drawn_errors(rng))
    surveys = [survey(rng, nature) for _ in range(2)]
    both, swapped = joint(surveys, [0, 1]), joint(surveys, [1, 0])
    np.testing.assert_allclose(swapped.positions_m, both.positions_m[::-1], atol=1e-3)
    alone = np.array([np.diag(own.fit().errors.covariance)[:12] for own in surveys])
    assert (np.diag(both.errors.covariance)[:12] < 1.05 * alone.min(axis=0)).all()
    miss = (both.errors.state - np.concatenate([*vars(nature.errors).values()]))[:12]
    assert miss @ np.linalg.solve(both.errors.covariance[:12, :12], miss) < chi2.ppf(0.999, 12)


def test_pulse_that_is_not_of_the_source_has_no_weight() -> None:
    """Pulses with probability 0 do not change the estimate."""
    rng = np.random.default_rng(14)
    own, other = (survey(rng, Nature(errors=drawn_errors(rng))) for _ in range(2))
    pulses = joined([own, other])
    n, start_m = own.time_s.size, own.place_m[np.newaxis]
    time_s, probability = np.concatenate([own.time_s, other.time_s]), np.repeat([1.0, 0.0], n)
    pulses = pulses._replace(pose=np.concatenate([own.pulses.pose, own.pulses.pose]))
    level_db, source = np.concatenate([own.level_db, other.level_db]), np.zeros(2 * n, dtype=np.intp)
    fit = JointFit(pulses, level_db, time_s, source, probability, ARRAY, POSE_ERROR)
    expected = own.fit(start_m=own.place_m)
    np.testing.assert_allclose(fit.solve(start_m, None, START, 4).positions_m, expected.positions_m, atol=1e-6)


def test_pulses_of_one_moment_share_their_errors_and_those_of_one_place_their_multipath() -> None:
    """Pulses repeated at once add little to the estimate, later at the same place more, elsewhere as much as others."""
    rng = np.random.default_rng(15)
    own = survey(rng, Nature(errors=drawn_errors(rng)), place_m=np.array([0.0, 0.0, 2.5]), noise=0.002)
    pulses, n, start_m = joined([own, own]), own.time_s.size, own.place_m[np.newaxis]
    plan_m2 = [np.linalg.det(own.fit().covariances_m2[0, :2, :2])]
    for later_s, turn_rad in ((0.0, 0.0), (1e4, 0.0), (1e4, 0.5 * np.pi)):
        time_s = np.concatenate([own.time_s, own.time_s + later_s])
        x, y, yaw = own.pulses.pose.T
        about_m = np.cos(turn_rad) * x - np.sin(turn_rad) * y, np.sin(turn_rad) * x + np.cos(turn_rad) * y
        elsewhere = pulses._replace(pose=np.concatenate([own.pulses.pose, np.column_stack([*about_m, yaw + turn_rad])]))
        level_db, source = np.tile(own.level_db, 2), np.zeros(2 * n, dtype=np.intp)
        fit = JointFit(elsewhere, level_db, time_s, source, np.ones(2 * n), ARRAY, POSE_ERROR)
        plan_m2.append(np.linalg.det(fit.solve(start_m, None, START, 4).covariances_m2[0, :2, :2]))
    assert plan_m2[1] > 0.85 * plan_m2[0]
    assert 0.6 * plan_m2[0] < plan_m2[2] < 0.97 * plan_m2[0]
    assert plan_m2[3] < 0.6 * plan_m2[0]
