"""`pdpatrol`: the command line. Its help and its refusals come before anything heavy is loaded."""

from __future__ import annotations

import tyro

from missions.cli.export import export
from missions.cli.locate import locate
from missions.cli.plan import plan
from missions.cli.replay import replay
from missions.cli.report import report
from missions.cli.reproduce import reproduce
from missions.cli.results import results
from missions.cli.run import run
from missions.cli.scenarios import scenarios
from missions.cli.sweep import sweep
from missions.cli.trend import trend


def run_verb() -> None:
    """Read the command line and do what it says."""
    app = tyro.extras.SubcommandApp()
    for verb in (run, plan, replay, report, scenarios, reproduce, locate, trend, export, sweep, results):
        app.command(verb)
    app.cli(
        prog="pdpatrol",
        description="A simulated inspection robot that finds partial discharges in a substation.",
        config=(tyro.conf.FlagCreatePairsOff,),
    )
