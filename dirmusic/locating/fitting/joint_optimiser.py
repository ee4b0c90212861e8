"""The optimiser of the joint fit: a trust region over all places and errors of the elements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.model import ArrayModel

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

    from dirmusic.locating.fitting.joint_kernels import Beliefs, Explained, Quadratic

FloatArray = NDArray[np.float64]

MOST_STEPS, MOST_IDLE, LEAST_GAIN = 30, 3, 1e-6
"""A fit ends after so many steps, so many in a row that are not taken, or one that lowers the cost by a smaller
share."""


class JointOptimiser:
    """The problem as an optimiser sees it: errors of the elements in units of their spread, places in metres.

    Args:
        data: What is to be explained.
        array: The array's data sheet.
        beliefs: What is known beforehand.
        n_kinds: How many kinds of errors the elements have.
        n_places: How many states are of places.
        n_terms: How many are of what the pattern is off by.
    """

    def __init__(
        self, data: Explained, array: ArrayModel, beliefs: Beliefs, n_kinds: int, n_places: int, n_terms: int
    ) -> None:
        from dirmusic.array.pattern import as_boresights
        from dirmusic.locating.fitting.joint_kernels import NominalArray

        manifold = array.manifold
        nominal = NominalArray(
            array.positions_m,
            as_boresights(manifold.boresights_rad, manifold.boresight_elevations_rad),
            manifold.gain_factors,
            manifold.gain_offsets,
            manifold.pattern_table,
        )
        self.n_places, self.n_terms = n_places, n_terms
        self._scale = np.concatenate([np.ones(n_places), beliefs.spread[n_places:]])
        self._arguments = n_kinds, n_terms, data, nominal, beliefs
        self._known: tuple[FloatArray, Quadratic] | None = None

    def solve(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The best state (n_states,), and the Hessian there (n_states, n_states)."""
        from scipy.optimize import minimize  # here, so that a command line help need not wait for it

        last_cost, n_idle = np.inf, 0

        def stop(intermediate_result: OptimizeResult) -> None:
            """End the iteration where steps gain too little, or several in a row were rejected."""
            nonlocal last_cost, n_idle
            cost = float(intermediate_result.fun)
            if cost == last_cost:
                n_idle += 1
            elif last_cost - cost < LEAST_GAIN * cost:
                raise StopIteration
            else:
                n_idle = 0
            if n_idle >= MOST_IDLE:
                raise StopIteration
            last_cost = cost

        found = minimize(
            lambda x: self._at(x).cost,
            start / self._scale,
            method="trust-exact",
            jac=lambda x: self._scale * self._at(x).gradient,
            hess=lambda x: np.multiply.outer(self._scale, self._scale) * self._at(x).hessian,
            callback=stop,
            options={"maxiter": MOST_STEPS, "initial_trust_radius": 10.0, "max_trust_radius": 1000.0},
        )
        best = np.asarray(found.x, dtype=np.float64)
        return best * self._scale, self._at(best).hessian

    def cost(self, state: FloatArray) -> float:
        """Of a state (n_states,), the negative logarithm of its probability."""
        return self._at(state / self._scale).cost

    def hessian(self, state: FloatArray) -> FloatArray:
        """The Hessian about a state, shape (n_states, n_states)."""
        return self._at(state / self._scale).hessian

    def _at(self, x: FloatArray) -> Quadratic:
        """The cost about a state; the last is kept, for the optimiser asks for its parts one by one."""
        from dirmusic.locating.fitting.joint_kernels import evaluate

        if self._known is None or not np.array_equal(self._known[0], x):
            self._known = x.copy(), evaluate(self._scale * x, *self._arguments)
        return self._known[1]
