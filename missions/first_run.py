"""Compilation of all kernels before the first mission on a machine, so that later commands and workers load them."""

from rich.console import Console

from dirmusic.compiled import is_cache_complete, mark_cache_complete
from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import run_mission

TIME_LIMIT_S = 60.0
"""Simulated time of the mission that is run to compile; in the scenario `two_sources` it calls every kernel."""


def compile_at_first_run(console: Console) -> None:
    """Print a message and run a short mission that calls every kernel, unless all kernels are cached on disk."""
    if is_cache_complete():
        return
    with console.status("Compiling for the first run, one to three minutes ..."):
        run_mission(load_scenario("two_sources", {"task.time_limit_s": TIME_LIMIT_S}))
    mark_cache_complete()
