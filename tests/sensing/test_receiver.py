"""What the receiver hears: spreading, delay, obstruction, trigger, gate."""

import numpy as np
import pytest

from dirmusic import bearing_bound, estimate_bearings
from dirmusic.angles import difference
from sensing import ArrayConfig, DischargeSource, Heard, HelicalArray, Receiver, ReceiverConfig
from sensing.propagation import SPEED_OF_LIGHT_MPS, direct_paths
from sensing.pulses import damped_pulse, unit_pulse_energy

NOMINAL = HelicalArray.nominal(ArrayConfig())
ORIGIN = np.zeros(3)


def everything_in_sight(points: np.ndarray, _: np.ndarray) -> np.ndarray:
    return np.ones(len(points), dtype=np.bool_)


def source_at(
    x: float, y: float, z: float = 0.6, amplitude_v: float = 0.27, rate_hz: float = 1000.0
) -> DischargeSource:
    return DischargeSource(name="s", position_m=np.array([x, y, z]), amplitude_v=amplitude_v, pulse_rate_hz=rate_hz)


def listen(source: DischargeSource | None, seed: int = 0, duration_s: float = 1.0, **config: float) -> Heard:
    receiver = Receiver(ReceiverConfig(**config), NOMINAL)  # pyright: ignore[reportArgumentType]
    sources = [] if source is None else [source]
    rng = np.random.default_rng(seed)
    return receiver.listen(ORIGIN, sources, everything_in_sight, rng, start_s=0.0, duration_s=duration_s)


def test_a_pulse_is_zero_before_it_arrives_has_unit_peak_and_lasts_about_two_and_a_half_nanoseconds() -> None:
    time_s = np.arange(-2e-9, 20e-9, 1e-12)
    pulse = damped_pulse(time_s)
    assert not pulse[time_s < 0].any()
    assert np.abs(pulse).max() == pytest.approx(1.0, abs=1e-4)
    energy = np.cumsum(np.square(pulse))
    assert time_s[np.searchsorted(energy, 0.98 * energy[-1])] == pytest.approx(2.5e-9, abs=0.5e-9)


def test_paths_spread_with_range_and_arrive_at_the_speed_of_light() -> None:
    elements = np.array([[0.0, 0.0, 0.6], [0.1, 0.0, 0.6]])
    source = np.array([3.0, 4.0, 12.6])
    paths = direct_paths(elements, source)
    assert paths.spreading[0] == pytest.approx(1 / 13, rel=1e-12)
    assert paths.delay_s[0] == pytest.approx(13 / SPEED_OF_LIGHT_MPS, rel=1e-12)
    assert paths.azimuth_rad[0] == pytest.approx(np.arctan2(4, 3))


def test_strength_falls_with_one_over_range_and_follows_the_pattern() -> None:
    near, far = (listen(source_at(r, 0.0), noise_v=1e-6, bits=24).strengths_v.mean(axis=0) for r in (20.0, 40.0))
    np.testing.assert_allclose(near / far, 2.0, rtol=0.02)  # elements are 0.12 m from the centre
    gain = NOMINAL.gain(np.zeros(6), np.zeros(6))
    np.testing.assert_allclose(far / far[1], gain / gain[1], rtol=0.02)


@pytest.mark.parametrize(("range_m", "degrees"), [(5.0, 0.45), (15.0, 1.3)])
def test_the_default_amplitude_puts_the_bound_of_one_pulse_where_the_default_scenario_wants_it(
    range_m: float, degrees: float
) -> None:
    config = ReceiverConfig()
    rho = unit_pulse_energy(config.sample_rate_hz) * (0.27 / range_m / config.noise_v) ** 2
    azimuth = np.radians(np.arange(360.0))
    bound = np.sqrt(np.mean(np.square(bearing_bound(NOMINAL.manifold(), azimuth, rho))))
    assert np.degrees(bound) == pytest.approx(degrees, rel=0.05)


