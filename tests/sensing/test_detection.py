"""Detection: every path may trigger, stronger signals trigger more often, and a pulse is not taken for a burst."""

from dataclasses import replace

import numpy as np
import pytest

from pdpatrol.sensing import Surroundings
from pdpatrol.sensing.radio.surroundings import Rows
from tests.sensing.listening import listen, source_at
from tests.sensing.scenes import around, lossy, wall_across, wall_face


def wall_at(y_m: float) -> Rows:
    return wall_face((5.0, y_m, 2.0), (0.0, 1.0), (20.0, 3.0), lossy(0.0, 0.8))


def tank_and_wall() -> Surroundings:
    """Make a tank on the direct path with 25 dB of loss, and a wall whose reflection is 22 dB above the direct path."""
    return around(25.0, wall_across(5.0, 0.5), wall_at(-3.75))


def share_detected(amplitude_v: float, surroundings: Surroundings, seed: int, n: int = 1000) -> float:
    gun = replace(source_at(10.0, 0.0), amplitude_v=amplitude_v, pulse_rate_hz=2e3, n_shots=n)
    return listen(gun, seed=seed, duration_s=n / 2e3, surroundings=surroundings).pulses.n_pulses / n


def test_echo_triggers_where_direct_path_just_fails() -> None:
    shares = [share_detected(amplitude_v, tank_and_wall(), 1) for amplitude_v in (0.50, 0.515, 0.53)]
    assert min(shares) == 1.0


@pytest.mark.whole
def test_detection_rate_increases_with_level() -> None:
    """Within its binomial interval, from 6 dB below the trigger level to 40 dB above, in fifty random scenes."""
    levels_db = np.arange(-6.0, 41.0, 2.0)
    for seed in range(50):
        rng = np.random.default_rng(seed)
        echoing = Surroundings(wall_at(-rng.uniform(0.5, 12.0)))
        surroundings = [Surroundings(ground=lossy(0.0, 0.3)), echoing, tank_and_wall()][seed % 3]
        random_db = levels_db + rng.uniform(-1.0, 1.0)
        shares = [share_detected(0.02 * 10 ** (x / 20), surroundings, seed, 300) for x in random_db]
        highest = np.maximum.accumulate(shares)
        assert (highest - shares < 3.3 * np.sqrt(2 * np.maximum(highest * (1 - highest), 0.003) / 300)).all(), seed
