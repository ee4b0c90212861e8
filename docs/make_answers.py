"""Put what stored sweeps came to into README.md and answers.md: tables between their marks, and pictures.

uv run python docs/make_answers.py          # tables and pictures
uv run python docs/make_answers.py --check  # changes nothing; exit status 1 if a table is not what it should be
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from pdpatrol.missions.sweep.dataset import Dataset, read_all
from pdpatrol.missions.sweep.results.figures import (
    draw_errors,
    draw_found_over_time,
    draw_over_setting,
    groups,
    label_of,
)
from pdpatrol.missions.sweep.results.summary import ALL, GroupSummary, summarise_groups
from pdpatrol.missions.sweep.results.tables import HEADINGS, cells

DOCS = Path(__file__).parent
STORED = DOCS / "results"
POLICIES = ("seek", "active", "patrol", "random", "oracle")
WIDTH_DPI = 110
RENAMED = {"locating.fix": "locating.solver"}
"""Settings whose names have changed since the datasets were stored."""


class Answer(NamedTuple):
    """A question that a sweep answers.

    Attributes:
        name: Of its dataset, its marks and its picture.
        keys: Settings that are varied; the first is the axis of the picture.
        headings: Figures that its table shows, of `pdpatrol.missions.sweep.results.tables.HEADINGS`.
    """

    name: str
    keys: tuple[str, ...]
    headings: tuple[str, ...]


USUAL = ("found (%)", "median error (m)", "in ellipse (%)", "time to confirm (s)", "false")
ANSWERS = (
    Answer("elements", ("array.n_elements",), ("bearing RMSE (deg)", *USUAL)),
    Answer("methods", ("estimator.method", "locating.solver"), ("bearing RMSE (deg)", *USUAL)),
    Answer("robots", ("robot.model",), (*USUAL, "way over shortest", "contacts")),
    Answer("pose", ("pose_sensor.heading_std_deg", "pose_sensor.position_std_m"), USUAL),
    Answer("noise", ("receiver.noise_v",), ("bearing RMSE (deg)", *USUAL)),
    Answer("faults", ("receiver.faults",), ("bearing RMSE (deg)", *USUAL)),
    Answer("speed", ("robot.max_speed_mps",), (*USUAL, "contacts", "missed")),
)


def rows_of(*names: str) -> pa.Table:
    """Read the rows of stored datasets, with settings under their present names."""
    rows = read_all([Dataset(STORED / name) for name in names])
    column = rows.schema.get_field_index("settings")
    for old, new in RENAMED.items():
        rows = rows.set_column(column, "settings", pc.replace_substring(rows["settings"], old, new))
    return rows


def as_one_group(rows: pa.Table) -> pa.Table:
    """The rows as if all yards were one scenario, so that a setting is summed up over all of them."""
    for column in ("level", "scenario"):
        rows = rows.set_column(rows.schema.get_field_index(column), column, pa.array([""] * rows.num_rows))
    return rows


def table(headings: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """As Markdown."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (headings, ["---"] * len(headings), *lines))


def answer_table(answer: Answer) -> str:
    """A line for each combination of settings."""
    lines: list[list[str]] = []
    for summary in summarise_groups(as_one_group(rows_of(answer.name))):
        settings: Mapping[str, Any] = json.loads(summary.settings)
        named = dict(zip(HEADINGS, cells(summary), strict=True))
        lines.append([*(label_of(settings[key]) for key in answer.keys), *(named[each] for each in answer.headings)])
    return table([*(f"`{key}`" for key in answer.keys), *answer.headings], lines)


def worth_table() -> str:
    """What each part that can be swapped is worth: the sweeps over them, one below the other."""
    headings = ("bearing RMSE (deg)", "found (%)", "median error (m)", "time to confirm (s)", "false")
    lines: list[list[str]] = []
    for name in ("elements", "methods", "robots"):
        for summary in summarise_groups(as_one_group(rows_of(name))):
            settings: Mapping[str, Any] = json.loads(summary.settings)
            named = dict(zip(HEADINGS, cells(summary), strict=True))
            value = ", ".join(f"`{key.rpartition('.')[2]}` {label_of(settings[key])}" for key in sorted(settings))
            lines.append([value, *(named[each] for each in headings)])
    return table(["", *headings], lines)


def policies_table() -> str:
    """Policies by levels: share found with its interval."""
    rows = rows_of("policies")
    by = {(summary.group, summary.policy): summary for summary in summarise_groups(rows)}
    levels = list(dict.fromkeys(rows["level"].to_pylist()))
    lines = [
        [level, *(found(by[level, policy]) for policy in POLICIES)] for level in [*levels, ALL] if level != "quiet"
    ]
    more = {
        "right site (%)": "right site (%)",
        "median error (m)": "median error (m)",
        "time to confirm (s)": "time to confirm (s)",
        "way over shortest": "way over shortest",
        "false findings": "false",
        "contacts": "contacts",
    }
    for title, heading in more.items():
        values = [dict(zip(HEADINGS, cells(by[ALL, policy]), strict=True))[heading] for policy in POLICIES]
        lines.append([f"*all: {title}*", *values])
    return table(["found (%)", *POLICIES], lines)


def found(summary: GroupSummary) -> str:
    """The share found, with its interval."""
    return dict(zip(HEADINGS, cells(summary), strict=True))["found (%)"]


def levels_table() -> str:
    """All figures of `seek` on the whole public suite."""
    headings = (*USUAL[:1], "right site (%)", "median error (m)", "95 % below (m)", "in ellipse (%)",
                "time to confirm (s)", "way over shortest", "OSPA (m)", "false", "contacts", "missed")  # fmt: skip
    lines: list[list[str]] = []
    for summary in summarise_groups(rows_of("public")):
        named = dict(zip(HEADINGS, cells(summary), strict=True))
        lines.append([summary.group, named["missions"], *(named[each] for each in headings)])
    return table(["level", "missions", *headings], lines)


def texts() -> dict[str, str]:
    """All that is put between marks, by their names."""
    made = {"worth": worth_table, "policies": policies_table, "levels": levels_table}
    return {name: make() for name, make in made.items()} | {each.name: answer_table(each) for each in ANSWERS}


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
    for answer in ANSWERS:
        figure = draw_over_setting(rows_of(answer.name).to_pylist(), answer.keys[0])
        figure.savefig(folder / f"{answer.name}.png", dpi=WIDTH_DPI)
    public = [row for row in rows_of("public").to_pylist() if row["n_sources"]]
    draw_errors(groups(public)).savefig(folder / "errors.png", dpi=WIDTH_DPI)
    draw_found_over_time(groups(public)).savefig(folder / "found_over_time.png", dpi=WIDTH_DPI)
    policies = [row for row in as_one_group(rows_of("policies")).to_pylist() if row["n_sources"]]
    draw_found_over_time(groups(policies)).savefig(folder / "policies.png", dpi=WIDTH_DPI)


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
