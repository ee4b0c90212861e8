"""Locator: from simulated pulses to findings, by an array that differs from its data sheet."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dirmusic import ArrayModel, Finding, Locator, PulseBatch
from dirmusic.arrays import FloatArray
from dirmusic.bearing.maximum_likelihood import maximum_likelihood
from dirmusic.locating.protocol import LineOfSight
from dirmusic.locating.rules import LocatingRules
from tests.dirmusic.locating.forward_model import ARRAY, GRAVEL, POSE_ERROR, Nature, drawn_errors, modelled
from tests.dirmusic.scenes import around, rotation

SOURCE_M = np.array([20.0, 15.0, 2.0])
TWO_M = np.array([[17.5, 15.0, 2.0], [22.5, 15.0, 1.2]])
FENCE_M = (40.0, 30.0)
STEP_S = 0.25  # exact in binary at every origin
NOISE_V = 3e-3
Detections = list[tuple[float, FloatArray, PulseBatch]]


def path_round(centre_m: ArrayLike, radius_m: float, from_deg: float, to_deg: float, n: int) -> FloatArray:
    """Return true poses on an arc; the robot also turns on its own."""
    at_m = around(centre_m, radius_m, from_deg, to_deg, n)
    return np.column_stack([at_m, np.radians(from_deg) + 0.04 * np.arange(n)])


def detections(
    path: FloatArray,
    places_m: FloatArray,
    seed: int,
    *,
    nature: Nature | None = None,
    array: ArrayModel = ARRAY,
    volts: float = 0.8,
    rate: float = 0.6,
) -> Detections:
    """Simulate pulses of sources at places, shape (n_sources, 3) or (n_steps, n_sources, 3), every `STEP_S`."""
    rng, result = np.random.default_rng(seed), Detections()
    nature = nature or Nature(errors=drawn_errors(rng), permittivity=GRAVEL)
    error = np.array([POSE_ERROR.position_m, POSE_ERROR.position_m, POSE_ERROR.heading_rad])
    places_m = np.broadcast_to(places_m, (len(path), *np.shape(places_m)[-2:]))
    for k, (pose, at_m) in enumerate(zip(path, places_m, strict=True)):
        own_m = at_m[rng.random(len(at_m)) < rate]
        amplitude_v = volts * 10.0 ** (rng.normal(0.0, 2.0, (len(own_m), 1)) / 20.0)
        strengths_v = amplitude_v * modelled(np.tile(pose, (len(own_m), 1)), own_m, array, nature)
        noise_v = rng.normal(0.0, np.hypot(NOISE_V, 0.02 * strengths_v))
        strengths_v = np.abs(strengths_v + noise_v)
        pulses = PulseBatch.detected(np.zeros(len(own_m)), strengths_v, np.full(strengths_v.shape, NOISE_V**2))
        pulses = maximum_likelihood(pulses, array).attached_to(pulses)
        result.append((STEP_S * k, pose + error * rng.normal(size=3), pulses))
    return result


def listen(
    added: Detections,
    array: ArrayModel = ARRAY,
    **options: Any,  # noqa: ANN401
) -> tuple[Locator, list[tuple[Finding, ...]]]:
    """Return a Locator after detections and a last fit, and its findings at all times."""
    locator = Locator(array, POSE_ERROR, **{"fence_m": FENCE_M, **options})
    history = [locator.update(*each) for each in added]
    return locator, [*history, locator.refit(added[-1][0])]


def confirmed(locator: Locator) -> list[Finding]:
    return [finding for finding in locator.findings if finding.state == "confirmed"]


@cache
def past_two() -> Detections:
    """Drive in an eight around two sources 5 m apart."""
    arcs = path_round(TWO_M[0, :2], 3.0, 90.0, 400.0, 120), path_round(TWO_M[1, :2], 3.0, 180.0, -130.0, 120)
    return detections(np.concatenate(arcs), TWO_M, 3)


@cache
def located_two() -> tuple[Locator, list[tuple[Finding, ...]]]:
    return listen(past_two())


@pytest.mark.parametrize("seed", range(4))
def test_source_is_located_and_confirmed(seed: int) -> None:
    """A single source is the only finding, within 0.1 m."""
    path = path_round(SOURCE_M[:2], 3.5, 70.0 * seed, 70.0 * seed + 200.0, 120)
    locator, _ = listen(detections(path, SOURCE_M[np.newaxis], seed))
    (finding,) = locator.findings
    assert finding.state == "confirmed"
    assert finding.existence > 0.99
    assert np.linalg.norm(finding.position_m[:2] - SOURCE_M[:2]) < 0.1


def test_covariance_grows_when_poses_prove_to_be_worse() -> None:
    """Apply a pose error that is set later to all poses so far."""
    added = detections(path_round(SOURCE_M[:2], 3.5, 0.0, 200.0, 120), SOURCE_M[np.newaxis], 0)
    locator, _ = listen(added)
    (before,) = locator.findings
    locator.pose_error = replace(
        POSE_ERROR, position_m=3 * POSE_ERROR.position_m, heading_rad=3 * POSE_ERROR.heading_rad
    )
    (after,) = locator.refit(added[-1][0])
    assert after.semi_major_m > 1.5 * before.semi_major_m


def test_rarer_fits_end_with_the_same_position() -> None:
    """With fits that become rarer, findings change less often, and the last fit uses all pulses."""
    added = detections(path_round(SOURCE_M[:2], 3.5, 0.0, 200.0, 120), SOURCE_M[np.newaxis], 0)
    of_each, of_few = (listen(added, rules=LocatingRules(refit_share=share)) for share in (0.0, 0.3))
    n_changes = [sum(old != new for old, new in pairwise(history[:-1])) for _, history in (of_each, of_few)]
    assert n_changes[1] < 0.4 * n_changes[0]
    (few,), (each,) = confirmed(of_few[0]), confirmed(of_each[0])
    np.testing.assert_allclose(few.position_m[:2], each.position_m[:2], atol=0.02)


def test_source_is_located_once_swapped_channels_are_left_out() -> None:
    """Pulses from before the discovery support the finding instead of refuting it."""
    added = detections(path_round(SOURCE_M[:2], 3.5, 0.0, 200.0, 160), SOURCE_M[np.newaxis], 0)
    swapped, good = [1, 0, 2, 3, 4, 5], np.arange(6) >= 2
    for k, (at, pose, pulses) in enumerate(added):
        recorded = PulseBatch.detected(pulses.time_s, pulses.strengths_v[:, swapped], pulses.variance_v2)
        if k < 100:
            pulses = maximum_likelihood(recorded, ARRAY).attached_to(recorded)
        else:
            found = maximum_likelihood(recorded.take_channels(good), ARRAY.take(good))
            pulses = found.attached_to(recorded)._replace(is_usable=np.broadcast_to(good, recorded.strengths_v.shape))
        added[k] = at, pose, pulses
    locator, history = listen(added)
    assert not [finding for finding in history[99] if np.linalg.norm(finding.position_m[:2] - SOURCE_M[:2]) < 1.0]
    (finding,) = confirmed(locator)
    assert np.linalg.norm(finding.position_m[:2] - SOURCE_M[:2]) < 0.2
    assert finding.n_bearings > 0.8 * sum(pulses.n_pulses for _, _, pulses in added)


@pytest.mark.whole
def test_two_sources_have_a_finding_and_pulses_each() -> None:
    """Two sources 5 m apart are both confirmed, and pulses in line with one only belong to it."""
    locator, _ = located_two()
    assert len(confirmed(locator)) == len(locator.findings) == 2
    miss_m = [min(np.linalg.norm(f.position_m - place_m) for f in locator.findings) for place_m in TWO_M]
    assert max(miss_m) < 0.4
    association = locator.association()
    assert association.shape == (sum(pulses.n_pulses for _, _, pulses in past_two()),)
    assert set(association.tolist()) <= {0, *(f.id for f in locator.findings)}
    assert (association > 0).mean() > 0.8


@pytest.mark.whole
@pytest.mark.parametrize("radius_m", [6.0, 9.0])
def test_two_sources_are_told_apart_from_around_both(radius_m: float) -> None:
    """On a circle around both sources, each is confirmed, as from between them."""
    locator, _ = listen(detections(path_round((20.0, 15.0), radius_m, 0.0, 330.0, 240), TWO_M, 0))
    assert len(confirmed(locator)) == 2


def test_weaker_source_is_found_beside_one_that_may_explain_it_by_multipath() -> None:
    """Where the map hides a strong source, its multipath may have any direction, but not the pulses of a second one."""

    def sight(places_m: FloatArray, target_m: FloatArray, _: float) -> FloatArray:
        is_strong = np.linalg.norm(target_m[:2] - TWO_M[0, :2]) < 1.0
        return np.full(len(places_m), 0.4 if is_strong else 1.0)

    strong = detections(path_round(TWO_M[0, :2], 3.0, 0.0, 360.0, 160), TWO_M[:1], 0)
    path = path_round((20.0, 15.0), 6.0, 180.0, 480.0, 240)
    later = [
        detections(path, place_m, k, volts=volts)
        for k, (place_m, volts) in enumerate(zip(TWO_M[:, np.newaxis], (0.8, 0.2), strict=True))
    ]
    start_s = STEP_S * len(strong)
    both = [
        (start_s + time_s, pose, PulseBatch.join([pulses, weak]))
        for (time_s, pose, pulses), (_, _, weak) in zip(*later, strict=True)
    ]
    locator, _ = listen([*strong, *both], sight=sight)
    assert min(np.linalg.norm(f.position_m[:2] - TWO_M[1, :2]) for f in confirmed(locator)) < 0.5


@pytest.mark.whole
def test_ids_are_kept_and_never_reused() -> None:
    """Ids are in order, and tracks that were deleted leave theirs to nobody; existence is high if confirmed."""
    _, of_two = located_two()
    _, of_wave = listen(wandering(1))
    for history in (of_two, of_wave):
        gone, last = set[int](), set[int]()
        for findings in history:
            ids = [finding.id for finding in findings]
            assert ids == sorted(set(ids))
            assert not gone & set(ids)
            gone, last = gone | (last - set(ids)), set(ids)
            assert all(finding.existence > 0.5 for finding in findings if finding.state == "confirmed")
    assert gone
    for number in {finding.id for finding in of_two[-1]}:
        own = [finding.position_m for findings in of_two[-20:] for finding in findings if finding.id == number]
        assert np.linalg.norm(np.ptp(own, axis=0)) < 0.5


@pytest.mark.whole
def test_same_pulses_give_the_same_findings() -> None:
    assert listen(past_two())[1] == located_two()[1]


def wandering(seed: int) -> Detections:
    """Detect a vehicle that drives along the fence, outside, while the robot drives through the yard."""
    rng, n = np.random.default_rng([seed, 5]), 240
    along_m = rng.uniform(-10.0, 50.0) + np.cumsum(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 1.0) * np.ones(n))
    at_m = np.column_stack([np.mod(along_m, 60.0) - 10.0, np.full(n, -rng.uniform(3.0, 12.0)), np.full(n, 1.0)])
    return detections(path_round((20.0, 10.0), 6.0, 0.0, 300.0, n), at_m[:, np.newaxis], seed, volts=5.0)


@pytest.mark.parametrize("n_seeds", [1, pytest.param(6, marks=pytest.mark.whole)])
def test_moving_interferer_is_never_confirmed(n_seeds: int) -> None:
    """A wave that wanders has no finding in the state `confirmed` at any time."""
    for seed in range(n_seeds):
        _, history = listen(wandering(seed))
        assert not any(finding.state == "confirmed" for findings in history for finding in findings)


def test_without_pulses_nothing_is_found() -> None:
    silence = [(float(k), np.array([0.1 * k, 2.0, 0.0]), PulseBatch.none(6)) for k in range(60)]
    locator, history = listen(silence)
    assert not any(history)
    assert locator.association().shape == (0,)
    assert locator.array_estimate() is None


def test_source_beyond_the_fence_is_outside() -> None:
    path = np.column_stack([np.full(240, 37.0), np.linspace(3.0, 27.0, 240), 0.03 * np.arange(240)])
    locator, history = listen(detections(path, np.array([[48.0, 15.0, 2.0]]), 4, volts=2.0))
    assert "outside" in {finding.state for finding in locator.findings}
    assert not any(finding.state == "confirmed" for findings in history for finding in findings)


def wall(turn_rad: float = 0.0, shift_m: FloatArray | float = 0.0) -> LineOfSight:
    """Return the map of a wall along y = 17.5 m that transmits a third, in a world that is turned and moved."""

    def sight(places_m: FloatArray, target_m: FloatArray, within_m: float) -> FloatArray:
        both = [(np.atleast_2d(place)[:, :2] - shift_m) @ rotation(turn_rad) for place in (places_m, target_m)]
        return np.where((both[0][:, 1] - 17.5) * (both[1][:, 1] - 17.5) < 0.0, 0.3, 1.0)

    return sight


@cache
def by_map() -> tuple[Finding, ...]:
    return listen(past_two(), fence_m=None, sight=wall())[0].findings


@pytest.mark.whole
@pytest.mark.parametrize(("turn_deg", "tolerance_m"), [(180.0, 0.01), (90.0, 0.01), (37.0, 0.05)])
def test_findings_follow_a_rigid_motion_of_the_world(turn_deg: float, tolerance_m: float) -> None:
    """Findings move with the world, but for the borders of cells and sectors in which pulses are pooled."""
    turn_rad, shift_m = np.radians(turn_deg), np.array([-12.0, 40.5])
    turn, moved = rotation(turn_rad), Detections()
    for time_s, pose, pulses in past_two():
        moved.append((time_s, np.array([*(turn @ pose[:2] + shift_m), pose[2] + turn_rad]), pulses))
    after = listen(moved, fence_m=None, sight=wall(turn_rad, shift_m))[0].findings
    assert len(after) == len(by_map()) == 2
    for finding in by_map():
        expected_m = turn @ finding.position_m[:2] + shift_m
        other = min(after, key=lambda each: float(np.linalg.norm(each.position_m[:2] - expected_m)))
        np.testing.assert_allclose(other.position_m[:2], expected_m, atol=tolerance_m)
        assert other.state == finding.state
        assert other.existence == pytest.approx(finding.existence, abs=0.01)


@pytest.mark.whole
@pytest.mark.parametrize("origin_s", [-1000.0, 1.7e9])
def test_origin_of_time_changes_nothing(origin_s: float) -> None:
    """All times of findings shift with the origin, and nothing else changes."""
    after, before = (
        listen([(origin_s + at, pose, pulses) for at, pose, pulses in past_two()])[0].findings,
        located_two()[0].findings,
    )
    assert len(after) == len(before)
    for finding, expected in zip(after, before, strict=True):
        assert expected.confirmed_s is not None
        assert finding.confirmed_s == expected.confirmed_s + origin_s
        np.testing.assert_allclose(finding.position_m, expected.position_m, atol=1e-4)
        assert (finding.id, finding.state, finding.n_bearings) == (expected.id, expected.state, expected.n_bearings)
        assert finding.first_detected_s == pytest.approx(expected.first_detected_s + origin_s, abs=1e-5)


@pytest.mark.whole
def test_order_of_elements_does_not_matter() -> None:
    """Channels connected in another order, with the data sheet in that order, give the same findings."""
    order, permuted = np.array([3, 0, 5, 1, 4, 2]), Detections()
    for time_s, pose, pulses in past_two():
        strengths_v, variance_v2 = pulses.strengths_v[:, order], pulses.variance_v2[:, order]
        permuted.append((time_s, pose, pulses._replace(strengths_v=strengths_v, variance_v2=variance_v2)))
    after, before = listen(permuted, ARRAY.take(order))[0].findings, located_two()[0].findings
    assert [(f.id, f.state) for f in after] == [(f.id, f.state) for f in before]
    for finding, expected in zip(after, before, strict=True):
        np.testing.assert_allclose(finding.position_m, expected.position_m, atol=1e-3)


@pytest.mark.whole
@pytest.mark.parametrize(
    "change",
    [0.0, 0.2],
)
def test_known_errors_are_dropped_if_pulses_contradict_them(change: float) -> None:
    """Errors as learned in an earlier mission are used until the array has changed."""
    before = Nature(errors=drawn_errors(np.random.default_rng(8)), permittivity=GRAVEL)
    after = replace(before, errors=replace(before.errors, gain=before.errors.gain + change * (-1.0) ** np.arange(6)))
    path = path_round(SOURCE_M[:2], 3.5, 0.0, 300.0, 160)
    learned = listen(detections(path, SOURCE_M[np.newaxis], 8, nature=before))[0].array_estimate()
    assert learned is not None
    array = replace(ARRAY, errors=learned.errors)
    locator, _ = listen(detections(path, SOURCE_M[np.newaxis], 9, nature=after), array)
    assert locator.contradicts_errors == (change > 0.0) == (locator.array.errors is None)
    assert np.linalg.norm(confirmed(locator)[0].position_m[:2] - SOURCE_M[:2]) < 0.1


def test_level_is_that_of_precise_pulses() -> None:
    """Weak pulses from around the source, twice as many as its own, change neither its place nor its level."""
    rng, path = np.random.default_rng(0), path_round(SOURCE_M[:2], 3.5, 0.0, 200.0, 120)
    nature = Nature(errors=drawn_errors(rng), permittivity=GRAVEL)
    own = detections(path, SOURCE_M[np.newaxis], 0, rate=0.3, nature=nature)
    around_m = SOURCE_M + rng.normal(0.0, 0.5, (len(path), 1, 3)) * [1.0, 1.0, 0.0]
    weak = detections(path, around_m, 1, volts=0.1, rate=0.6, nature=nature)
    locator, _ = listen([each for pair in zip(own, weak, strict=True) for each in pair])
    alone, _ = listen(own)
    (finding,), (expected,) = confirmed(locator), confirmed(alone)
    assert np.linalg.norm(finding.position_m[:2] - SOURCE_M[:2]) < 0.2
    assert abs(finding.level_db - expected.level_db) < 3.0


@pytest.mark.whole
def test_weakened_pulses_from_beside_the_source_pull_less() -> None:
    """A third of the pulses comes 10 dB weaker from 0.8 m beside the source, as past the edge of unknown equipment."""
    n, place_m, off2_m2 = 60, np.array([20.0, 15.0, 1.8]), list[float]()
    path = path_round(place_m[:2], 4.0, 0.0, 354.0, n)
    middle = np.radians(60.0)
    edge_m = place_m + 0.8 * np.array([-np.sin(middle), np.cos(middle), 0.0])
    for seed in range(8):
        hidden = detections(path[: n // 3], edge_m[np.newaxis], seed, rate=1.0, volts=0.8 * 10 ** (-10 / 20))
        visible = detections(path[n // 3 :], place_m[np.newaxis], seed, rate=1.0)
        locator, _ = listen([(5.0 * k, pose, pulses) for k, (_, pose, pulses) in enumerate(hidden + visible)])
        (finding,) = confirmed(locator)
        off2_m2.append(float(np.square(finding.position_m - place_m)[:2].sum()))
    assert np.sqrt(np.mean(off2_m2)) < 0.22
