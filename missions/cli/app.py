"""`pdpatrol`: the command line. Its help and its refusals come before anything heavy is loaded."""

from __future__ import annotations

import tyro

from pdpatrol.missions.cli.export import export
from pdpatrol.missions.cli.locate import locate
from pdpatrol.missions.cli.plan import plan
from pdpatrol.missions.cli.replay import replay
from pdpatrol.missions.cli.report import report
from pdpatrol.missions.cli.reproduce import reproduce
from pdpatrol.missions.cli.results import results
from pdpatrol.missions.cli.run import run
from pdpatrol.missions.cli.scenarios import scenarios
from pdpatrol.missions.cli.sweep import sweep
from pdpatrol.missions.cli.trend import trend


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
