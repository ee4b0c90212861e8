"""Errors of the elements of one array as far as they are known: a mean and a covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dirmusic.array.element_errors import ElementErrors, ElementSpread

FloatArray = NDArray[np.float64]

N_KINDS = 3
"""Kinds of errors, in the order of their states: gains, pointings, offsets."""

DRIFT = 0.2
"""Assumed: errors change from one mission to the next by a normal step of this share of the data sheet's spread.
Connectors are mated again, amplifiers age and warm up, plates are knocked; 0.2 is 1 % of gain and 0.4 degrees."""

CONTRADICTION = 1.5
"""Errors that have moved by more than so many of the deviations that they were believed to have, root mean square over
all, are those of another array. In 14 pairs of missions in `one_source` those of the same array moved by 1.3 at most,
0.7 in the median; those of another by 2.5 to 4.6, and passed 1.5 before the source was confirmed in 11 (measured)."""


@dataclass(frozen=True, kw_only=True)
class EstimatedErrors:
    """Normal beliefs about the errors of one array.

    Attributes:
        mean: The likeliest errors.
        covariance: Of the gain errors of all elements, then of their pointing errors in radians, then of their offsets
            in units of gain; shape (3 n_elements, 3 n_elements), positive semi-definite. It is zero for kinds that the
            array is not believed to have.

    Raises:
        ValueError: If the covariance is of another shape.
    """

    mean: ElementErrors
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Refuse a covariance of another number of elements."""
        n_states = N_KINDS * self.mean.gain.size
        if self.covariance.shape != (n_states, n_states):
            raise ValueError(f"`covariance` must have shape ({n_states}, {n_states}), got {self.covariance.shape}")

    @classmethod
    def of_spread(cls, spread: ElementSpread, n_elements: int) -> Self:
        """What a data sheet says: no error is the likeliest, and elements are independent."""
        std = np.repeat([spread.gain, spread.pointing_rad, spread.offset], n_elements)
        return cls(mean=ElementErrors.none(n_elements), covariance=np.diag(np.square(std)))

    @classmethod
    def of_states(cls, state: FloatArray, covariance: FloatArray, n_elements: int) -> Self:
        """From states by kind, and their covariance; offsets are zero where the states end before them.

        Args:
            state: Shape (n_kinds n_elements,), n_kinds of 2 or 3.
            covariance: Shape (n_kinds n_elements, n_kinds n_elements).
            n_elements: Of the array.
        """
        kinds, n = np.zeros((N_KINDS, n_elements)), state.size
        kinds.ravel()[:n] = state
        whole = np.zeros((kinds.size, kinds.size))
        whole[:n, :n] = covariance
        return cls(mean=ElementErrors(gain=kinds[0], pointing_rad=kinds[1], offset=kinds[2]), covariance=whole)

    @property
    def state(self) -> FloatArray:
        """The mean as states by kind, shape (3 n_elements,)."""
        return np.concatenate([self.mean.gain, self.mean.pointing_rad, self.mean.offset])

    def take(self, elements: Sequence[int] | NDArray[np.intp]) -> Self:
        """Beliefs about some of the elements alone, by index."""
        states = np.arange(self.covariance.shape[0], dtype=np.intp).reshape(N_KINDS, -1)
        rows: NDArray[np.intp] = states[:, elements].ravel()
        return self.of_states(self.state[rows], self.covariance[rows][:, rows], len(elements))

    def drifted(self, spread: ElementSpread) -> Self:
        r"""What is left of them at the next mission, :math:`C + (\mathrm{DRIFT}\, \sigma)^2 I`: nothing stays certain.

        Args:
            spread: Of the data sheet.
        """
        grown = DRIFT**2 * self.of_spread(spread, self.mean.gain.size).covariance
        return type(self)(mean=self.mean, covariance=self.covariance + grown)

    def contradicts(self, before: EstimatedErrors) -> bool:
        r"""Whether the errors that pulses have shown are not those that were believed before, of which they make use.

        .. math:: (m - m_0)^T C_0^{-1} (m - m_0) > \mathrm{CONTRADICTION}^2 \, n

        over the n states that have a variance. Pulses that bear the beliefs out move the mean by less than its
        deviation: the left side is less than n on average.

        Args:
            before: What was believed.
        """
        free = np.flatnonzero(np.diag(before.covariance) > 0.0)
        moved = (self.state - before.state)[free]
        square = moved @ np.linalg.solve(before.covariance[free][:, free], moved)
        return bool(square > CONTRADICTION**2 * free.size)
