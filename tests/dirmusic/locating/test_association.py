"""Origin of groups of pulses: direction, level, map and shares of a window."""

import numpy as np
import pytest

from dirmusic.arrays import FloatArray
from dirmusic.locating.association import (
    EXCEEDED,
    INTERFERENCE_DB,
    Association,
    Comparison,
    Level,
    associate,
    compare_groups,
    in_sight_probability,
    likelihoods,
    possible_origin,
    window_shares,
)
from dirmusic.locating.joint_fit import array_prior, nominal_array
from dirmusic.locating.measurement import Noise
from dirmusic.locating.pulse_pool import Groups
from tests.dirmusic.locating.forward_model import ARRAY, START, groups_from

LEVEL = Level(-5.0, 2.0)
AHEAD_M, LEFT_M = np.array([6.0, 0.0, 0.9]), np.array([0.0, 6.0, 0.9])
FREE, METAL = 1.0, 1e-3


def compared_with(groups: Groups, place_m: FloatArray, transmission: float) -> Comparison:
    """Compare groups with a source that is known within 0.1 m."""
    prior = array_prior(ARRAY, START)
    uncertainty = np.zeros((3 + prior.mean.size,) * 2)
    uncertainty[:3, :3], uncertainty[3:, 3:] = 0.01 * np.eye(3), np.linalg.inv(prior.information)
    known = prior.mean, uncertainty, nominal_array(ARRAY), Noise(0.05, 0.01, 0.1)
    return compare_groups(groups, place_m, *known, np.full((4, len(groups.pose)), transmission))


def associated(
    groups: Groups,
    places_m: list[FloatArray],
    transmission: float,
    *,
    is_located: bool = True,
    levels: list[Level] | None = None,
) -> Association:
    """Associate groups with sources that are known within 0.1 m, of `LEVEL` by default, with equal shares."""
    compared, k, n = (
        [compared_with(groups, place_m, transmission) for place_m in places_m],
        len(places_m),
        len(groups.pose),
    )
    likelihood = likelihoods(groups, compared, levels or [LEVEL] * k, np.full(k, is_located))
    return associate(likelihood, np.full((k + 1, n), 1.0 / (k + 1)))


def origin(azimuth_deg: float, excess_db: float, transmission: float = FREE) -> tuple[float, float]:
    """Return the probabilities of direct path and multipath of a source ahead, for a pulse above its direct level."""
    group = groups_from(np.zeros((1, 3)), np.radians([azimuth_deg]), 6.0, LEVEL.mean_db + excess_db)
    result = associated(group, [AHEAD_M], transmission)
    return float(result.direct[0, 0]), float(result.multipath[0, 0])


def test_probabilities_of_sources_sum_to_one_at_most() -> None:
    """Each group has a probability of every origin, and no more than one in all."""
    rng = np.random.default_rng(0)
    groups = groups_from(np.zeros((60, 3)), rng.uniform(-np.pi, np.pi, 60), 6.0, rng.normal(-5.0, 15.0, 60))
    for transmission in (FREE, 0.4, METAL):
        result = associated(groups, [AHEAD_M, LEFT_M, 1.2 * AHEAD_M], transmission)
        assert min(result.direct.min(), result.multipath.min()) >= 0.0
        of_any = result.direct.sum(axis=0) + result.multipath.sum(axis=0)
        assert of_any.max() <= 1.0 + 1e-12
        assert of_any.min() < 0.1


@pytest.mark.parametrize(
    ("azimuth_deg", "excess_db", "is_own"),
    [
        (0.0, 0.0, True),
        (0.0, 4.0, True),
        (0.0, 25.0, False),
        (0.0, -25.0, False),
        (25.0, 0.0, False),
        (180.0, 0.0, False),
    ],
)
def test_pulse_belongs_to_a_source_by_direction_and_level(azimuth_deg: float, excess_db: float, is_own: bool) -> None:
    """In free sight, a pulse is a source's own if direction and level agree, and otherwise of nobody."""
    direct, multipath = origin(azimuth_deg, excess_db)
    assert direct > 0.9 if is_own else direct < 0.05
    assert multipath < 0.05 + 0.1 * (excess_db < 0.0)


def test_pulse_belongs_to_the_nearer_in_direction() -> None:
    """Of two sources, the one in the direction of the pulse has it."""
    groups = groups_from(np.zeros((2, 3)), np.radians([0.0, 90.0]), 6.0, LEVEL.mean_db)
    direct = associated(groups, [AHEAD_M, LEFT_M], FREE).direct
    assert (np.diag(direct) > 0.9).all()
    assert direct[0, 1] + direct[1, 0] < 0.01


