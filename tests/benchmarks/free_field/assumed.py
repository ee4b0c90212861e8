"""Cases drawn from the model of the Locator, and the bound of the position in them.

The states are drawn from their priors (`joint_fit.array_prior`) with the least error level of the pattern, and the
strengths from the model in docs/explanation/locating.md, in NumPy. The noise is that of the receiver and interference
with the ground wave. Poses are exact, and no error is unexplained.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.locating.joint_fit import (
    HEIGHT_PRIOR_M,
    LEAST_PATTERN,
    LEAST_UNEXPLAINED,
    ErrorLevels,
    StatePrior,
    array_prior,
)
from dirmusic.locating.measurement import N_PLACE
from dirmusic.locating.pulse_pool import PulsePool
from pdpatrol.envs.scenario.base import STEP_S
from pdpatrol.envs.user_code import make_estimator
from tests.benchmarks.free_field.cases import Case
from tests.dirmusic.locating.forward_model import (
    Nature,
    distorted,
    gains,
    ground_effect,
    ground_phase,
    image_of,
    modelled,
    sights,
)

NUDGE = 1e-5
"""Step of the finite differences in the bound, in metres, radians and units of gain."""


class AssumedCase(NamedTuple):
    """A case with states drawn from the priors of the Locator.

    Attributes:
        case: The case, with strengths drawn from the model.
        array_state: States of the array, in the order of `measurement.predict`, shape (n_states,).
        amplitude: Amplitude of each pulse, shape (n_pulses,).
        group: Group of each pulse; a group shares its interference, shape (n_pulses,).
    """

    case: Case
    array_state: FloatArray
    amplitude: FloatArray
    group: IntArray


def as_assumed(case: Case, seed: int) -> AssumedCase:
    """Draw states and strengths for an exact case, with the amplitudes and the noise that it has."""
    rng, pulses, prior = np.random.default_rng(seed), case.pulses, prior_of(case)
    nominal = _strengths(case, case.sources_m[0], Nature())
    amplitude = (pulses.strengths_v * nominal).sum(axis=-1) / np.square(nominal).sum(axis=-1)
    state = prior.mean + prior.root @ rng.standard_normal(prior.mean.size)
    nature, group = _nature(state), _groups(case)
    clean = _strengths(case, case.sources_m[0], nature)
    phases = rng.standard_normal((group.max() + 1, 2))[group]
    clean += (_interference(case, nature) * phases[:, np.newaxis]).sum(axis=-1)
    noise_v = np.sqrt(pulses.variance_v2) * rng.standard_normal(clean.shape)
    changed = pulses._replace(strengths_v=np.abs(amplitude[:, np.newaxis] * clean + noise_v))
    estimator = make_estimator("maximum_likelihood", case.array)
    changed = estimator(changed, case.array).attached_to(changed)
    return AssumedCase(case._replace(pulses=changed), state, amplitude, group)


def position_bound(assumed: AssumedCase) -> FloatArray:
    r"""Compute the bound of the position with all states that the Locator fits, and their priors.

    The Bayesian information (Van Trees, Detection, Estimation, and Modulation Theory, part I, 1968, section 2.4.3) of
    pulses k with strengths :math:`\alpha_k h_k(\theta)` of unknown amplitude and the covariance :math:`C_k`, for states
    of the prior covariance P, is

    .. math:: F = \sum_k D_k^T (I - u_k u_k^T) D_k + P^{-1},
        \quad D_k = C_k^{-1/2} \alpha_k \frac{\partial h_k}{\partial \theta}, \quad u_k \propto C_k^{-1/2} h_k

    The m pulses of a group share their interference q, (n_elements, 2). They have the information of independent pulses
    with :math:`C_k = \Sigma_k + m \alpha_k^2 q_k q_k^T`. Assumed: the information at the drawn states is its mean
    over their prior.

    Returns:
        Covariance of the horizontal position, shape (2, 2), square metres.
    """
    case, state, amplitude, group = assumed
    prior, nature = prior_of(case), _nature(state)
    source_m, scale = case.sources_m[0], amplitude[:, np.newaxis, np.newaxis]
    towards = expected_v(assumed)[:, :, np.newaxis]
    ends = [
        [_strengths(case, source_m + step, nature) for step in (nudge, -nudge)] for nudge in NUDGE * np.eye(N_PLACE)
    ]
    ends += [
        [_strengths(case, source_m, distorted(nature, i, step)) for step in (NUDGE, -NUDGE)]
        for i in range(prior.mean.size)
    ]
    slope = scale * np.stack([(later - earlier) / (2.0 * NUDGE) for later, earlier in ends], axis=-1)
    interference = scale * _interference(case, nature)
    covariance = np.bincount(group)[group][:, np.newaxis, np.newaxis] * interference @ interference.swapaxes(1, 2)
    covariance += case.pulses.variance_v2[:, :, np.newaxis] * np.eye(case.array.manifold.n_elements)
    root = np.linalg.cholesky(covariance)
    slope, towards = np.linalg.solve(root, slope), np.linalg.solve(root, towards)
    slope -= towards * (towards * slope).sum(axis=1, keepdims=True) / np.square(towards).sum(axis=1, keepdims=True)
    flat = slope.reshape(-1, slope.shape[-1])
    information = flat.T @ flat
    information[2, 2] += HEIGHT_PRIOR_M[1] ** -2
    information[N_PLACE:, N_PLACE:] += prior.information
    return np.linalg.inv(information)[:2, :2].astype(np.float64)


def expected_v(assumed: AssumedCase) -> FloatArray:
    """Compute the strengths without noise and interference, shape (n_pulses, n_elements)."""
    return assumed.amplitude[:, np.newaxis] * _strengths(
        assumed.case, assumed.case.sources_m[0], _nature(assumed.array_state)
    )


def prior_of(case: Case) -> StatePrior:
    """Return the prior of the states of the array."""
    return array_prior(case.array, ErrorLevels(LEAST_UNEXPLAINED, LEAST_PATTERN))


def _nature(state: FloatArray) -> Nature:
    """Return the array of the states in the order of `measurement.predict`."""
    nature = Nature()
    for i, value in enumerate(state):
        nature = distorted(nature, i, float(value))
    return nature


def _groups(case: Case) -> IntArray:
    """Return the number of the group in which the Locator pools each pulse, shape (n_pulses,)."""
    pool = PulsePool(case.array, case.pose_error)
    for k, pose in enumerate(case.pose):
        pool.add(STEP_S * (k + 1), pose, case.pulses.take(np.flatnonzero(case.step == k)))
    pool.pool()
    return pool.group


def _strengths(case: Case, source_m: FloatArray, nature: Nature) -> FloatArray:
    """Return the strengths of pulses of unit amplitude, shape (n_pulses, n_elements)."""
    pose = case.true_pose[case.step]
    return modelled(pose, np.tile(source_m, (len(pose), 1)), case.array, nature)


def _interference(case: Case, nature: Nature) -> FloatArray:
    """Return standard deviations of these strengths by interference with the ground wave, in phase and in quadrature.

    The shape is (n_pulses, n_elements, 2).
    """
    pose = case.true_pose[case.step]
    place_m = np.tile(case.sources_m[0], (len(pose), 1))
    vector = sights(pose, place_m, case.array)
    image = gains(sights(pose, image_of(place_m), case.array), case.array, nature)
    own = (1.0 + nature.errors.gain) * case.array.manifold.gain_factors / np.sqrt(2.0)
    change = (
        own * image * ground_effect(pose, place_m, case.array, nature.permittivity)[1] / np.linalg.norm(vector, axis=0)
    )
    phase = ground_phase(pose, place_m, case.array)
    return np.stack([change * np.cos(phase), change * np.sin(phase)], axis=-1)
