"""The probability of confirmation obeys its laws and agrees with simulated pulses."""

import numpy as np
import pytest
from scipy.special import erf

from dirmusic.angles import aperture
from dirmusic.locating.finding import ellipse95
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.missions.driving.site_map import SiteMap
from pdpatrol.missions.planning import confirmation_probability
from pdpatrol.missions.planning.confirmation_probability import ConfirmationModel, Passes, Traces
from tests.missions.planning.one_plan import walled_in

SCENARIO = load_scenario("one_source")
MODEL = ConfirmationModel(SCENARIO, SiteMap(SCENARIO).sight)
SITE_M = np.array([12.0, 12.0, 1.5])
FREE = ConfirmationModel(SCENARIO, lambda places_m, _: np.ones(len(places_m)))  # pyright: ignore[reportArgumentType]


def around(duration_s: float, radius_m: float = 5.0, arc_rad: float = np.pi, begin_s: float = 0.0) -> Passes:
    """Return a path around the site at constant speed."""
    n = round(2 * duration_s)
    angle = np.linspace(0.0, arc_rad, n)
    pose = np.column_stack([SITE_M[0] + radius_m * np.cos(angle), SITE_M[1] + radius_m * np.sin(angle), angle])
    return Passes(0.5 * np.arange(n) + np.float64(begin_s), np.full(n, 0.5), pose)


def confirmed(passes: Passes, level_dbv: float = -20.0, rate_hz: float = 1.0, model: ConfirmationModel = FREE) -> float:
    return model.chances(model.views(passes, SITE_M), level_dbv, rate_hz).confirmed


def test_probability_rises_with_level_rate_and_time() -> None:
    for values in (
        [confirmed(around(60.0), level_dbv=level) for level in np.arange(-50.0, 0.0, 2.0)],
        [confirmed(around(60.0), rate_hz=rate) for rate in np.geomspace(0.01, 10.0, 20)],
    ):
        assert (np.diff(values) >= -0.02).all()  # windows of silence may count against a draw
        assert values[0] == 0.0
        assert values[-1] > 0.99
    for rate_hz in (0.1, 0.2, 0.5):
        one, other = around(60.0), around(60.0, begin_s=100.0)
        twice = Passes(*(np.concatenate(pair) for pair in zip(one, other, strict=True)))
        assert confirmed(twice, rate_hz=rate_hz) >= confirmed(one, rate_hz=rate_hz) - 0.02


def test_narrow_or_distant_paths_do_not_confirm() -> None:
    assert confirmed(around(60.0, arc_rad=0.7)) == 0.0
    assert confirmed(around(60.0, arc_rad=1.2)) > 0.5
    assert confirmed(around(60.0, radius_m=19.0, arc_rad=1.0), level_dbv=20.0) == 0.0  # detected, but not located
    away = FREE.views(around(60.0, radius_m=19.0, arc_rad=1.0), SITE_M)
    assert FREE.chances(away, 20.0, 1.0).noticed == 1.0


def test_dead_channels_lower_the_probability() -> None:
    """Around the site with a constant heading relative to it, element 1 alone points at the site."""
    sight, passes = lambda places_m, _: np.ones(len(places_m)), around(60.0)
    passes = passes._replace(pose=passes.pose + np.array([0.0, 0.0, np.pi]))
    values = []
    for dead in ((), (0,), (0, 1, 5), (0, 1, 2, 4, 5)):  # the elements nearest to the direction of the site first
        is_sound = ~np.isin(np.arange(6), dead)
        values.append(confirmed(passes, -36.0, model=ConfirmationModel(SCENARIO, sight, is_sound)))  # pyright: ignore[reportArgumentType]
    assert values[0] > 0.9
    assert (np.diff(values) <= 0.02).all()
    assert values[-1] < 0.5


def test_hidden_site_has_no_chance() -> None:
    site_map = SiteMap(walled_in())
    model, site_m = ConfirmationModel(SCENARIO, site_map.sight), site_map.yard.site_position("hidden/door")
    cells_m = site_map.centres_m[np.isfinite(site_map.reach(SCENARIO.route.dock_m).length_m)]
    everywhere = Passes(
        np.arange(len(cells_m)) * np.float64(0.5), np.full(len(cells_m), 0.5), np.insert(cells_m, 2, 0.0, axis=1)
    )
    assert model.chances(model.views(everywhere, site_m), 20.0, 100.0) == (0.0, 0.0)


