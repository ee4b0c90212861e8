"""One emitter located from levels: coverage, symmetry, ambiguity, turned boresights, space."""

from typing import Any

import numpy as np
import pytest

from dirmusic.array.pattern import GaussianPattern
from dirmusic.arrays import FloatArray
from dirmusic.locating.level_fit import LevelEstimate, locate_level
from dirmusic.locating.level_model import LevelChannel, LevelLikelihood, LevelModel, LevelRows

MODEL = LevelModel((LevelChannel(GaussianPattern()),), white_db=1.0, shadow_db=1.0)
TRUTH_M = np.array([1.0, 2.0])


def survey(model: LevelModel, truth_m: FloatArray, rng: np.random.Generator, n: int = 14) -> LevelRows:
    """Draw levels of one antenna that is moved through a room of 8 m and turned, with the errors of the model."""
    position_m = rng.uniform(-4.0, 4.0, (n, truth_m.size))
    rows = LevelRows(np.zeros(n), position_m, rng.uniform(-np.pi, np.pi, n), np.zeros(n, dtype=np.intp))
    off_m = (truth_m - position_m)[np.newaxis]
    range_m = np.maximum(np.linalg.norm(off_m[0], axis=-1), model.least_range_m)
    mean_db = model.gain_db(rows, off_m, 0.0)[0] - 10.0 * model.exponent * np.log10(range_m)
    errors_db = rng.multivariate_normal(np.zeros(n), model._replace(source_std_db=0.0).error_covariance(rows))
    return rows._replace(level_db=mean_db + errors_db - 40.0)


def located(rows: LevelRows, model: LevelModel = MODEL, turn_rad: FloatArray | None = None) -> LevelEstimate:
    n_axes = rows.position_m.shape[1]
    return locate_level(rows, model, np.full(n_axes, -6.0), np.full(n_axes, 6.0), turn_rad)


def test_ellipse_holds_the_truth_in_95_percent() -> None:
    """Of 40 truths drawn over the room, at least 34 lie in their ellipses (binomial at 95 %: 34 or more in 99 %)."""
    rng = np.random.default_rng(0)
    truths_m = rng.uniform(-4.0, 4.0, (40, 2))
    inside = [located(survey(MODEL, truth_m, rng)).holds(truth_m) for truth_m in truths_m]
    assert sum(inside) >= 34


def test_quarter_turn_of_the_survey_turns_the_estimate() -> None:
    rows = survey(MODEL, TRUTH_M, np.random.default_rng(1))
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = rows._replace(position_m=rows.position_m @ quarter.T, boresight_rad=rows.boresight_rad + np.pi / 2)
    first, second = located(rows), located(turned)
    np.testing.assert_allclose(second.position_m, quarter @ first.position_m, atol=1e-6)
    np.testing.assert_allclose(second.covariance_m2, quarter @ first.covariance_m2 @ quarter.T, rtol=1e-6, atol=1e-9)


def test_common_offset_of_all_levels_changes_nothing() -> None:
    rows = survey(MODEL, TRUTH_M, np.random.default_rng(2))
    louder = located(rows._replace(level_db=rows.level_db + 7.0), MODEL._replace(source_std_db=1e4))
    np.testing.assert_allclose(
        louder.position_m, located(rows, MODEL._replace(source_std_db=1e4)).position_m, atol=1e-3
    )


def test_omnidirectional_receivers_on_a_line_do_not_locate() -> None:
    """Both sides of the line explain the levels equally well."""
    model = LevelModel((LevelChannel(),), white_db=0.3, shadow_db=0.0)
    rows = survey(model, TRUTH_M, np.random.default_rng(3))
    on_line = rows._replace(position_m=rows.position_m * [1.0, 0.0])
    range_m = np.linalg.norm(TRUTH_M - on_line.position_m, axis=1)
    found = located(on_line._replace(level_db=-20.0 * np.log10(range_m)), model)
    assert not found.is_located
    assert found.holds(TRUTH_M * [1.0, -1.0])
    assert found.holds(TRUTH_M)


def test_unknown_turn_of_the_boresights_is_found() -> None:
    rows = survey(MODEL, TRUTH_M, np.random.default_rng(4), n=30)
    turned = rows._replace(boresight_rad=rows.boresight_rad - np.radians(40.0))
    free = located(turned, turn_rad=np.radians(np.arange(-180.0, 180.0, 10.0)))
    assert np.degrees(free.turn_rad) == pytest.approx(40.0, abs=10.1)
    assert free.holds(TRUTH_M)
    assert np.linalg.norm(free.position_m - TRUTH_M) < 0.5 * np.linalg.norm(located(turned).position_m - TRUTH_M)


def test_position_in_space_is_located() -> None:
    truth_m = np.array([1.0, 2.0, 1.5])
    found = located(survey(MODEL, truth_m, np.random.default_rng(5), n=60))
    assert found.holds(truth_m)
    assert np.linalg.norm(found.position_m - truth_m) < 1.0


def test_rows_at_one_place_count_as_few_where_errors_are_shared() -> None:
    """Ten surveys at the same poses, which share their shadowing, add next to nothing."""
    rng = np.random.default_rng(6)
    model = MODEL._replace(shadow_db=3.0, shadow_common=1.0, white_db=0.1)
    rows = survey(model, TRUTH_M, rng)
    columns: list[Any] = [np.concatenate([column] * 10) for column in rows]
    copies = LevelRows(*columns)
    copies = copies._replace(level_db=copies.level_db + rng.normal(0.0, 0.1, copies.level_db.size))
    assert located(copies, model).semi_major_m > 0.5 * located(rows, model).semi_major_m


def test_passive_link_counts_the_pattern_twice() -> None:
    rows = survey(MODEL, TRUTH_M, np.random.default_rng(7))
    towards_m = (TRUTH_M - rows.position_m)[np.newaxis]
    once, twice = (MODEL._replace(passes=k).gain_db(rows, towards_m, 0.0) for k in (1, 2))
    np.testing.assert_allclose(twice, 2.0 * once)


def test_exponent_integrated_out_equals_a_sum_over_exponents() -> None:
    """At fixed scale (many degrees of freedom) the closed form equals a sum over a grid of exponents."""
    model = MODEL._replace(degrees_of_freedom=1e7)
    rows = survey(model, TRUTH_M, np.random.default_rng(8))
    places_m = np.array([[1.0, 2.0], [-2.0, 0.5], [3.0, -3.0]])
    closed = LevelLikelihood(rows, model)(places_m, np.zeros(1))[0]
    exponents = np.linspace(-2.0, 6.0, 401)
    each = [
        LevelLikelihood(rows, model._replace(exponent=n, exponent_std=0.0))(places_m, np.zeros(1))[0] for n in exponents
    ]
    weighted = np.array(each) - 0.5 * np.square((exponents[:, np.newaxis] - model.exponent) / model.exponent_std)
    summed = np.logaddexp.reduce(weighted, axis=0)
    np.testing.assert_allclose(np.diff(closed), np.diff(summed), atol=1e-3)
