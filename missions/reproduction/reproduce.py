"""Run the trials of all exhibits on all cores; the results depend on the seed alone."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Event

from threadpoolctl import threadpool_limits

from pdpatrol.missions.reproduction import exhibits
from pdpatrol.missions.reproduction.exhibit import Campaign, Exhibit
from pdpatrol.missions.reproduction.field_test import field_test

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
)
"""As in the paper, then the additions."""

PARTS: tuple[tuple[Callable[[Campaign], Exhibit | tuple[Exhibit, ...]], int, float], ...] = (
    (exhibits.noise_tables, 5, 0.34),
    (exhibits.element_counts, 6, 0.17),
    (exhibits.phase_method, 10, 0.16),
    (field_test, 20, 0.16),
    (exhibits.manifold_errors, 4, 0.13),
    (exhibits.sample_rates, 6, 0.03),
    (exhibits.bound, 7, 0.01),
)
"""Functions with their number of cells and measured share of the work; the longest first, to end together."""


class CancelledError(Exception):
    """Raised in the worker threads when the caller is interrupted."""


def reproduce(trials: int, seed: int, progress: Callable[[float], None]) -> tuple[Exhibit, ...]:
    """Make every exhibit of the paper.

    Args:
        trials: Trials of each cell, >= 1; the paper has 3600.
        seed: Seed of all trials.
        progress: Called, from any thread, with the share of the work that was done since the last call.

    Returns:
        The exhibits in the order of `ORDER`.
    """
    cancelled = Event()

    def work(part: tuple[Callable[[Campaign], Exhibit | tuple[Exhibit, ...]], int, float]) -> tuple[Exhibit, ...]:
        make, n_cells, share = part

        def tick(n: int) -> None:
            if cancelled.is_set():
                raise CancelledError
            progress(share * n / (n_cells * trials))

        made = make(Campaign(trials=trials, seed=seed, tick=tick))
        return made if isinstance(made, tuple) else (made,)

    with threadpool_limits(limits=1), ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            done = {exhibit.name: exhibit for some in pool.map(work, PARTS) for exhibit in some}
        except BaseException:
            cancelled.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return tuple(done[name] for name in ORDER)