def test_unexplained_pulses_and_closed_views_deny_the_exclusion() -> None:
    views = FREE.views(around(100.0), SITE_M)
    n = views.window[-1] + 1
    is_open = np.ones(views.row.size, dtype=np.bool_)

    def noticed(n_windows: int, is_open: np.ndarray = is_open, n_pulses: int = 5, usable: float = 1.0) -> float:
        traces = Traces(usable, is_open, np.where(np.arange(n) < n_windows, n_pulses, 0))
        return FREE.chances(views, -20.0, 1.0, traces).noticed

    assert noticed(0) == noticed(5) == 1.0
    assert noticed(n) == noticed(n // 2) == 0.0
    assert noticed(n, n_pulses=1) == 1.0  # one pulse in a window is too few for such a discharge
    assert noticed(0, is_open=~is_open) == 0.0
    assert noticed(0, usable=0.02) < 0.1


def poisson_share(scenario: Scenario, passes: Passes, level_dbv: float, rate_hz: float, n: int) -> float:
    """Return the share of simulated discharges that are confirmed, pulse by pulse."""
    rng, rules = np.random.default_rng(5), scenario.locating.rules()
    views = FREE.views(passes, SITE_M)
    std_rad = np.hypot(scenario.known_array.bearing_std_rad, scenario.pose_sensor.pose_error.heading_rad)
    n_confirmed = 0
    for _ in range(n):
        emitted = np.repeat(np.arange(views.row.size), rng.poisson(rate_hz * views.duration_s))
        level_db = level_dbv + views.gain_db[emitted] + rng.normal(0.0, 4.0, emitted.size)
        pulse = np.unique(emitted[level_db > FREE.trigger_db])
        mean = rate_hz * views.duration_s * (0.5 + 0.5 * erf(
            (level_dbv + views.gain_db - FREE.trigger_db) / 4.0 / np.sqrt(2.0)
        ))  # fmt: skip
        odds, information = 0.0, np.zeros((2, 2))
        for window in range(views.window[-1] + 1):
            own = pulse[views.window[pulse] == window]
            expected = mean[views.window == window].sum()
            if own.size == 0:
                odds += np.log(0.1 + 0.9 * np.exp(-expected)) if expected > 0.5 else 0.0
                continue
            odds += confirmation_probability.EVIDENCE
            for k in own:
                across = np.array([-np.sin(views.aspect_rad[k]), np.cos(views.aspect_rad[k])])
                information += np.outer(across, across) / (own.size * (std_rad * views.range_m[k]) ** 2)
        if odds >= confirmation_probability.NEEDED and np.linalg.matrix_rank(information) == 2:
            is_small = (
                ellipse95(np.asarray(np.linalg.inv(information), dtype=np.float64)).semi_major_m
                <= rules.confirm_semi_major_m
            )
            n_confirmed += is_small and aperture(views.aspect_rad[pulse]) >= rules.confirm_aperture_rad
    return n_confirmed / n


@pytest.mark.parametrize(
    ("duration_s", "radius_m", "level_dbv", "rate_hz"),
    [(60.0, 5.0, -20.0, 0.2), (45.0, 6.0, -20.0, 0.3), (80.0, 6.0, -32.0, 0.5), (60.0, 5.0, -34.0, 1.0)],
)
def test_probability_is_that_of_simulated_pulses(
    duration_s: float, radius_m: float, level_dbv: float, rate_hz: float
) -> None:
    passes = around(duration_s, radius_m, arc_rad=1.5)
    simulated = poisson_share(SCENARIO, passes, level_dbv, rate_hz, 300)
    stated = confirmed(passes, level_dbv, rate_hz)
    assert stated == pytest.approx(simulated, abs=0.15)  # four standard deviations of both


def test_dwelling_adds_time_at_the_stops_alone() -> None:
    path_m, stops = np.array([[0.0, 0.0], [0.4, 0.0], [0.8, 0.0], [0.8, 0.8]]), np.array([2])
    passing, dwelling = (Passes.along(path_m, 0.8, stops, dwell_s) for dwell_s in (0.0, 12.0))
    assert passing.duration_s == pytest.approx([0.5, 0.5, 1.0])
    assert dwelling.duration_s.sum() == pytest.approx(2.0 + 12.0)
    assert dwelling.duration_s.max() <= confirmation_probability.WINDOW_S
    assert dwelling.time_s == pytest.approx(np.cumsum(dwelling.duration_s) - dwelling.duration_s)
    assert np.isin(dwelling.pose[:, 0], passing.pose[:, 0]).all()
    assert (dwelling.pose[dwelling.duration_s > 1.0, :2] == path_m[2]).all()
