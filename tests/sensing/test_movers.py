"""Moving interferers: their positions, and the bearings of their pulses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pdpatrol.sensing import DischargeSource, ReceiverConfig
from pdpatrol.sensing.receiver.bank import ReceiverBank
from tests.sensing.listening import listen, listener

START_M, END_M, SPEED_MPS = np.array([-30.0, -20.0, 0.6]), np.array([30.0, -20.0, 0.6]), 12.0
LINE_S = 5.0
"""Time that a tram takes from one end to the other."""


def tram(*, moves: bool = True, at_m: np.ndarray = START_M) -> DischargeSource:
    motion = {"path_m": END_M[np.newaxis], "speed_mps": SPEED_MPS} if moves else {}
    return DischargeSource(name="tram", position_m=at_m, amplitude_v=2.0, pulse_rate_hz=400.0, **motion)


POST = DischargeSource(name="post", position_m=np.array([10.0, 20.0, 1.0]), amplitude_v=0.5, pulse_rate_hz=50.0)


def test_mover_follows_its_polyline_back_and_forth() -> None:
    """An L of 3 m and 4 m at 1 m/s: 14 s for there and back."""
    path = {"path_m": np.array([[3.0, 0.0, 1.0], [3.0, 4.0, 1.0]]), "speed_mps": 1.0}
    car = DischargeSource(name="c", position_m=np.array([0.0, 0.0, 1.0]), amplitude_v=1.0, pulse_rate_hz=1.0, **path)
    places = [
        (0.0, 0, 0),
        (2.0, 2, 0),
        (3.0, 3, 0),
        (5.0, 3, 2),
        (7.0, 3, 4),
        (9.0, 3, 2),
        (12.0, 2, 0),
        (14.5, 0.5, 0),
    ]
    for time_s, x_m, y_m in places:
        np.testing.assert_allclose(car.position_at(time_s), [x_m, y_m, 1.0], atol=1e-9)


@given(st.floats(0.0, 1e5), st.floats(0.0, 1.0))
def test_mover_stays_on_its_line_at_its_speed(time_s: float, later_s: float) -> None:
    """Its motion is periodic, and symmetric in time."""
    source = tram()
    at_m, then_m = source.position_at(time_s), source.position_at(time_s + later_s)
    assert START_M[0] - 1e-9 <= at_m[0] <= END_M[0] + 1e-9
    np.testing.assert_allclose(at_m[1:], START_M[1:])
    assert np.linalg.norm(then_m - at_m) <= SPEED_MPS * later_s + 1e-6
    np.testing.assert_allclose(source.position_at(time_s + 2 * LINE_S), at_m, atol=1e-6)
    np.testing.assert_allclose(source.position_at(2 * LINE_S * 1e4 - min(time_s, 1e5)), at_m, atol=1e-6)


@pytest.mark.parametrize("start_s", [0.0, 1.25, 8.0])
def test_mover_is_received_like_fixed_source_at_its_place(start_s: float) -> None:
    standing = tram(moves=False, at_m=tram().position_at(start_s))
    detected, expected = (listen(POST, each, start_s=start_s, duration_s=0.1) for each in (tram(), standing))
    assert detected.pulses.n_pulses > 20
    np.testing.assert_array_equal(detected.pulses.strengths_v, expected.pulses.strengths_v)
    np.testing.assert_array_equal(detected.pulses.time_s, expected.pulses.time_s)


def test_bank_moves_sources_by_time_of_each_robot() -> None:
    """The pulses of each robot equal, bit for bit, those of a bank with only that robot."""
    starts_s, poses = np.array([0.4, 3.1, 6.0]), np.tile(np.eye(4), (3, 1, 1))
    together = ReceiverBank(ReceiverConfig(), [listener(POST, tram(), seed=seed) for seed in range(3)])
    detected = together.listen(poses, starts_s, 0.1)
    detected_again = together.listen(poses, starts_s + 0.1, 0.1, np.array([0, 2]))
    for robot in range(3):
        alone = ReceiverBank(ReceiverConfig(), [listener(POST, tram(), seed=robot)])
        for part, later_s in ((detected, 0.0), (detected_again, 0.1)):
            own = part.robot == robot
            if later_s and robot == 1:
                assert not own.any()
                continue
            expected = alone.listen(poses[:1], starts_s[robot : robot + 1] + later_s, 0.1)
            assert own.sum() > 20
            np.testing.assert_array_equal(part.pulses.strengths_v[own], expected.pulses.strengths_v)
