"""What a receiver samples with, and what comes in, as compiled loops read them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.sensing.radio.arrivals import Arrivals
from pdpatrol.sensing.receiver.front_end import NoiseFilter, PulseTable

FloatArray = NDArray[np.float64]


class Timing(NamedTuple):
    """Lengths in samples.

    Attributes:
        before: From the start of a gate to where its loudest channel comes to half its peak.
        aperture: By which arrivals at two elements may differ.
        rise: From an arrival to where the pulse is past its peak.
        peak: From where a pulse triggers to where all channels are past their peaks.
        gate: Length of a gate.
        apart: Noise so far apart is independent.
    """

    before: int
    aperture: int
    rise: int
    peak: int
    gate: int
    apart: int


class Trigger(NamedTuple):
    """When a sample triggers.

    Attributes:
        level_v: What the magnitude of a sample has to exceed, in any channel.
        noise_v: Standard deviation of a sample of noise behind the band-pass.
        correlation: Of that noise over the lags from 0 on, shape (n_lags,); 0 beyond.
        probability: That a sample with so much signal triggers, for signals in steps of `step_v` from 0 on; shape
            (n_steps,).
        step_v: As said.
    """

    level_v: float
    noise_v: float
    correlation: FloatArray
    probability: FloatArray
    step_v: float


class BurstTest(NamedTuple):
    """What makes a burst: in the loudest channel its power lasts through all of some windows after the gate.

    Attributes:
        first: From the start of the gate to that of the first window, samples.
        step: From one window to the next, samples.
        n_windows: How many there are.
        n_samples: Length of each.
        share: Of the mean power in the gate, that a burst exceeds in each window.
    """

    first: int
    step: int
    n_windows: int
    n_samples: int
    share: float


class Sampler(NamedTuple):
    """How a receiver samples.

    Attributes:
        pulse: Shape of a pulse behind the filter.
        noise: The filter, and the noise before it.
        timing: Of windows and gates.
        trigger: When a sample triggers.
        burst: What makes a burst.
    """

    pulse: PulseTable
    noise: NoiseFilter
    timing: Timing
    trigger: Trigger
    burst: BurstTest


class Tones(NamedTuple):
    """Steady carriers behind the band-pass, as the channels of an array at one place receive them.

    Attributes:
        amplitude_v: Shape (n_carriers, n_elements).
        phase_rad: Shape (n_carriers, n_elements).
        turn_rad: By which each goes on from sample to sample, shape (n_carriers,).
    """

    amplitude_v: FloatArray
    phase_rad: FloatArray
    turn_rad: FloatArray


class Emission(NamedTuple):
    """One emission and the ray paths it takes.

    Attributes:
        peak_v: 1 m away in a unit-gain channel, before the band-pass, with its sign.
        burst_s: How long it lasts if it is a burst, 0 for a pulse.
        first: First of its paths among the arrivals.
        n_paths: How many it has.
    """

    peak_v: float
    burst_s: float
    first: int
    n_paths: int


class Incoming(NamedTuple):
    """One emission as it comes in, and the carriers beside it.

    Attributes:
        emission: What is on its way.
        arrivals: Its paths among others.
        tones: Carriers.
        start_rad: Their phases at the start of the first window, shape (n_carriers,).
    """

    emission: Emission
    arrivals: Arrivals
    tones: Tones
    start_rad: FloatArray
