"""Compilation from the other end, once on a machine: a second process compiles what a first mission comes to last.

In one process the compiler works on one function at a time, and what it has made is kept on disk, where other processes
find it. So the two need no word between them: what both begin at the same time is compiled twice, and nothing else.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dirmusic import ElementSpread, PoseError, estimate_bearings
from dirmusic.compiled import compile_as_called
from missions.deep_calls import call_with_room
from missions.field.array_model import array_model
from missions.field.field_data import FieldData
from missions.field.locate_field_data import locate_field_data
from sensing.array.array_table import ArrayTable
from sensing.array.config import ArrayConfig
from sensing.array.helical_array import HelicalArray
from sensing.radio.arrivals import Arrivals, arrive
from sensing.radio.diffraction.bends import BENT_RAY, SEEN_EDGE, BentRays
from sensing.radio.materials import Substance
from sensing.radio.obstruction import SHADOW
from sensing.radio.polarisation import Emitter
from sensing.radio.ray_paths import RayPaths, bend_round_all
from sensing.radio.sight import shares_left
from sensing.radio.tables import OBSTACLE
from sensing.radio.vectors import Vector
from sensing.receiver.config import ReceiverConfig
from sensing.receiver.detection import Gates
from sensing.receiver.gates import read_gate
from sensing.receiver.receiver import Receiver
from sensing.receiver.sampling.gate import sample_noise, sample_pulse
from sensing.receiver.sampling.sampler import Emission, Tones


def compile_ahead() -> None:
    """Compile how bearings are found, how pulses come round edges, how they are sampled, and how they are located.

    In the order in which a mission comes to them.
    """
    _find_bearings()
    _hear()
    _sample()
    _locate()


@contextmanager
def second_process() -> Iterator[Callable[[], None]]:
    """What comes back starts the second process, once; it ends with the block, or with this process."""
    started: list[subprocess.Popen[bytes]] = []

    def start() -> None:
        if not started:
            started.append(
                subprocess.Popen(
                    [sys.executable, "-P", "-m", "missions.compile_ahead"],  # not what lies in the folder
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    start_new_session=True,
                )
            )

    try:
        yield start
    finally:
        for process in started:
            process.kill()
            process.communicate()


def _find_bearings() -> None:
    estimate_bearings(np.ones((1, 1, 6)), HelicalArray.nominal(ArrayConfig()).manifold())


def _sample() -> None:
    config, array = ReceiverConfig(), HelicalArray.nominal(ArrayConfig())
    n, n_samples, rng = array.n_elements, config.gate_samples, np.random.default_rng(0)
    receiver = Receiver(config, n)
    chain = receiver.chain(array)
    tones = Tones(np.empty((0, n)), np.empty((0, n)), np.empty(0))
    no_limit_v, background_v2, gate_v = (
        np.full(n, np.inf),
        np.full(n, receiver.noise_variance_v2),
        np.empty((n_samples, n)),
    )
    delay_s = np.full((1, n), 1e-8)
    arrivals = Arrivals(delay_s, np.ones((1, n, 1), dtype=np.complex128), np.ones(1), np.full(1, 1e-8))
    emission, gates = Emission(1.0, 0.0, 0, 1), Gates.room(1, n, n_samples, config.n_bands)
    compile_as_called(sample_pulse, emission, arrivals, chain.sampler, tones, no_limit_v, background_v2, rng, gate_v)
    compile_as_called(sample_noise, chain.sampler, tones, rng, gate_v)
    compile_as_called(read_gate, gates.waveforms_v[0], background_v2, 0.0, chain.gate, 0, gates.pulses)


def _hear() -> None:
    """What comes last of radio: the first process begins with obstacles and mirrors, and meets the rest here."""
    nowhere, nothing, no_path, nothing_m = Vector(0.0, 0.0, 0.0), np.empty(0, OBSTACLE), np.empty(0), np.empty((0, 3))
    rays = BentRays(np.empty(0, BENT_RAY), np.empty(4, SEEN_EDGE), np.empty(0, SHADOW), np.zeros(1))
    compile_as_called(
        bend_round_all, Emitter(nowhere, nowhere), nowhere, nothing, Substance(1.0, 0.0, 0.0, 0.0), 0.0, rays
    )
    none = np.empty(0, np.intp)
    paths = RayPaths(none, nothing_m, no_path, no_path.astype(np.complex128), none, none)
    compile_as_called(arrive, paths, 0, np.zeros((1, 4, 4)), ArrayTable.of([HelicalArray.nominal(ArrayConfig())]))


def _locate() -> None:
    shares_left(np.empty((0, 3)), np.zeros(3), 0.0, np.empty(0, OBSTACLE))
    rng, n_poses, n_pulses = np.random.default_rng(0), 8, 96
    way_m, source_m = np.column_stack([np.linspace(0.0, 7.0, n_poses), np.zeros(n_poses)]), np.array([4.0, 4.0])
    step = np.repeat(np.arange(n_poses), n_pulses // n_poses)
    data = FieldData(
        path=Path("made-up"),
        time_s=np.arange(n_poses, dtype=np.float64),
        pose=np.column_stack([way_m, np.zeros(n_poses)]),
        step=step,
        strengths_v=np.ones((n_pulses, 6)),
        variance_v2=np.full((n_pulses, 6), 1e-4),
        mains_phase_rad=np.full(n_pulses, np.nan),
        channels=np.arange(6),
        n_recorded=6,
    )
    array = array_model(data, ElementSpread(gain=0.05, offset=0.0, pointing_rad=0.03), None, None, 0.2, 0.6)
    along_m = source_m - way_m[step]
    data.strengths_v[:] = array.manifold.gain(np.arctan2(along_m[:, 1], along_m[:, 0])).T
    data.strengths_v[:] += 1e-2 * rng.standard_normal(data.strengths_v.shape)
    locate_field_data(data, array, PoseError(position_m=0.05, heading_rad=0.01, correlation_s=5.0))


def _end_with_parent() -> None:
    """End once nobody holds the other end of the input any more."""
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    gc.disable()  # it does not live long enough
    call_with_room(compile_ahead)
