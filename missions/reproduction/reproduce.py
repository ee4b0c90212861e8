"""All exhibits at once, on all cores, the same for the same seed whatever their number."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import NamedTuple

from threadpoolctl import threadpool_limits

from pdpatrol.missions.reproduction.exhibit import Campaign, Exhibit
from pdpatrol.missions.reproduction.exhibits import arrays, comparisons, field, limits, noise, over_frequency

ORDER = (
    "table1",
    "fig4",
    "fig5",
    "fig7",
    "table2",
    "table3",
    "phase_method",
    "sample_rate",
    "bound",
    "ring_size",
    "elevation",
    "over_frequency",
)
"""As in the paper, then what it lacks."""


class _Part(NamedTuple):
    """What makes some exhibits, how many cells of trials it has, and its share of the work, as measured."""

    make: Callable[[Campaign], Exhibit | tuple[Exhibit, ...]]
    n_cells: int
    share: float


PARTS = (
    _Part(noise.noise_tables, 5, 0.28),
    _Part(limits.ring_sizes, 6, 0.16),
    _Part(arrays.element_counts, 6, 0.14),
    _Part(comparisons.phase_method, 10, 0.13),
    _Part(arrays.manifold_errors, 4, 0.11),
    _Part(field.field_test, 20, 0.13),
    _Part(comparisons.sample_rates, 6, 0.02),
    _Part(over_frequency.over_frequency, 6, 0.02),
    _Part(limits.bound, 7, 0.005),
    _Part(limits.elevation, 6, 0.005),
)
"""The longest first, so that no core waits for it at the end."""


class _CancelledError(Exception):
    """Raised in the workers when the caller is interrupted."""


def reproduce(trials: int, seed: int, progress: Callable[[float], None]) -> tuple[Exhibit, ...]:
    """Every exhibit of the paper beside ours.

    Args:
        trials: Of each cell, >= 1; the paper has 3600.
        seed: Fixes all that is drawn.
        progress: Told by how much of the whole, 0 to 1, the work has advanced since it was told last; from any thread.

    Returns:
        The exhibits, in the order of `ORDER`.
    """
    cancelled = Event()

    def work(part: _Part) -> tuple[Exhibit, ...]:
        def tick(n: int) -> None:
            if cancelled.is_set():
                raise _CancelledError
            progress(part.share * n / (part.n_cells * trials))

        made = part.make(Campaign(trials=trials, seed=seed, tick=tick))
        return made if isinstance(made, tuple) else (made,)

    with threadpool_limits(limits=1), ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            done = {exhibit.name: exhibit for some in pool.map(work, PARTS) for exhibit in some}
        except BaseException:
            cancelled.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return tuple(done[name] for name in ORDER)
