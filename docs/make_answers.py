"""Put what stored sweeps came to into README.md and answers.md: tables between their marks, and pictures.

uv run python docs/make_answers.py          # tables and pictures
uv run python docs/make_answers.py --check  # changes nothing; exit status 1 if a table is not what it should be
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa

from missions.sweep.dataset import Dataset, read_all
from missions.sweep.results.figures import draw_errors, draw_found_over_time, groups
from missions.sweep.results.summary import summarise_groups
from missions.sweep.results.tables import HEADINGS, cells

DOCS = Path(__file__).parent
STORED = DOCS / "results"
WIDTH_DPI = 110


def rows_of(*names: str) -> pa.Table:
    """Rows of stored datasets."""
    return read_all([Dataset(STORED / name) for name in names])


def table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """As Markdown."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (headings, ["---"] * len(headings), *lines))


def levels_table() -> str:
    """All figures of `seek` on the whole public suite."""
    headings = ("found (%)", "right site (%)", "median error (m)", "95 % below (m)", "in ellipse (%)",
                "time to confirm (s)", "way over shortest", "OSPA (m)", "false", "contacts", "missed")  # fmt: skip
    lines: list[list[str]] = []
    for summary in summarise_groups(rows_of("public")):
        named = dict(zip(HEADINGS, cells(summary), strict=True))
        lines.append([summary.group, named["missions"], *(named[each] for each in headings)])
    return table(["level", "missions", *headings], lines)


def texts() -> dict[str, str]:
    """All that is put between marks, by their names."""
    return {"levels": levels_table()}


def filled(text: str, made: Mapping[str, str]) -> str:
    """A document with the texts between its marks `<!-- NAME -->` and `<!-- end -->`."""
    for name, content in made.items():
        text = re.sub(
            rf"(<!-- {name} -->\n).*?(<!-- end -->)", lambda m, c=content: f"{m[1]}\n{c}\n{m[2]}", text, flags=re.DOTALL
        )
    return text


def draw() -> None:
    """All pictures."""
    folder = DOCS / "answers"
    folder.mkdir(exist_ok=True)
    public = [row for row in rows_of("public").to_pylist() if row["n_sources"]]
    draw_errors(groups(public)).savefig(folder / "errors.png", dpi=WIDTH_DPI)
    draw_found_over_time(groups(public)).savefig(folder / "found_over_time.png", dpi=WIDTH_DPI)


def main() -> None:
    """Make, or check, what is shown."""
    made, wrong = texts(), list[str]()
    for path in (DOCS.parent / "README.md", DOCS / "answers.md"):
        shown = path.read_text(encoding="utf-8")
        if filled(shown, made) != shown:
            wrong.append(path.name)
            if "--check" not in sys.argv:
                path.write_text(filled(shown, made), encoding="utf-8")
    if "--check" not in sys.argv:
        draw()
    elif wrong:
        sys.exit(f"not as stored: {', '.join(wrong)}; run docs/make_answers.py")


if __name__ == "__main__":
    main()
