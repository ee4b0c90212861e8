"""`pdpatrol edit`: draw a yard on a page of this machine."""

import webbrowser
from pathlib import Path
from typing import Annotated

import tyro
from pydantic import Field

from pdpatrol.missions.cli.arguments import Flag
from pdpatrol.missions.cli.terminal import refuse, say
from pdpatrol.missions.editor.server import editor_server


def edit(
    file: Annotated[Path, tyro.conf.arg(metavar="FILE.toml")],
    /,
    *,
    port: Annotated[int, Field(ge=0, le=65535)] = 0,
    no_open: Flag = False,
) -> None:
    """Draw the yard of a scenario file in a browser on this machine (127.0.0.1).

    Equipment, route, dock and sources are dragged on the plan, and checked as `pdpatrol scenarios` checks them.
    Comments and layout of the file are kept. A new file starts with an empty yard.

    Args:
        file: Scenario file, which may be new.
        port: Port of the page; 0 for one that is free.
        no_open: Print the address of the page without opening it.
    """
    if file.suffix != ".toml" or not file.parent.is_dir():
        refuse(f"FILE must be a .toml file in an existing folder, got {file}")
    with editor_server(file, port) as server:
        say(f"Editing {file} at {server.url}  (Ctrl-C ends it)")
        if not no_open:
            webbrowser.open(server.url)
        server.serve_forever()
