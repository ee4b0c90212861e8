"""All that `reproduce` leaves in its folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.report.page import inline_svg
from pdpatrol.missions.reproduction.exhibit import Exhibit
from pdpatrol.missions.reproduction.output.page import reproduction_page
from pdpatrol.missions.reproduction.output.pictures import pictures
from pdpatrol.missions.reproduction.output.tables import as_json


def write_reproduction(
    exhibits: Sequence[Exhibit], trials: int, seed: int, folder: Path, progress: Callable[[float], None]
) -> dict[str, Any]:
    """Write the pictures, reproduction.json and reproduction.html.

    Args:
        exhibits: All of them.
        trials: Of each cell.
        seed: Of what was drawn.
        folder: Where to.
        progress: Told by how much of the whole the work has advanced.

    Returns:
        What reproduction.json holds.
    """
    by_name, inline, method = {exhibit.name: exhibit for exhibit in exhibits}, dict[str, Markup](), list[Markup]()
    every = pictures(seed)
    for picture in every:
        figure = picture.of(by_name)
        with atomic_file(folder / f"{picture.name}.png") as file:
            figure.savefig(file, format="png")
        svg = inline_svg(figure, picture.name, "; ".join(by_name[name].title for name in picture.exhibits))
        if picture.exhibits:
            inline[picture.exhibits[0]] = svg
        else:
            method.append(svg)
        progress(1.0 / len(every))
    data = as_json(exhibits, trials, seed)
    write_text(folder / "reproduction.json", json.dumps(data, indent=2) + "\n")
    write_text(folder / "reproduction.html", reproduction_page(exhibits, inline, method, trials, seed))
    return data
