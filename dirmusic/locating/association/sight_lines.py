"""What the map leaves of the straight paths between findings and the places from which pulses were detected."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dirmusic.locating.finding import Finding

FloatArray = NDArray[np.float64]

Sight = Callable[[FloatArray, FloatArray, float], FloatArray]
"""(places (n, 3), target (3,), metres at the target's end in which nothing counts) -> share of the amplitude of a wave
that known equipment leaves on the straight path, (n,), in [0, 1]."""

TARGET_STEP_M = 0.1
"""Targets are looked at to this (assumed): once they are known, findings move less."""

MOST_TARGETS = 1000
"""So many are kept (assumed): those of some ten findings and the heights and sides at which they may be."""

HEIGHTS_SIGMAS = (-1.0, 0.0, 1.0, 2.0)
"""Heights at which a finding may be, in standard deviations (assumed): what hides stands below more often."""

LIKELIEST_HEIGHT = HEIGHTS_SIGMAS.index(0.0)

LEAST_HEIGHT_M = 0.1
"""Nothing discharges below (assumed)."""


class SightLines:
    """Shares left on straight paths to targets, each worked out once for each place.

    Args:
        sight: What the map says; None without a map.
    """

    def __init__(self, sight: Sight | None) -> None:
        self._sight = sight
        self._known: dict[tuple[float, ...], FloatArray] = {}

    @property
    def has_map(self) -> bool:
        """Whether anything is known of what obstructs."""
        return self._sight is not None

    def shares(self, places_m: FloatArray, target_m: FloatArray, within_m: float) -> FloatArray:
        """As `Sight`, of a target (3,) from places (n, 3) that are those of the last call and maybe more."""
        return self._shares(places_m, np.rint(target_m / TARGET_STEP_M).astype(np.intp).tolist(), within_m)

    def at_heights(self, places_m: FloatArray, finding: Finding, within_m: float) -> FloatArray:
        """Shares for each height at which a finding may be, shape (n_heights, n)."""
        targets_m = np.tile(finding.position_m, (len(HEIGHTS_SIGMAS), 1))
        targets_m[:, 2] = np.maximum(targets_m[:, 2] + finding.height_std_m * np.array(HEIGHTS_SIGMAS), LEAST_HEIGHT_M)
        steps = np.rint(targets_m / TARGET_STEP_M).astype(np.intp).tolist()
        return np.array([self._shares(places_m, step, within_m) for step in steps])

    def _shares(self, places_m: FloatArray, steps: list[int], within_m: float) -> FloatArray:
        """As `shares`, of a target in units of `TARGET_STEP_M`."""
        if self._sight is None:
            return np.ones(len(places_m))
        key = (*steps, within_m)
        known = self._known.get(key, np.empty(0))
        if known.size < len(places_m):
            target_m = np.array(steps) * TARGET_STEP_M
            more = self._sight(places_m[known.size :], target_m, within_m)
            known = self._known[key] = np.concatenate([known, more])
            if len(self._known) > MOST_TARGETS:
                del self._known[next(iter(self._known))]
        return known
