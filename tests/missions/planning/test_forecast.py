"""Expected accuracy of located discharges."""

import numpy as np
from numpy.typing import NDArray

from dirmusic import ArrayModel, PulseBatch
from dirmusic.angles import wrap
from dirmusic.locating.finding import ellipse95
from dirmusic.locating.joint_fit import expected_covariances, locate_jointly
from pdpatrol.envs import load_scenario
from pdpatrol.missions.planning.forecast import Forecast, received, views_along
from pdpatrol.missions.planning.tour import Tour
from tests.missions.planning.one_plan import FloatArray, plan_of

SCENARIO = load_scenario("one_source")
ARRAY, POSE_ERROR = SCENARIO.known_array, SCENARIO.pose_sensor.pose_error
TARGET_M = np.array([14.0, 12.0, 1.8])


def half_round(n_views: int) -> FloatArray:
    """Return poses on half a circle of 4 m around the target, heading along it."""
    angle = np.linspace(-0.5, 0.5, n_views) * np.pi
    return np.column_stack([TARGET_M[:2] + 4.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1), angle + np.pi / 2])


def as_built(rng: np.random.Generator) -> ArrayModel:
    n, spread = ARRAY.manifold.n_elements, ARRAY.spread
    manifold = type(ARRAY.manifold)(
        ARRAY.manifold.pattern,
        ARRAY.manifold.boresights_rad + rng.normal(0.0, spread.pointing_rad, n),
        gain_factors=np.exp(rng.normal(0.0, spread.gain, n)),
    )
    return ArrayModel(manifold=manifold, positions_m=ARRAY.positions_m, spread=spread)


def test_received_equals_manifold_gain_for_far_targets() -> None:
    far_m = np.array([500.0, 300.0, ARRAY.height_m])
    pose = np.array([[1.0, 2.0, 0.4], [3.0, -2.0, -2.0]])
    azimuth_rad = wrap(np.arctan2(far_m[1] - pose[:, 1], far_m[0] - pose[:, 0]) - pose[:, 2])
    gain = received(ARRAY, pose, far_m) * np.linalg.norm(far_m[:2] - pose[:, :2], axis=-1, keepdims=True)
    np.testing.assert_allclose(gain, ARRAY.manifold.gain(azimuth_rad).T, rtol=2e-3)


def test_expected_covariance_matches_scatter_of_fits() -> None:
    rng, pose, n = np.random.default_rng(3), half_round(24), 24
    time_s, of_one = 0.7 * np.arange(n, dtype=np.float64), np.zeros(n, dtype=np.intp)
    strengths = received(ARRAY, pose, TARGET_M)
    noise = 0.005 * strengths.max()
    expected = expected_covariances(
        PulseBatch.detected(time_s, strengths, np.full(strengths.shape, noise**2)),
        pose, of_one, TARGET_M[np.newaxis], ARRAY, POSE_ERROR,
    )[0]  # fmt: skip
    correlation = np.exp(-np.abs(time_s[:, np.newaxis] - time_s) / POSE_ERROR.correlation_s)
    root = np.linalg.cholesky(correlation + 1e-9 * np.eye(n))
    std = np.array([POSE_ERROR.position_m, POSE_ERROR.position_m, POSE_ERROR.heading_rad])
    misses: list[FloatArray] = []
    for _ in range(120):
        strengths_v = received(as_built(rng), pose, TARGET_M) + rng.normal(0.0, noise, strengths.shape)
        estimated = pose + std * (root @ rng.standard_normal((n, 3)))
        pulses = PulseBatch.detected(time_s, strengths_v, np.full(strengths_v.shape, noise**2))
        start_m = TARGET_M[np.newaxis] + 0.2
        fit = locate_jointly(pulses, estimated, of_one, start_m, ARRAY, POSE_ERROR)
        misses.append(fit.positions_m[0] - TARGET_M)
    scatter = np.sqrt(np.square(misses).mean(axis=0))
    expected_std_m = np.sqrt(np.diag(expected))
    assert (0.5 * expected_std_m < scatter).all(), (scatter, expected_std_m)  # the model's floor is not drawn here
    assert (scatter < 1.3 * expected_std_m).all(), (scatter, expected_std_m)


def test_accuracy_improves_with_views_strength_and_aperture() -> None:
    plan = plan_of("one_source")
    weak, strong = (Forecast(SCENARIO, plan.site_map, volts) for volts in (0.05, 0.5))
    cells = np.array([plan.site_map.cell(place) for place in half_round(60)[:, :2]], dtype=np.intp)
    views = views_along(Tour(cells[:0], cells, 0.0), plan.detectability, 0.8)
    n = views.time_s.size
    some, half, all_views = np.arange(n) % 2 == 0, np.arange(n) < n // 2, np.ones(n, dtype=np.bool_)

    def semi_major(forecast: Forecast, is_used: NDArray[np.bool_]) -> float:
        return ellipse95(forecast.covariance(TARGET_M, views, is_used)[:2, :2]).semi_major_m

    reference_m = semi_major(weak, all_views)
    assert semi_major(strong, all_views) < reference_m
    assert semi_major(weak, some) > 0.95 * reference_m
    assert semi_major(weak, half) > 1.15 * reference_m
