"""Locate emitters in measured data of public repositories, print a table and write docs/measured.md.

uv run --extra measured python examples/measured/make_page.py DATA  # a folder with rfid, powder and wifi_robot
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from pathlib import Path

import powder
import rfid
import wifi_robot
from result import HEADINGS, Run

PAGE = Path(__file__).parents[2] / "docs" / "measured.md"
TEMPLATE = Path(__file__).with_name("page.md")
SETS = ("rfid", "wifi_robot", "powder")


def table(runs: list[Run]) -> str:
    """Make a Markdown table with a line for each run."""
    lines = [HEADINGS, ["---"] * len(HEADINGS), *(run.cells for run in runs)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main(data: Path, page: Path) -> None:
    """Evaluate all sets, print the tables and write the page."""
    tables = {
        "rfid": table(rfid.evaluate(data / "rfid")),
        "wifi_robot": table(wifi_robot.evaluate(data / "wifi_robot")),
        "powder": powder.evaluate(data / "powder"),
        "powder two": powder.evaluate_two(data / "powder"),
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    for name, each in tables.items():
        sys.stdout.write(f"{name}\n\n{each}\n\n")
        text = text.replace(f"<!-- {name} -->", each)
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("data", type=Path, help=f"folder with the folders {', '.join(SETS)}")
    parser.add_argument("--page", type=Path, default=PAGE, help="page to write (default: docs/measured.md)")
    given = parser.parse_args()
    found = [name for name in SETS if (given.data / name).is_dir()]
    if len(found) < len(SETS):
        parser.error(f"{given.data} must have the folders {', '.join(SETS)}, got {', '.join(found) or 'none of them'}")
    main(given.data, given.page)
