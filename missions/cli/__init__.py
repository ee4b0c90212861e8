"""The program `pdpatrol`: one module per command, imported only when it is used."""

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
        "replay": "open recordings in the Rerun viewer, or make a video",
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
"""Commands and their help texts, by group; each command is a function in a module, both named by `module_of`."""

COMMANDS = tuple(command for commands in GROUPS.values() for command in commands)


def main() -> None:
    """Run the command line."""
    with command_process():
        command, *arguments = sys.argv[1:] or ["--help"]
        if command in ("-h", "--help"):
            sys.stdout.write(_help())
        elif command == "--version":
            sys.stdout.write(f"pdpatrol {version('pdpatrol')}\n")
        elif command not in COMMANDS:
            matches = get_close_matches(command, COMMANDS, n=1)
            meant = f"; did you mean {matches[0]}?" if matches else ""
            print_error(f"command must be one of {', '.join(COMMANDS)}, got {command!r}{meant}")
            sys.exit(USAGE_ERROR)
        else:
            draws = command in ("run", "locate", "report") or any(word.startswith("--video") for word in arguments)
            if draws and sys.platform == "linux" and find_library("EGL"):
                os.environ.setdefault("MUJOCO_GL", "egl")  # to render without a screen; MuJoCo reads it when imported
            # Imported here because it takes a second and `pdpatrol --help` does not need it.
            from pdpatrol.missions.cli.arguments import call_command

            call_command(getattr(import_module(f"{__name__}.{module_of(command)}"), module_of(command)), arguments)


def module_of(command: str) -> str:
    """Return the name of the module of a command, and of its function."""
    return "import_site" if command == "import" else command


def _help() -> str:
    lines = [
        "usage: pdpatrol COMMAND [OPTIONS]",
        "",
        "A simulated inspection robot that finds partial discharges in a substation.",
    ]
    for group, commands in GROUPS.items():
        lines += ["", f"{group}:", *(f"  {command:<11}{text}" for command, text in commands.items())]
    lines += [
        "",
        "  --help     show this text; pdpatrol COMMAND --help lists the options of a command",
        "  --version  show the version",
    ]
    return "".join(f"{wrapped(line, hanging=13 if line.startswith('  ') else 0)}\n" for line in lines)
