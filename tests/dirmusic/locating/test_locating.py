"""Locator: from pulses to findings, with an array that differs from its data sheet."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dirmusic import Finding, Locator, PulseBatch, strength_variance
from dirmusic.locating.finding import State, is_inside95
from dirmusic.locating.locator import merge_findings
from dirmusic.locating.plane_wave import is_credible
from dirmusic.locating.protocol import LineOfSight
from dirmusic.locating.rules import CredibilityRules, LocatingRules
from tests.dirmusic.scenes import (
    ARRAY,
    NO_POSE_ERROR,
    RING,
    around,
    drawn_errors,
    make_finding,
    received,
    rotation,
    with_bearings,
)

NOISE_V = 1e-3


SOURCE_M = np.array([20.0, 15.0])


def make_locator(**options: Any) -> Locator:  # noqa: ANN401
    return Locator(ARRAY, NO_POSE_ERROR, **{"fence_m": (40.0, 30.0), **options})


def update(locator: Locator, time_s: float, pose: np.ndarray, strengths: np.ndarray) -> tuple[Finding, ...]:
    """Pass the credible pulses among strengths (n, 6) to a Locator, with their most likely directions."""
    variance = strength_variance(strengths, NOISE_V**2, 60)
    pulses = with_bearings(PulseBatch.detected(np.zeros(len(strengths)), strengths, variance))
    credible = is_credible(pulses, ARRAY, np.zeros(pulses.n_pulses), CredibilityRules())
    return locator.update(time_s, pose, pulses.take(credible))


def listen_along(
    path: np.ndarray,
    sources: ArrayLike,
    seed: int,
    **options: Any,  # noqa: ANN401
) -> tuple[Locator, list[tuple[Finding, ...]]]:
    """Add two pulses of each source at each step, received by an array with errors."""
    rng, locator = np.random.default_rng(seed), make_locator(**options)
    real = drawn_errors(rng).correct(RING)
    heading = np.gradient(path, axis=0)
    poses = np.column_stack([path, np.arctan2(heading[:, 1], heading[:, 0])])
    return locator, [update(locator, 0.1 * k, pose, received(pose, sources, real, rng)) for k, pose in enumerate(poses)]


def test_ellipse_covers_the_source_despite_array_errors() -> None:
    errors, inside = [], 0
    for seed in range(20):
        locator, _ = listen_along(around(SOURCE_M, 3.0, 10 * seed, 10 * seed + 110), SOURCE_M, seed)
        (finding,) = locator.findings
        miss = finding.position_m[:2] - SOURCE_M
        errors.append(np.linalg.norm(miss))
        inside += is_inside95(miss, finding.covariance_m2[:2, :2])
        assert finding.state == "confirmed"
    assert np.median(errors) < 0.08
    assert inside >= 17  # of 20, for 95 %; fewer has a probability of 2 %


def test_scattered_pulses_initiate_only_by_crossing() -> None:
    path = around(SOURCE_M, 5.0, 0, 300, 20)[::2]
    assert listen_along(path, SOURCE_M, seed=8)[0].findings == ()
    rules = LocatingRules(initiation_by_crossing=True, initiation_s=np.inf)
    (finding,) = listen_along(path, SOURCE_M, seed=8, rules=rules)[0].refit(10.0)
    np.testing.assert_allclose(finding.position_m[:2], SOURCE_M, atol=0.3)


def test_single_line_of_bearings_never_confirms() -> None:
    straight = np.column_stack([np.linspace(5.0, 27.5, 300), np.full(300, 15.0)])
    locator, history = listen_along(straight, (30.0, 15.0), seed=1)
    assert all(finding.state == "candidate" for findings in history for finding in findings)
    assert locator.findings[0].aperture_rad < LocatingRules().confirm_aperture_rad


def test_two_simultaneous_sources_are_two_findings() -> None:
    """Each finding has the pulses of its source, except pulses in line with both sources."""
    sources = np.add(SOURCE_M, [(-6.0, 0.0), (6.0, 0.0)])
    locator, _ = listen_along(around(SOURCE_M, 8.5, 0, 350, 150), sources, seed=3)
    assert len(locator.findings) == 2
    association = locator.association().reshape(-1, 2, 2)  # (steps, sources, pulses)
    for own, source in enumerate(sources):
        (finding,) = (f for f in locator.findings if np.linalg.norm(f.position_m[:2] - source) < 0.35)
        assert (association[:, own] == finding.id).mean() > 0.6
        assert (association[:, 1 - own] == finding.id).mean() < 0.05


def test_source_beyond_the_fence_is_outside() -> None:
    path = np.column_stack([np.full(300, 35.0), np.linspace(3.0, 27.0, 300)])
    locator, history = listen_along(path, (60.0, 15.0), seed=4)
    assert [finding.state for finding in locator.findings] == ["outside"]
    assert not any(finding.state == "confirmed" for findings in history for finding in findings)


def test_noise_initiates_no_candidate() -> None:
    rng = np.random.default_rng(5)
    locator = make_locator()
    for k in range(600):  # ten a second: a hundred times the assumed false-alarm rate
        strengths = np.sqrt(np.maximum(rng.normal(0, np.sqrt(120), (1, 6)), 0)) * NOISE_V
        strengths[0, rng.integers(6)] = 7.3 * NOISE_V
        update(locator, 0.1 * k, np.zeros(3), strengths)
    assert locator.findings == ()


def test_bearings_solver_is_less_accurate_and_states_it() -> None:
    def medians_m(solver: str) -> np.ndarray:
        """Return the median error and semi-major axis of five findings."""
        rules = LocatingRules(solver=solver)  # pyright: ignore[reportArgumentType]
        figures = []
        for seed in range(5):
            path = around(SOURCE_M, 3.0, 10 * seed, 10 * seed + 110, 60)
            for found in listen_along(path, SOURCE_M, seed, rules=rules)[0].findings:
                figures.append((np.linalg.norm(found.position_m[:2] - SOURCE_M), found.semi_major_m))
        return np.median(figures, axis=0)

    assert (medians_m("bearings") > [1.0, 1.3] * medians_m("joint")).all()


WALL_Y_M = 15.0


def across_the_wall(points: np.ndarray, target: np.ndarray, ignore_m: float) -> np.ndarray:
    """Return the transmission of a map with one wall along y = 15 m, as long as the yard."""
    beyond = (points[:, 1] - WALL_Y_M) * (target[1] - WALL_Y_M) < 0
    return ~beyond | (np.abs(target[1] - WALL_Y_M) < ignore_m)


def detect_image_and_source(map_sight: LineOfSight | None) -> list[Finding]:
    """Return the confirmed findings after a drive that detects the mirror image of a source and then the source.

    The mirror image lies behind a wall and is 4 dB weaker; the source is in sight beyond the end of the wall.
    """
    rng = np.random.default_rng(0)
    real, locator = drawn_errors(rng).correct(RING), make_locator(sight=map_sight)
    image, source = np.array([20.0, 16.5]), np.array([12.0, 8.0])
    path = np.concatenate([around(image, 3.6, 210, 330, 200), around(source, 3.0, 20, 150, 200)])
    for k, place in enumerate(path):
        pose, (origin, level) = np.array([*place, 0.01 * k]), (image, 0.5) if k < 200 else (source, 0.8)
        update(locator, 0.1 * k, pose, received(pose, origin, real, rng, volt_metres=level))
    return [finding for finding in locator.findings if finding.state == "confirmed"]


def test_mirror_image_behind_equipment_is_not_confirmed() -> None:
    assert len(detect_image_and_source(None)) == 2  # without a map both are equally likely
    (by_map,) = detect_image_and_source(across_the_wall)
    np.testing.assert_allclose(by_map.position_m[:2], [12.0, 8.0], atol=0.3)
    assert by_map.level_db == pytest.approx(20 * np.log10(0.8) + 20 * np.log10(np.sqrt(2.87)), abs=1.5)


STEP_S = 0.125  # exact in binary at every origin below


def survey(origin_s: float, turn_rad: float = 0.0, shift_m: ArrayLike = (0.0, 0.0)) -> tuple[Finding, ...]:
    """Drive around a source near a wall, from a start time and in a yard that is rotated and moved."""
    turn = rotation(turn_rad)

    def wall(points: np.ndarray, target: np.ndarray, ignore_m: float) -> np.ndarray:
        local = [(np.atleast_2d(place)[:, :2] - shift_m) @ turn for place in (points, target)]
        return np.where((local[0][:, 1] - 5.0) * (local[1][0, 1] - 5.0) < 0, 0.3, 1.0)

    rng, locator = np.random.default_rng(12), make_locator(fence_m=None, sight=wall)
    real = drawn_errors(rng).correct(RING)
    path = np.concatenate([around((0.0, 2.0), 3.0, 180, 360, 200), around((0.0, 8.0), 3.0, -60, 60, 100)])
    for k, place in enumerate(path):
        sources = ((0.0, 2.0), (0.0, 8.0), (4.0, 6.0))[: 1 + 2 * (k >= 100)]
        strengths = received(np.array([*place, 0.03 * k]), sources, real, rng)
        update(locator, origin_s + STEP_S * k, np.array([*(turn @ place + shift_m), 0.03 * k + turn_rad]), strengths)
    return locator.refit(origin_s + STEP_S * len(path))


def test_findings_do_not_depend_on_the_time_origin() -> None:
    at_zero = survey(0.0)
    assert "confirmed" in {finding.state for finding in at_zero}
    for origin_s in (-1000.0, 7.0, 1.7e9):
        shifted = survey(origin_s)
        assert [(f.id, f.state, f.n_bearings) for f in shifted] == [(f.id, f.state, f.n_bearings) for f in at_zero]
        for finding, expected in zip(shifted, at_zero, strict=True):
            np.testing.assert_allclose(finding.position_m, expected.position_m, atol=1e-5)
            np.testing.assert_allclose(finding.covariance_m2, expected.covariance_m2, rtol=1e-3, atol=1e-9)
            assert finding.first_detected_s == expected.first_detected_s + origin_s
            assert finding.last_detected_s == expected.last_detected_s + origin_s
            assert expected.confirmed_s is None or finding.confirmed_s == expected.confirmed_s + origin_s


@pytest.mark.parametrize(
    ("turn_deg", "shift_m", "tolerance_m"),
    [(90.0, (-12.25, 40.0), 1e-4), (180.0, (7.0, 5.5), 1e-4), (37.0, (-12.3, 40.1), 0.03)],
)
def test_findings_follow_a_rigid_motion_of_the_yard(
    turn_deg: float, shift_m: tuple[float, float], tolerance_m: float
) -> None:
    """Findings move with the yard: exactly where cells and sectors of the world frame map onto themselves."""
    turn_rad = np.radians(turn_deg)
    turn = rotation(turn_rad)
    before, after = survey(0.0), survey(0.0, turn_rad, shift_m)
    assert len(before) == len(after) == 3
    for finding in before:
        expected_m = turn @ finding.position_m[:2] + shift_m
        moved = min(after, key=lambda other: float(np.linalg.norm(other.position_m[:2] - expected_m)))
        np.testing.assert_allclose(moved.position_m[:2], expected_m, atol=tolerance_m)
        assert moved.state == finding.state
        if tolerance_m < 1e-3:
            turned_m2 = turn @ finding.covariance_m2[:2, :2] @ turn.T
            np.testing.assert_allclose(moved.covariance_m2[:2, :2], turned_m2, rtol=0.01, atol=1e-8)
            assert moved.position_m[2] == pytest.approx(finding.position_m[2], abs=1e-3)


@pytest.mark.parametrize(
    ("states", "kept"),
    [
        (("ghost", "confirmed", "candidate"), [2]),
        (("candidate", "ghost", "confirmed"), [3]),
        (("confirmed", "confirmed", "ghost"), [1]),
        (("ghost", "candidate", "outside"), [1]),
    ],
)
def test_merging_keeps_the_confirmed_finding_or_the_lowest_id(states: tuple[State, ...], kept: list[int]) -> None:
    findings = [
        make_finding(id=number, state=state, position_m=np.array([0.4 * number, 0.0, 1.5]))
        for number, state in enumerate(states, start=1)
    ]
    assert [finding.id for finding in merge_findings(findings, 1.0)] == kept
    apart = [replace(finding, position_m=2.0 * finding.id * np.ones(3)) for finding in findings]
    assert merge_findings(apart, 1.0) == apart
