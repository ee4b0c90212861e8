"""Compilation from the other end, once on a machine: a second process compiles what a first mission comes to last.

In one process the compiler works on one function at a time, and what it has made is kept on disk, where other processes
find it. So the two need no word between them: what both begin at the same time is compiled twice, and nothing else.
"""

from __future__ import annotations

import gc
import os
import sys
import threading

import numpy as np

from dirmusic import ArrayModel, ElementSpread, Locator, PoseError, PulseBatch, estimate_bearings
from dirmusic.bearing.channel_health import ChannelMonitor
from dirmusic.compiled import compile_as_called
from dirmusic.locating.rules import LocatingRules
from pdpatrol.missions.deep_calls import call_with_room
from pdpatrol.sensing.array.array_table import ArrayTable
from pdpatrol.sensing.array.config import ArrayConfig
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.radio.arrivals import Arrivals, arrive
from pdpatrol.sensing.radio.diffraction.bends import BENT_RAY, SEEN_EDGE, BentRays
from pdpatrol.sensing.radio.materials import Substance
from pdpatrol.sensing.radio.mirrors import Standing, reflect_flat, reflect_round
from pdpatrol.sensing.radio.obstruction import SHADOW
from pdpatrol.sensing.radio.polarisation import Emitter
from pdpatrol.sensing.radio.ray_paths import RayPaths, bend_round_all
from pdpatrol.sensing.radio.sight import shares_left
from pdpatrol.sensing.radio.tables import FACE, OBSTACLE
from pdpatrol.sensing.radio.vectors import Vector
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detection import Gates
from pdpatrol.sensing.receiver.gates import read_gate
from pdpatrol.sensing.receiver.receiver import Receiver
from pdpatrol.sensing.receiver.sampling.gate import sample_noise, sample_pulse
from pdpatrol.sensing.receiver.sampling.sampler import Emission, Tones


def compile_ahead() -> None:
    """Compile how bearings are found, how pulses come round edges, how they are sampled, and how they are located.

    In the order in which a mission comes to them.
    """
    _find_bearings()
    _hear()
    _sample()
    _locate()


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
    """The first process begins with what lies straight ahead, and meets mirrors and edges here."""
    nowhere, nothing, ground = Vector(0.0, 0.0, 0.0), np.empty(0, OBSTACLE), Substance(1.0, 0.0, 0.0, 0.0)
    emitter, shadows = Emitter(nowhere, nowhere), np.empty(0, SHADOW)
    rays = BentRays(np.empty(0, BENT_RAY), np.empty(4, SEEN_EDGE), shadows, np.zeros(1))
    compile_as_called(bend_round_all, emitter, nowhere, nothing, ground, 0.0, rays)
    none, no_path = np.empty(0, np.intp), np.empty(0)
    paths = RayPaths(none, np.empty((0, 3)), no_path, no_path.astype(np.complex128), none, none)
    compile_as_called(arrive, paths, 0, np.zeros((1, 4, 4)), ArrayTable.of([HelicalArray.nominal(ArrayConfig())]))
    by = Standing(nothing, shadows, 0, 0.0)
    compile_as_called(reflect_flat, emitter, nowhere, np.zeros(1, FACE)[0], nowhere, ground, False, by)
    compile_as_called(reflect_round, emitter, nowhere, by)


def _locate() -> None:
    shares_left(np.empty((0, 3)), np.zeros(3), 0.0, np.empty(0, OBSTACLE))
    known, rng = HelicalArray.nominal(ArrayConfig()), np.random.default_rng(0)
    array = ArrayModel(
        manifold=known.manifold(), positions_m=known.positions_m, spread=ElementSpread(gain=0.05, pointing_rad=0.03)
    )
    rules = LocatingRules(birth_s=np.inf, birth_pulses=4, birth_by_crossing=True, refit_s=np.inf)
    locator = Locator(array, PoseError(position_m=0.05, heading_rad=0.01, correlation_s=5.0), rules=rules)
    monitor = ChannelMonitor(array)
    for step in range(8):
        pose = np.array([step, 0.0, 0.0])
        strengths_v = array.manifold.gain(np.full(12, np.arctan2(4.0, 4.0 - step))).T
        strengths_v += 1e-2 * rng.standard_normal(strengths_v.shape)
        detected = PulseBatch.detected(np.full(12, float(step)), strengths_v, np.full(strengths_v.shape, 1e-4))
        pulses, _ = monitor.watch(detected)
        locator.update(float(step), pose, pulses)
    locator.refit(7.0)


def _end_with_parent() -> None:
    """End once nobody holds the other end of the input any more."""
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    gc.disable()  # it does not live long enough
    call_with_room(compile_ahead)
