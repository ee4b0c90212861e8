"""Findings and candidates as tables for a terminal; the numbers are the ids of log, report and recording."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from missions.record.which_site import SiteProbability, in_words


def findings_table(report: dict[str, Any]) -> Table:
    """The findings, for a terminal."""
    seed = "" if report["seed"] is None else f", seed {report['seed']}"
    sources = report.get("evaluation", {}).get("sources")
    columns: dict[str, Callable[[dict[str, Any]], str]] = {"fixed\n(s)": lambda finding: f"{finding['fixed_s']:.1f}"}
    if sources is not None:
        columns["error\n(m)"] = lambda finding: _error_of(finding, sources)
    return _table_of(report["findings"], f"Findings: {report['scenario']}{seed}", columns)


def candidates_table(report: dict[str, Any]) -> Table:
    """What was detected but not confirmed, for a terminal."""
    title = "Not confirmed: detected from too few sides, from too far away, or beyond the fence"
    return _table_of(report["candidates"], title, {"state": lambda finding: finding["state"]})


def _table_of(findings: list[dict[str, Any]], title: str, more: dict[str, Callable[[dict[str, Any]], str]]) -> Table:
    """Id, position and longer half-axis of the 95 % ellipse of each, site and kind where they are known, and more."""
    columns: dict[str, Callable[[dict[str, Any]], str]] = {
        "x, y, z (m)": lambda finding: "{:.2f}, {:.2f}, {:.2f}".format(*finding["position_m"]),
        "95 %\n(m)": lambda finding: "{semi_major_m:.2f}".format(**finding["ellipse95"]),
    }
    if any(finding["sites"] for finding in findings):
        columns["site"] = _site_of
    if any(finding["discharge"] for finding in findings):
        columns["kind"] = _kind_of
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("#")
    columns |= more
    for heading in columns:
        is_word = heading in ("site", "kind", "state")
        table.add_column(
            heading,
            justify="left" if is_word else "right",
            overflow="fold",
            no_wrap=heading in ("x, y, z (m)", "site", "kind"),
        )
    for finding in findings:
        table.add_row(str(finding["id"]), *(cell(finding) for cell in columns.values()))
    return table


def _site_of(finding: dict[str, Any]) -> str:
    """Piece, site and other site below each other, so that all columns fit into 80 characters."""
    words = in_words([SiteProbability(**place) for place in finding["sites"]])
    return words.replace("/", "/\n", 1).replace(", ", "\n")


def _kind_of(finding: dict[str, Any]) -> str:
    discharge = finding["discharge"]
    return f"{discharge['kind']}\n{100 * discharge['confidence']:.0f} %" if discharge else "-"


def _error_of(finding: dict[str, Any], sources: list[dict[str, Any]]) -> str:
    """Distance to the source that the finding is paired with."""
    if not sources:
        return "-"
    return next((f"{source['error_m']:.2f}" for source in sources if source["finding_id"] == finding["id"]), "false")
