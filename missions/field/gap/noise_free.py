"""Noise-free strengths that the simulated array receives from each source at each pose of a drive."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.radio import surroundings_of
from pdpatrol.sensing import DischargeSource, HelicalArray, ReceiverConfig, Scene, level_transform
from pdpatrol.sensing.array.beam_width import scaled_beam
from pdpatrol.sensing.radio.materials import GroundName
from pdpatrol.sensing.receiver.bank import Listener, ReceiverBank

NOISELESS = {"noise_v": 1e-5, "bits": 24, "full_scale_v": 20.0, "false_alarm_rate_hz": 1e-9, "n_bands": 0}
"""Settings of a receiver whose noise is 100 dB below a pulse of 1 V at 1 m. Rays more than 60 dB weaker are ignored."""


@dataclass(frozen=True, kw_only=True)
class World:
    """Sources, array and ground of which the drive is simulated.

    Attributes:
        positions_m: Positions of the sources, shape (n_sources, 3).
        axes: Directions of their polarisation, of any length, shape (n_sources, 3).
        pointing_rad: Pointing error of each element, shape (n_elements,).
        beam_width: Width of the beam relative to the data sheet.
        ground: Material of the ground.
    """

    positions_m: FloatArray
    axes: FloatArray
    pointing_rad: FloatArray
    beam_width: float
    ground: GroundName


@dataclass(kw_only=True)
class NoiseFreeDrive:
    """Simulation of all sources at all poses of a drive, each with one pulse of 1 V at 1 m and without noise.

    Attributes:
        scenario: Yard as on the map, array of the data sheet and receiver.
        step: Pose of each strength that is wanted, shape (n,).
        source: Its source, shape (n,).
    """

    scenario: Scenario
    step: IntArray
    source: IntArray
    _config: ReceiverConfig = field(init=False)
    _nominal: HelicalArray = field(init=False)

    def __post_init__(self) -> None:
        """Prepare receiver, array and yard."""
        self._config = self.scenario.receiver.model_copy(update=NOISELESS)
        self._nominal = HelicalArray.nominal(self.scenario.array)
        self._yard = self.scenario.known_yard

    def strengths(self, pose: FloatArray, world: World) -> FloatArray:
        """Return the strengths in volts, shape (n, n_elements); NaN where no pulse arrives.

        Args:
            pose: Poses of all steps, shape (n_steps, 3).
            world: Sources, array and ground.
        """
        axes, n_sources = world.axes / np.linalg.norm(world.axes, axis=-1, keepdims=True), len(world.axes)
        sources = [
            DischargeSource(
                name=str(k),
                position_m=place_m,
                amplitude_v=1.0,
                pulse_rate_hz=1.0,
                axis=axis,
                n_shots=len(pose),
                first_shot_s=(k + 0.5) / n_sources,
            )
            for k, (place_m, axis) in enumerate(zip(world.positions_m, axes, strict=True))
        ]
        array = replace(
            self._nominal,
            pattern=scaled_beam(self._nominal.pattern, world.beam_width),
            boresights_rad=self._nominal.boresights_rad + world.pointing_rad,
        )
        around = surroundings_of(self._yard, self.scenario.radio.model_copy(update={"ground": world.ground}))
        rng = np.random.default_rng(0)  # the same one each time, so that differences have no noise
        listener = Listener(array=array, scene=Scene(sources, around), nature_rng=rng, receiver_rng=rng)
        bank = ReceiverBank(self._config, [listener])
        result = np.full((len(pose), n_sources, array.n_elements), np.nan)
        for step in np.unique(self.step).tolist():
            pulses = bank.listen(level_transform(pose[step])[np.newaxis], np.array([float(step)]), 1.0).pulses
            number = ((pulses.time_s - step) * n_sources).astype(np.intp)
            result[step, number] = pulses.strengths_v
        return result[self.step, self.source]
