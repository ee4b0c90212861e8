"""Fit of the world to a recording: sources, array, poses and ground with which the simulated drive is most alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.joint_fit import YAW_PRIOR_RAD
from pdpatrol.envs.scenario import Scenario
from pdpatrol.missions.field.gap.noise_free import NoiseFreeDrive, World
from pdpatrol.missions.field.gap.recorded_strengths import PulseGroups
from pdpatrol.missions.field.gap.sources import SITE_STD_M, Place, RecordedSource
from pdpatrol.sensing.radio.materials import GroundName

LEVEL_STD, GAIN_STD, WIDTH_STD = 3.0, 0.7, 0.3
"""Prior standard deviations of the logarithms of the level of a source and of the gain of a channel, and of the
relative width of the beam. Assumed; so wide that the data determine these."""

UNEXPLAINED_LEVEL, FAR_OFF = 0.08, 2.0
"""Relative error of a level that nothing explains, 0.7 dB, and number of these from which on the error of a level is
taken to be as large as its residual (assumed). They limit how sure the ground is."""

FAR_ACROSS = 0.15
"""Distance between recorded and simulated ratios, of unit norm, from which on their error is taken to be as large
(assumed): such pulses came on another path, or from elsewhere."""

STEPS = {"place": 0.02, "axis": 0.1, "pointing": np.radians(1.0), "width": 0.02}
"""Steps of the differences by which derivatives are computed: metres, 1, radians, 1."""

RATIOS = 2.0 ** np.linspace(-2.5, 2.5, 31)
UNEXPLAINED = 0.005 * 2.0 ** np.linspace(0.0, 6.0, 13)
"""Ratios of the pose errors to the stated ones, and relative errors of strengths that nothing explains, that are
compared."""

ROUNDS, DAMPING, N_POSES = 8, (0.0, 0.01, 0.1, 1.0, 10.0), 12
"""Number of times that the model is linearised and fitted again, damping of the steps that are tried, relative to the
diagonal of the information, and number of poses that are tried for each step of the drive (assumed)."""

N_AXES, AXIS_RADII, N_AROUND = 120, (0.12, 0.06), 6
"""Directions of polarisation from which the fit may start: number over half a sphere, then distances from the best of
these, and number of axes along which these are tried (assumed)."""


@dataclass(frozen=True, kw_only=True)
class WorldFit:
    """World with which the simulated drive is most alike the recording.

    Attributes:
        world: Sources, array and ground.
        pose: Poses, shape (n_steps, 3).
        log_level: Logarithm of the amplitude of each source in volts 1 m from it, shape (n_sources,).
        log_gain: Logarithm of the gain of each channel, shape (n_elements,).
        log_gain_covariance: Its covariance, shape (n_elements, n_elements).
        width_std: Standard deviation of the width of the beam.
        ratio_density: Posterior probability of each of `RATIOS`.
        log_evidence: Logarithm of the density of the recording with this ground.
        residual: Difference of the recorded and the simulated strengths, see `DriveFit.compared`, shape (n_groups,
            n_elements).
        simulated: Simulated strengths with gains and levels, volts, shape (n_groups, n_elements).
    """

    world: World
    pose: FloatArray
    log_level: FloatArray
    log_gain: FloatArray
    log_gain_covariance: FloatArray
    width_std: float
    ratio_density: FloatArray
    log_evidence: float
    residual: FloatArray
    simulated: FloatArray


class _Linear(NamedTuple):
    """Model linearised at a state.

    Attributes:
        simulated: Simulated strengths, volts, shape (n_groups, n_elements).
        residual: As in `WorldFit`.
        slope: Derivatives of the simulated strengths as compared, shape (n_groups, n_elements, n_states). Levels have
            none by the pose: they ripple within centimetres.
        curved: Covariance of their errors by the curvature for pose errors as stated, shape (n_groups, n_elements,
            n_elements).
    """

    simulated: FloatArray
    residual: FloatArray
    slope: FloatArray
    curved: FloatArray


class DriveFit:
    """Maximum a posteriori fit for one ground; states are places, axes, levels, gains, pointings, width and poses."""

    def __init__(
        self,
        scenario: Scenario,
        groups: PulseGroups,
        noise_v2: float,
        time_s: FloatArray,
        pose: FloatArray,
        sources: Sequence[RecordedSource],
    ) -> None:
        self._groups, self._pose = groups, pose
        self._places = [source.places for source in sources]
        self._drive = NoiseFreeDrive(scenario=scenario, step=groups.step, source=groups.source)
        self._scale_v, self._pose_std = np.exp(groups.log_level), scenario.pose_sensor.std
        n_sources, self._n = len(sources), scenario.array.n_channels
        self._sizes = np.cumsum([3 * n_sources, 3 * n_sources, n_sources, self._n, self._n, 1])
        lag_s = np.abs(time_s[:, np.newaxis] - time_s)
        correlation = np.exp(-lag_s / scenario.pose_sensor.correlation_s) + 1e-9 * np.eye(time_s.size)
        self._pose_covariance = np.kron(correlation, np.diag(np.square(np.maximum(self._pose_std, 1e-6))))
        pointing = np.radians(max(scenario.array.pointing_error_deg, 0.1)) ** 2 * np.eye(self._n) + YAW_PRIOR_RAD**2
        of_sources = np.repeat([1.0, LEVEL_STD], [3 * n_sources, n_sources])
        self._of_others = block_diag(
            np.diag(np.square(of_sources)), GAIN_STD**2 * np.eye(self._n), pointing, np.array([[WIDTH_STD**2]])
        )
        noise = noise_v2 / (groups.n_pulses * np.square(self._scale_v))
        self._along = np.einsum("gi,gj->gij", groups.unit, groups.unit)
        self._noise = noise[:, np.newaxis, np.newaxis] * np.eye(self._n)
        self._noise += groups.level_variance[:, np.newaxis, np.newaxis] * self._along

    def _world(self, state: FloatArray, ground: GroundName) -> World:
        places, axes, _, _, pointing, width, _ = np.split(state, self._sizes)
        return World(
            positions_m=places.reshape(-1, 3),
            axes=axes.reshape(-1, 3),
            pointing_rad=pointing,
            beam_width=float(np.clip(1.0 + width[0], 0.7, 1.5)),
            ground=ground,
        )

    def _simulate(self, state: FloatArray, ground: GroundName) -> FloatArray:
        """Return the simulated strengths in volts, shape (n_groups, n_elements)."""
        _, _, level, gain, _, _, off = np.split(state, self._sizes)
        strengths = self._drive.strengths(self._pose + off.reshape(-1, 3), self._world(state, ground))
        return strengths * np.exp(level[self._groups.source, np.newaxis] + gain)

    def _compared(self, simulated: FloatArray) -> FloatArray:
        """Return simulated strengths as they are compared with the recorded unit vectors, same shape.

        Across these, they are the simulated ratios; along them, one plus the logarithm of the ratio of the levels.
        """
        level_v = np.linalg.norm(simulated, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # groups that are not received are not finite
            off = np.log(level_v) - self._groups.log_level
            return simulated / level_v[:, np.newaxis] + off[:, np.newaxis] * self._groups.unit

    def _linearise(self, state: FloatArray, ground: GroundName) -> _Linear:
        groups, places, axes, level, gain, pointing, width = (
            self._groups,
            *np.split(np.arange(state.size), self._sizes)[:-1],
        )
        simulated = self._simulate(state, ground)
        here, slope = self._compared(simulated), np.zeros((*simulated.shape, state.size))
        row, channel = np.arange(len(here)), np.arange(self._n)
        unit = simulated / np.linalg.norm(simulated, axis=1, keepdims=True)

        def both(states: IntArray, step: float) -> tuple[FloatArray, FloatArray]:
            """Return simulations with these states increased and decreased, as compared.

            Groups that are not received then, because the step moves their source into equipment, do not change.
            """
            change = np.zeros(state.size)
            change[states] = step
            more, less = (self._compared(self._simulate(state + sign * change, ground)) for sign in (1.0, -1.0))
            return np.where(np.isfinite(more), more, here), np.where(np.isfinite(less), less, here)

        for k in range(3):
            for states, name in ((places, "place"), (axes, "axis")):
                is_at_site = self._is_at_site & (name == "place")
                if is_at_site.all():
                    continue
                more, less = both(states[k::3][~is_at_site], STEPS[name])
                slope[row, :, states[3 * groups.source + k]] = (more - less) / (2 * STEPS[name])
        slope[row, :, level[groups.source]] = groups.unit
        turned = np.zeros(state.size)
        turned[pointing] = STEPS["pointing"]
        by_turn = self._simulate(state + turned, ground) - self._simulate(state - turned, ground)
        by_turn /= 2 * STEPS["pointing"] * np.linalg.norm(simulated, axis=1, keepdims=True)
        for states, of_channel in ((gain, unit), (pointing, by_turn)):
            slope[:, :, states] = (groups.unit - unit)[:, :, np.newaxis] * (unit * of_channel)[:, np.newaxis]
            slope[:, channel, states] += of_channel
        more, less = both(width, STEPS["width"])
        slope[:, :, width[0]] = (more - less) / (2 * STEPS["width"])
        curved = np.zeros((*here.shape, self._n))
        for k, std in enumerate(np.maximum(self._pose_std, 1e-6)):
            more, less = both(np.arange(self._sizes[-1] + k, state.size, 3), std)
            slope[row, :, self._sizes[-1] + 3 * groups.step + k] = (more - less) / (2 * std)
            bend = 0.5 * (more + less - 2 * here)
            curved += np.einsum("gi,gj->gij", bend, bend)
        by_pose = slope[:, :, self._sizes[-1] :]
        by_pose -= groups.unit[:, :, np.newaxis] * np.einsum("gi,gis->gs", groups.unit, by_pose)[:, np.newaxis]
        return _Linear(simulated, groups.unit - here, slope, curved)

    def _errors(self, residual: FloatArray, unexplained: float) -> FloatArray:
        """Return the covariance of the residuals of each group, shape (n_groups, n_elements, n_elements)."""
        own = np.einsum("gij,ij->gij", self._along, np.eye(self._n))
        off2 = np.square(np.einsum("gi,gi->g", self._groups.unit, residual))
        level2 = UNEXPLAINED_LEVEL**2 + np.maximum(off2 - (FAR_OFF * UNEXPLAINED_LEVEL) ** 2, 0.0)
        across2 = np.maximum(np.square(residual).sum(axis=1) - off2 - FAR_ACROSS**2, 0.0)
        explained = self._noise + unexplained**2 * own + across2[:, np.newaxis, np.newaxis] * np.eye(self._n)
        return explained + level2[:, np.newaxis, np.newaxis] * self._along

    def _start(self, ground: GroundName) -> tuple[FloatArray, FloatArray]:
        """Return the state with the places and polarisations that explain the levels best, and the prior covariance.

        The covariance is that of all states but the poses.
        """
        n_sources, groups = len(self._places), self._groups
        state = np.zeros(self._sizes[-1] + self._pose.size)
        places, axes, level, *_ = np.split(np.arange(state.size), self._sizes)
        best, covariances, least = state.copy(), [np.eye(3)] * n_sources, np.full(n_sources, np.inf)

        def compare(tried: Sequence[Place], axes_tried: FloatArray) -> None:
            """Keep places and axes, shape (n_sources, 3), where they are the best so far."""
            state[places], state[axes] = np.concatenate([place_m for place_m, _ in tried]), axes_tried.ravel()
            log_ratio = groups.log_level - np.log(np.linalg.norm(self._simulate(state, ground), axis=1))
            for k in range(n_sources):
                of_source = log_ratio[groups.source == k]
                middle, own = float(np.median(of_source)), slice(3 * k, 3 * k + 3)
                cost = float(np.abs(of_source - middle).sum())
                if cost < least[k]:
                    least[k], best[level[k]], covariances[k] = cost, middle, tried[k][1]
                    best[places[own]], best[axes[own]] = state[places[own]], state[axes[own]]

        for number in range(max(map(len, self._places))):
            tried = [own[min(number, len(own) - 1)] for own in self._places]
            for axis in spread_evenly(N_AXES):
                compare(tried, np.tile(axis, (n_sources, 1)))
        tried = [
            (place_m, covariance) for place_m, covariance in zip(best[places].reshape(-1, 3), covariances, strict=True)
        ]
        for radius in AXIS_RADII:
            around = best[axes].reshape(-1, 3)
            for axis in spread_evenly(N_AROUND):
                for sign in (-radius, radius):
                    moved = around + sign * axis
                    compare(tried, moved / np.linalg.norm(moved, axis=1, keepdims=True))
        self._is_at_site = np.array([covariance_m2[0, 0] <= SITE_STD_M**2 for covariance_m2 in covariances])
        return best, block_diag(*covariances, self._of_others)

    def solve(self, ground: GroundName) -> WorldFit:
        """Fit all states, the ratio of the pose errors and the unexplained errors."""
        ratio, unexplained, rng = 1.0, 0.1, np.random.default_rng(0)
        state, self._global_covariance = self._start(ground)
        mean = np.zeros(state.size)
        mean[: self._sizes[0]] = state[: self._sizes[0]]
        linear, best = self._linearise(state, ground), None
        for _ in range(ROUNDS):
            state = self._advance(linear, state, mean, ground, ratio, unexplained)
            state = self._try_poses(state, ground, ratio, unexplained, rng)
            linear = self._linearise(state, ground)
            density, log_evidence = self._weigh(linear, state - mean)
            ratio = float(np.exp(density.sum(axis=1) @ np.log(RATIOS)))
            unexplained = float(np.exp(density.sum(axis=0) @ np.log(UNEXPLAINED)))
            if best is None or log_evidence > best.log_evidence:
                covariance, _ = self._step(linear, state - mean, ratio, unexplained)
                best = self._result(ground, linear, state, covariance, density, log_evidence)
        assert best is not None
        return best

    def _result(
        self,
        ground: GroundName,
        linear: _Linear,
        state: FloatArray,
        covariance: FloatArray,
        density: FloatArray,
        log_evidence: float,
    ) -> WorldFit:
        _, _, level, gain, _, width, off = np.split(np.arange(state.size), self._sizes)
        pose = self._pose.copy()
        pose += state[off].reshape(-1, 3)
        return WorldFit(
            world=self._world(state, ground),
            pose=pose,
            log_level=state[level],
            log_gain=state[gain],
            log_gain_covariance=covariance[np.ix_(gain, gain)],
            width_std=float(np.sqrt(covariance[width[0], width[0]])),
            ratio_density=density.sum(axis=1),
            log_evidence=log_evidence,
            residual=linear.residual,
            simulated=linear.simulated,
        )

    def _advance(
        self, linear: _Linear, state: FloatArray, mean: FloatArray, ground: GroundName, ratio: float, unexplained: float
    ) -> FloatArray:
        """Return the state after the Levenberg-Marquardt step of least cost, or the state if none decreases it."""
        prior = np.linalg.inv(self._prior(ratio))

        def cost(at: FloatArray) -> float:
            return float(self._misfits(at, ground, unexplained).sum() + (at - mean) @ prior @ (at - mean))

        best, least = state, cost(state)
        for damping in DAMPING:
            tried = state + self._step(linear, state - mean, ratio, unexplained, damping)[1]
            now = cost(tried)
            if now < least:
                best, least = tried, now
        return best

    def _try_poses(
        self, state: FloatArray, ground: GroundName, ratio: float, unexplained: float, rng: np.random.Generator
    ) -> FloatArray:
        """Return the state after trying poses, each drawn from its prior given the others.

        A step of `_advance` ends where another path becomes the strongest, as at the edge of a shadow. Poses that stay
        beyond it need large errors, which would make those of all poses seem larger.
        """
        n_steps, row, known = len(self._pose), np.arange(len(self._pose)), self._sizes[-1]
        precision = np.linalg.inv(ratio**2 * self._pose_covariance)
        own = precision.reshape(n_steps, 3, n_steps, 3)[row, :, row]
        covariance = np.linalg.inv(own)
        root, misfit = np.linalg.cholesky(covariance), self._misfits(state, ground, unexplained)
        for _ in range(N_POSES):
            off = state[known:].reshape(-1, 3)
            mean = off - np.einsum("sij,sj->si", covariance, (precision @ off.ravel()).reshape(-1, 3))
            drawn = mean + np.einsum("sij,sj->si", root, rng.standard_normal(off.shape))
            by_drawn = self._misfits(np.append(state[:known], drawn), ground, unexplained)
            apart = np.stack([off, drawn]) - mean
            far, far_drawn = np.einsum("ksi,sij,ksj->ks", apart, own, apart)
            is_better = by_drawn + far_drawn < misfit + far
            mixed = np.where(is_better[:, np.newaxis], drawn, off).ravel()
            by_mixed = np.where(is_better, by_drawn, misfit)
            if by_mixed.sum() + mixed @ precision @ mixed < misfit.sum() + off.ravel() @ precision @ off.ravel():
                state, misfit = np.append(state[:known], mixed), by_mixed
        return state

    def _misfits(self, state: FloatArray, ground: GroundName, unexplained: float) -> FloatArray:
        """Return -2 times the log density of the strengths of each step without curvature, shape (n_steps,)."""
        residual = self._groups.unit - self._compared(self._simulate(state, ground))
        errors = self._errors(residual, unexplained)
        whitened = np.linalg.solve(errors, residual[:, :, np.newaxis])[:, :, 0]
        of_group = np.einsum("gi,gi->g", residual, whitened) + np.linalg.slogdet(errors)[1]
        return np.bincount(self._groups.step, of_group, len(self._pose))

    def _covariance(self, linear: _Linear, unexplained: float) -> FloatArray:
        return self._errors(linear.residual, unexplained) + linear.curved

    def _prior(self, ratio: float) -> FloatArray:
        return block_diag(self._global_covariance, ratio**2 * self._pose_covariance)

    def _step(
        self, linear: _Linear, off: FloatArray, ratio: float, unexplained: float, damping: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Return the covariance of the states, and the damped Gauss-Newton step from a state `off` its prior mean."""
        weight = np.linalg.inv(self._covariance(linear, unexplained))
        weighted = np.einsum("gij,gjs->gis", weight, linear.slope)
        prior = np.linalg.inv(self._prior(ratio))
        information = np.einsum("gis,git->st", linear.slope, weighted, optimize=True) + prior
        gradient = np.einsum("gis,gi->s", weighted, linear.residual) - prior @ off
        covariance = np.linalg.inv(information + damping * np.diag(np.diag(information)))
        return covariance, covariance @ gradient

    def _weigh(self, linear: _Linear, off: FloatArray) -> tuple[FloatArray, float]:
        """Return the posterior of ratios and unexplained errors, and the logarithm of the evidence.

        Both are of the linearised model, in which the residuals are normal; priors are uniform in the logarithms.

        Returns:
            Probabilities, shape (RATIOS.size, UNEXPLAINED.size), and the log evidence.
        """
        slope = linear.slope.reshape(linear.residual.size, -1)
        from_mean = linear.residual.ravel() + slope @ off
        n = self._sizes[-1]
        fixed = slope[:, :n] @ self._global_covariance @ slope[:, :n].T
        by_pose = slope[:, n:] @ np.linalg.cholesky(self._pose_covariance)
        log_density = np.empty((RATIOS.size, UNEXPLAINED.size))
        for j, unexplained in enumerate(UNEXPLAINED):
            root = np.linalg.cholesky(fixed + block_diag(*self._covariance(linear, unexplained)))
            white = solve_triangular(root, np.column_stack([from_mean, by_pose]), lower=True)
            values, vectors = np.linalg.eigh(white[:, 1:].T @ white[:, 1:])
            along = np.square(vectors.T @ white[:, 1:].T @ white[:, 0])
            grown = np.square(1.0 / RATIOS)[:, np.newaxis] + np.maximum(values, 0.0)
            square = white[:, 0] @ white[:, 0] - (along / grown).sum(axis=1)
            log_det = 2.0 * (np.log(np.diag(root)).sum() + values.size * np.log(RATIOS)) + np.log(grown).sum(axis=1)
            log_density[:, j] = -0.5 * (square + log_det)
        top = log_density.max()
        density = np.exp(log_density - top)
        return density / density.sum(), float(top + np.log(density.mean()))


def spread_evenly(n: int) -> FloatArray:
    """Return n directions on the upper half of a sphere, on a Fibonacci spiral, shape (n, 3)."""
    up, turn_rad = (np.arange(n) + 0.5) / n, np.arange(n) * np.pi * (3.0 - np.sqrt(5.0))
    level = np.sqrt(1.0 - up**2)
    return np.column_stack([level * np.cos(turn_rad), level * np.sin(turn_rad), up])
