"""The command `pdpatrol`: one module per verb, imported only when the verb is used."""

import os
import sys
from ctypes.util import find_library
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import version

from pdpatrol.missions.cli.process import USAGE_ERROR, command_process, print_error, wrapped

__all__ = ["main"]

GROUPS = {
    "Missions": {
        "run": "run one mission and write its log, report and recording",
        "replay": "open recordings in the Rerun viewer, or make a film",
        "report": "write the report of a mission again from its log",
        "export": "convert a mission to CSV, GeoJSON, Parquet and MCAP, or a yard to GeoJSON",
        "trend": "compare repeated inspections of one yard",
    },
    "Scenarios": {
        "scenarios": "list the shipped scenarios, or check and draw a file",
        "edit": "draw a yard in the browser",
        "generate": "draw a substation and write it as a scenario file",
        "import": "make a scenario from a map of a substation",
        "plan": "plan a patrol that covers every site of a yard",
    },
    "Field data": {
        "locate": "locate discharges in field data",
        "calibrate": "learn the pattern of an antenna from turns on the spot",
        "gap": "compare a recording with the simulation of the same drive",
    },
    "Studies": {
        "sweep": "run many missions in parallel",
        "results": "summarise the results of sweeps",
        "reproduce": "compare every exhibit of the Dir-MUSIC paper with ours",
    },
}
"""Verbs and their help texts, by group; each verb is a function in a module, both named by `module_of`."""

VERBS = tuple(verb for verbs in GROUPS.values() for verb in verbs)


def main() -> None:
    """Run the command line."""
    with command_process():
        verb, *arguments = sys.argv[1:] or ["--help"]
        if verb in ("-h", "--help"):
            sys.stdout.write(_help())
        elif verb == "--version":
            sys.stdout.write(f"pdpatrol {version('pdpatrol')}\n")
        elif verb not in VERBS:
            matches = get_close_matches(verb, VERBS, n=1)
            meant = f"; did you mean {matches[0]}?" if matches else ""
            print_error(f"verb must be one of {', '.join(VERBS)}, got {verb!r}{meant}")
            sys.exit(USAGE_ERROR)
        else:
            draws = verb in ("run", "locate", "report") or any(word.startswith("--video") for word in arguments)
            if draws and sys.platform == "linux" and find_library("EGL"):
                os.environ.setdefault("MUJOCO_GL", "egl")  # to render without a screen; MuJoCo reads it when imported
            # Imported here because it takes a second and `pdpatrol --help` does not need it.
            from pdpatrol.missions.cli.arguments import call_verb

            call_verb(getattr(import_module(f"{__name__}.{module_of(verb)}"), module_of(verb)), arguments)


def module_of(verb: str) -> str:
    """Return the name of the module of a verb, and of its function."""
    return "import_site" if verb == "import" else verb


def _help() -> str:
    lines = [
        "usage: pdpatrol VERB [OPTIONS]",
        "",
        "A simulated inspection robot that finds partial discharges in a substation.",
    ]
    for group, verbs in GROUPS.items():
        lines += ["", f"{group}:", *(f"  {verb:<11}{text}" for verb, text in verbs.items())]
    lines += [
        "",
        "  --help     show this text; pdpatrol VERB --help lists the options of a verb",
        "  --version  show the version",
    ]
    return "".join(f"{wrapped(line, hanging=13 if line.startswith('  ') else 0)}\n" for line in lines)
