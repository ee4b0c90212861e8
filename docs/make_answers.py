"""Insert tables of stored sweeps into README.md and answers.md between their marks, and draw the figures.

uv run python docs/make_answers.py          # tables and figures
uv run python docs/make_answers.py --check  # changes nothing; exit status 1 if a table is out of date
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from pdpatrol.missions.sweep.analysis import ALL, LEVELS, summarise_groups
from pdpatrol.missions.sweep.dataset import Dataset, Frame
from pdpatrol.missions.sweep.figures import (
    draw_errors,
    draw_found_over_time,
    draw_over_setting,
    label_of,
    missions_with_sources,
)
from pdpatrol.missions.sweep.tables import cells, coverage_lines, markdown

DOCS = Path(__file__).parent
POLICIES = ("seek", "active", "patrol", "random", "oracle")
BASIC = ("found (%)", "median error (m)", "coverage 2-D 95 %", "time to confirm (s)", "false")
QUESTIONS = {
    "elements": (("array.n_elements",), ("bearing RMSE (deg)", *BASIC)),
    "methods": (("estimator.method",), ("bearing RMSE (deg)", *BASIC)),
    "robots": (("robot.model",), (*BASIC, "path length over shortest", "collisions")),
    "pose": (("pose_sensor.heading_std_deg", "pose_sensor.position_std_m"), BASIC),
    "noise": (("receiver.noise_v",), ("bearing RMSE (deg)", *BASIC)),
    "faults": (("nature.receiver.faults",), ("bearing RMSE (deg)", *BASIC)),
    "speed": (("robot.max_speed_mps",), (*BASIC, "collisions", "missed")),
}
"""Settings that each stored sweep varies, with the one on the axis of its figure first, and columns of its table."""


def rows_of(name: str) -> Frame:
    """Read a stored dataset."""
    return Dataset(DOCS / "results" / name).read()


def settings_table(name: str) -> str:
    """Make a table with a line for each combination of settings, over all yards."""
    keys, headings = QUESTIONS[name]
    lines: list[list[str]] = []
    for summary in summarise_groups(rows_of(name), pool=True):
        settings, texts = json.loads(str(summary["settings"])), cells(summary)
        lines.append([*(label_of(settings[key]) for key in keys), *(texts[heading] for heading in headings)])
    return markdown([*(f"`{key}`" for key in keys), *headings], lines)


def worth_table() -> str:
    """Make a table of the effect of exchanging parts: array, estimator, robot."""
    headings = ("bearing RMSE (deg)", "found (%)", "median error (m)", "time to confirm (s)", "false")
    lines: list[list[str]] = []
    for name in ("elements", "methods", "robots"):
        for summary in summarise_groups(rows_of(name), pool=True):
            settings, texts = json.loads(str(summary["settings"])), cells(summary)
            part = ", ".join(f"`{key.rpartition('.')[2]}` {label_of(settings[key])}" for key in sorted(settings))
            lines.append([part, *(texts[heading] for heading in headings)])
    return markdown(["", *headings], lines)


def policies_table() -> str:
    """Make a table of policies by level: the share of sources found, and below it other figures over all levels."""
    texts = {(s["group"], s["policy"]): cells(s) for s in summarise_groups(rows_of("policies"))}
    levels = [level for level in dict.fromkeys(level for level, _ in texts) if level != "quiet"]
    lines = [[str(level), *(texts[level, policy]["found (%)"] for policy in POLICIES)] for level in levels]
    for heading in ("right site (%)", "median error (m)", "time to confirm (s)", "path length over shortest", "false",
                    "collisions"):  # fmt: skip
        lines.append([f"*all: {heading}*", *(texts[ALL, policy][heading] for policy in POLICIES)])
    return markdown(["found (%)", *POLICIES], lines)


def test_table() -> str:
    """Make a table of the scores of `seek` on the test part of the suite."""
    headings = (
        "found (%)", "within 0.3 m (%)", "median error (m)", "coverage 2-D 95 %", "coverage 3-D 95 %",
        "time to confirm (s)", "false", "wrong live (%)", "certified", "false all-clear",
    )  # fmt: skip
    texts = [cells(summary) for summary in summarise_groups(rows_of("test"))]
    return markdown(["level", *headings], [[each["scenario or level"], *(each[h] for h in headings)] for each in texts])


def accuracy() -> str:
    """Answer in one sentence, and one table of both parts of the suite, how accurate the default policy is."""
    headings = (
        "missions", "found (%)", "within 0.3 m (%)", "median error (m)", "95 % below (m)", "coverage 2-D 95 %",
        "time to confirm (s)", "false",
    )  # fmt: skip
    parts = {"test, on new seeds": "test", "public": "public"}
    texts = {part: cells(summarise_groups(rows_of(name))[-1]) for part, name in parts.items()}
    values = {heading: text.partition(" (")[0] for heading, text in texts["test, on new seeds"].items()}
    sentence = (
        f"**In {values['missions']} simulated missions of the test part, on new seeds, the robot found "
        f"{values['found (%)']} % of the discharges with a median position error of {values['median error (m)']} m, "
        f"and reported {values['false']} discharges that do not exist.**"
    )
    commits = {part: Dataset(DOCS / "results" / name).manifest.commit[:8] for part, name in parts.items()}
    lines = [[part, commits[part], *(each[heading] for heading in headings)] for part, each in texts.items()]
    return f"{sentence}\n\n{markdown(['part of the suite', 'commit', *headings], lines)}"


def levels_table() -> str:
    """Make a table of the scores of `seek` on the public suite."""
    headings = (
        "missions", "found (%)", "within 0.3 m (%)", "median error (m)", "right site (%)", "possibly two (%)",
        "time to confirm (s)", "false", "wrong live (%)", "certified", "false all-clear",
    )  # fmt: skip
    texts = [cells(summary) for summary in summarise_groups(rows_of("public"))]
    return markdown(["level", *headings], [[each["scenario or level"], *(each[h] for h in headings)] for each in texts])


def coverage_level_table() -> str:
    """Make a table of the coverage of each stated share by `seek` on the public suite."""
    texts = [cells(summary) for summary in summarise_groups(rows_of("public"))]
    lines = [[each["scenario or level"], *line] for each in texts for line in coverage_lines(each) if "-" not in line]
    return markdown(["level", "coverage (%)", *(f"{100 * share:g} %" for share in LEVELS)], lines)


def insert(document: str, tables: Mapping[str, str]) -> str:
    """Replace everything between the marks `<!-- NAME -->` and `<!-- end -->` by the table of that name."""
    for name, table in tables.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        document = re.sub(pattern, lambda m, table=table: f"{m[1]}\n{table}\n{m[2]}", document, flags=re.DOTALL)
    return document


def draw() -> None:
    """Draw all figures."""
    names = (*QUESTIONS, "public", "policies")
    missions = {name: missions_with_sources(rows_of(name)) for name in names}
    figures = {name: draw_over_setting(missions[name], keys[0]) for name, (keys, _) in QUESTIONS.items()}
    figures["errors"] = draw_errors(missions["public"])
    figures["found_over_time"] = draw_found_over_time(missions["public"])
    figures["policies"] = draw_found_over_time(missions["policies"])
    (DOCS / "answers").mkdir(exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(DOCS / "answers" / f"{name}.png", dpi=110)


def main() -> None:
    """Update the tables and figures, or check the tables."""
    tables = {
        "accuracy": accuracy(),
        "worth": worth_table(),
        "policies": policies_table(),
        "levels": levels_table(),
        "test": test_table(),
        "coverage": coverage_level_table(),
    }
    tables |= {name: settings_table(name) for name in QUESTIONS}
    outdated: list[str] = []
    for path in (DOCS.parent / "README.md", DOCS / "answers.md"):
        shown = path.read_text(encoding="utf-8")
        updated = insert(shown, tables)
        if updated != shown:
            outdated.append(path.name)
            if "--check" not in sys.argv:
                path.write_text(updated, encoding="utf-8")
    if "--check" not in sys.argv:
        draw()
    elif outdated:
        sys.exit(f"out of date: {', '.join(outdated)}; run docs/make_answers.py")


if __name__ == "__main__":
    main()