def test_pulse_belongs_to_the_source_of_its_level() -> None:
    """The weaker of two sources in one direction has pulses of its level."""
    groups = groups_from(np.zeros((1, 3)), np.zeros(1), 6.0, LEVEL.mean_db - 12.0)
    weaker = LEVEL._replace(mean_db=LEVEL.mean_db - 12.0)
    direct = associated(groups, [AHEAD_M, AHEAD_M], FREE, levels=[LEVEL, weaker]).direct
    assert direct[1, 0] > 0.9


@pytest.mark.parametrize("azimuth_deg", [60.0, -120.0])
def test_pulse_of_a_hidden_source_is_multipath_if_weaker(azimuth_deg: float) -> None:
    """Behind metal, a pulse of any direction may be multipath of a source, but is not stronger than the direct wave."""
    assert origin(azimuth_deg, -6.0, METAL)[1] > 0.5
    assert max(origin(azimuth_deg, 8.0, METAL)) < 0.05
    weak = groups_from(np.zeros((1, 3)), np.radians([azimuth_deg]), 6.0, LEVEL.mean_db - 6.0)
    assert associated(weak, [AHEAD_M], METAL, is_located=False).multipath.max() == 0.0


@pytest.mark.parametrize("n_free", [0, 20, 40])
def test_waves_from_behind_an_obstacle_came_in_free_sight_only_if_they_are_as_strong(n_free: int) -> None:
    """Where the map hides the source, waves bent around the edge are weaker; another source near it is not hidden."""
    weaker_db = np.where(np.arange(60) < n_free, 0.0, 20.0) + np.random.default_rng(0).normal(0.0, LEVEL.spread_db, 60)
    groups = groups_from(np.zeros((60, 3)), np.zeros(60), 6.0, LEVEL.mean_db - weaker_db)
    is_near, n_pulses = np.arange(60) % 2 == 0, np.ones(60)

    def found(transmission: float) -> FloatArray:
        return in_sight_probability(compared_with(groups, AHEAD_M, transmission), LEVEL, n_pulses, is_near)

    assert (found(FREE)[is_near] > 0.95).all()
    assert found(METAL)[is_near].sum() == pytest.approx(0.5 * n_free, abs=2.0)
    assert not found(METAL)[~is_near].any()


@pytest.mark.parametrize("n_pulses", [1, 70, 1000])
def test_strongest_of_many_pulses_hardly_exceeds_the_limit(n_pulses: int) -> None:
    """One of n pulses exceeds the limit as rarely as a single one exceeds its own, interference apart."""
    levels_db = np.random.default_rng(0).normal(LEVEL.mean_db, LEVEL.spread_db, (4000, n_pulses))
    limit_db = LEVEL.limit_db(np.ones(1), n_pulses) - INTERFERENCE_DB
    assert np.mean(levels_db.max(axis=1) > limit_db) == pytest.approx(EXCEEDED, abs=0.01)


def test_shares_of_a_window_follow_its_pulses() -> None:
    """The share of a source is that of its pulses in the window; windows do not mix, and no source is excluded."""
    probability = np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    n_pulses, window = np.array([30.0, 10.0, 50.0, 50.0]), np.array([0, 0, 1, 1])
    share = window_shares(probability, n_pulses, window)
    np.testing.assert_allclose(share.sum(axis=0), 1.0)
    np.testing.assert_allclose(share[:, :2].T, [[0.75, 0.25, 0.0]] * 2, atol=0.01)
    np.testing.assert_allclose(share[:, 2:].T, [[0.5, 0.0, 0.5]] * 2, atol=0.01)
    assert share.min() > 0.0


def test_possible_origin_ignores_other_candidates_but_not_confirmed_sources() -> None:
    """Of two candidates at one place, each may have all pulses; next to a confirmed source, a candidate has its own."""
    n, likely = 3, (np.ones((2, 3)), np.zeros((2, 3)), np.full(3, 1e-9))
    half = associate(likely, np.tile([[0.45], [0.45], [0.1]], (1, n)))
    assert possible_origin(likely, half, np.array([False, False])) == pytest.approx(np.ones((2, n)), abs=1e-6)
    beside = possible_origin(likely, half, np.array([True, False]))
    assert beside[0] == pytest.approx(np.ones(n), abs=1e-6)
    assert beside[1] == pytest.approx(half.direct[1])
    taken = associate(likely, np.tile([[0.9], [1e-6], [0.1]], (1, n)))  # by the first candidate
    assert possible_origin(likely, taken, np.array([False, False]))[1] == pytest.approx(np.ones(n), abs=1e-4)
