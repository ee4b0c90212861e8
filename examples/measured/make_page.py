"""Locate emitters in measured data of public repositories, print a table and write docs/measured.md.

uv run --extra measured python examples/measured/make_page.py DATA  # a folder with rfid, powder and wifi_robot
"""

from __future__ import annotations

import sys
from pathlib import Path

import powder
import rfid
import wifi_robot
from result import HEADINGS, Run

PAGE = Path(__file__).parents[2] / "docs" / "measured.md"
TEMPLATE = Path(__file__).with_name("page.md")


def table(runs: list[Run]) -> str:
    """Make a Markdown table with a line for each run."""
    lines = [HEADINGS, ["---"] * len(HEADINGS), *(run.cells for run in runs)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main(data: Path) -> None:
    """Evaluate all sets, print the tables and write the page."""
    tables = {
        "rfid": table(rfid.evaluate(data / "rfid")),
        "wifi_robot": table(wifi_robot.evaluate(data / "wifi_robot")),
        "powder": powder.evaluate(data / "powder"),
        "powder two": powder.evaluate_two(data / "powder"),
    }
    page = TEMPLATE.read_text(encoding="utf-8")
    for name, text in tables.items():
        sys.stdout.write(f"{name}\n\n{text}\n\n")
        page = page.replace(f"<!-- {name} -->", text)
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.stderr.write("usage: make_page.py DATA, a folder with the folders rfid, powder and wifi_robot\n")
        sys.exit(2)
    main(Path(sys.argv[1]))