def test_bearings_of_heard_pulses_lie_within_a_tenth_of_the_bound_all_round() -> None:
    rho = unit_pulse_energy(20e9) * (0.27 / 15.0 / 1e-3) ** 2
    over_bound = []
    for azimuth in np.radians(np.arange(0.0, 360.0, 25.0)):
        source = source_at(15.0 * np.cos(azimuth), 15.0 * np.sin(azimuth))
        heard = listen(source, duration_s=2.0, false_alarm_rate_hz=1e-9)
        error = difference(estimate_bearings(heard.strengths_v[:, np.newaxis], NOMINAL.manifold()).azimuth_rad, azimuth)
        spread = np.std(error)  # about its mean: the ring's parallax is a bias
        over_bound.append(spread / bearing_bound(NOMINAL.manifold(), azimuth, rho))
    assert np.sqrt(np.mean(np.square(over_bound))) == pytest.approx(1.0, abs=0.12)


def test_nothing_is_heard_through_an_obstacle() -> None:
    receiver = Receiver(ReceiverConfig(false_alarm_rate_hz=1e-9), NOMINAL)

    def nothing_in_sight(points: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.zeros(len(points), dtype=np.bool_)

    rng = np.random.default_rng(0)
    heard = receiver.listen(ORIGIN, [source_at(5.0, 0.0)], nothing_in_sight, rng, start_s=0.0, duration_s=1.0)
    assert heard.strengths_v.shape == (0, 6)


def test_an_element_in_the_shadow_alone_stays_silent() -> None:
    receiver = Receiver(ReceiverConfig(false_alarm_rate_hz=1e-9), NOMINAL)

    def first_hidden(points: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.arange(len(points)) > 0

    rng = np.random.default_rng(0)
    heard = receiver.listen(ORIGIN, [source_at(0.0, 5.0)], first_hidden, rng, start_s=0.0, duration_s=1.0)
    assert np.median(heard.strengths_v[:, 0]) < 0.1 * np.median(heard.strengths_v[:, 1])


def test_noise_alone_triggers_as_often_as_was_asked_and_looks_like_noise() -> None:
    heard = listen(None, duration_s=2000.0, false_alarm_rate_hz=0.1)
    assert heard.time_s.size == pytest.approx(200, abs=45)  # three sigma
    loudest = heard.strengths_v.max(axis=-1)
    assert 6.0e-3 < np.median(loudest) < 9.0e-3  # about the threshold of 7.2 sigma
    assert (np.diff(heard.time_s) >= 0).all()


def test_the_threshold_keeps_the_false_alarm_rate_of_white_noise() -> None:
    from scipy.stats import norm

    receiver = Receiver(ReceiverConfig(), NOMINAL)
    rate = 2 * norm.sf(receiver.threshold_v / 1e-3) * 6 * 20e9
    assert rate == pytest.approx(0.1, rel=1e-3)


def test_pulses_too_weak_for_the_trigger_are_not_heard() -> None:
    assert listen(source_at(200.0, 0.0), false_alarm_rate_hz=1e-9).time_s.size == 0


def test_the_gate_holds_the_whole_pulse_in_every_channel() -> None:
    heard = listen(source_at(-20.0, 0.0), noise_v=1e-6, bits=24)
    whole = 0.27 / 20 * np.sqrt(unit_pulse_energy(20e9)) * NOMINAL.gain(np.full(6, np.pi), np.zeros(6))
    np.testing.assert_allclose(heard.strengths_v.mean(axis=0), whole, rtol=0.03)


def test_the_reported_variance_is_that_of_the_strengths() -> None:
    heard = listen(source_at(10.0, 0.0), duration_s=5.0, false_alarm_rate_hz=1e-9)
    np.testing.assert_allclose(heard.strengths_v.var(axis=0), heard.variance_v2.mean(axis=0), rtol=0.15)


def test_pulses_come_at_the_given_mean_rate_and_carry_the_mains_phase_of_their_time() -> None:
    heard = listen(source_at(5.0, 0.0, rate_hz=20.0), duration_s=200.0, false_alarm_rate_hz=1e-9)
    assert heard.time_s.size == pytest.approx(4000, rel=0.06)
    np.testing.assert_allclose(heard.mains_phase_rad, np.mod(2 * np.pi * 50 * heard.time_s, 2 * np.pi))


def test_the_same_generator_gives_the_same_pulses() -> None:
    first, second = (listen(source_at(5.0, 2.0), seed=7).strengths_v for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_real_arrays_spread_about_the_data_sheet_as_configured() -> None:
    config = ArrayConfig(gain_error=0.05, pointing_error_deg=2.0, position_error_m=0.002)
    rng = np.random.default_rng(0)
    drawn = [HelicalArray.draw(config, rng) for _ in range(500)]
    pointing = np.array([a.boresights_rad for a in drawn]) - NOMINAL.boresights_rad
    assert np.degrees(pointing.std()) == pytest.approx(2.0, rel=0.05)
    assert np.log([a.gain_factors for a in drawn]).std() == pytest.approx(0.05, rel=0.05)
    assert (np.array([a.positions_m for a in drawn]) - NOMINAL.positions_m).std() == pytest.approx(0.002, rel=0.05)


def test_an_array_without_errors_is_the_data_sheet() -> None:
    config = ArrayConfig(gain_error=0.0, pointing_error_deg=0.0, position_error_m=0.0)
    drawn = HelicalArray.draw(config, np.random.default_rng(0))
    np.testing.assert_allclose(drawn.boresights_rad, NOMINAL.boresights_rad)
    np.testing.assert_allclose(drawn.gain_factors, 1.0)


def test_elements_turn_and_move_with_the_robot() -> None:
    moved = NOMINAL.elements_in_world(np.array([2.0, 3.0, np.pi / 2]))
    np.testing.assert_allclose(moved[0], [2.0 - 0.12, 3.0, 0.6], atol=1e-12)  # element 1 looks left: now west


def test_the_element_nearest_to_the_source_hears_the_pulse_first_by_its_own_delay() -> None:
    receiver = Receiver(ReceiverConfig(noise_v=1e-7, bits=24), NOMINAL)
    elements, source = NOMINAL.elements_in_world(ORIGIN), source_at(8.0, 0.0)
    seen = np.ones(6, dtype=np.bool_)
    peaks = np.full(50, source.amplitude_v)
    heard, gates = receiver._record(ORIGIN, elements, source.position_m, peaks, seen, np.random.default_rng(0))  # pyright: ignore[reportPrivateUsage]
    assert heard.all()
    arrival = (np.abs(gates) > 1e-4).argmax(axis=-1).mean(axis=0)
    delay_s = direct_paths(elements, source.position_m).delay_s
    np.testing.assert_allclose(arrival - arrival[1], (delay_s - delay_s[1]) * 20e9, atol=2.0)


def test_a_shot_on_the_edge_of_two_intervals_is_fired_once() -> None:
    gun = DischargeSource(
        name="gun", position_m=np.ones(3), amplitude_v=1.0, pulse_rate_hz=10.0, n_shots=90, first_shot_s=0.3
    )
    rng = np.random.default_rng(0)
    fired = np.concatenate([gun.emissions(k * 0.1, 0.1, rng)[0] for k in range(200)])
    np.testing.assert_allclose(fired, 0.3 + np.arange(90) / 10, atol=1e-9)


def test_the_array_hears_less_of_a_source_above_it_than_of_a_level_one_ahead() -> None:
    ahead = NOMINAL.gain(np.full(6, np.pi / 6), np.zeros(6))
    above = NOMINAL.gain(np.full(6, np.pi / 6), np.full(6, np.pi / 2))
    assert ahead[1] > 1.5 * above[1]
    np.testing.assert_allclose(above, above[0])  # straight up all elements are alike


@pytest.mark.parametrize("bits", [6, 8, 12])
def test_the_converter_rounds_to_its_steps_and_its_rounding_is_part_of_the_noise(bits: int) -> None:
    receiver = Receiver(ReceiverConfig(bits=bits, full_scale_v=0.1, noise_v=2e-3), NOMINAL)
    heard = receiver.listen(
        ORIGIN, [source_at(10.0, 0.0)], everything_in_sight, np.random.default_rng(0), start_s=0.0, duration_s=0.5
    )
    counts = heard.waveforms_v / receiver.step_v
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert np.abs(counts).max() <= 2 ** (bits - 1) - 1
    quiet = heard.waveforms_v[:, :, :10]  # before the trigger
    assert quiet.var() == pytest.approx(receiver.noise_variance_v2, rel=0.05)
    assert not heard.is_clipped.any()


def test_a_pulse_beyond_full_scale_is_flagged_and_one_within_is_not() -> None:
    loud, quiet = (
        listen(source_at(3.0, 0.0, amplitude_v=v), noise_v=1e-3, full_scale_v=0.1, bits=12) for v in (3.0, 0.2)
    )
    assert loud.is_clipped.all()
    assert np.abs(loud.waveforms_v).max() == pytest.approx(0.1)
    assert not quiet.is_clipped.any()
