"""Tables of findings and candidates for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from pdpatrol.missions.fitted_table import FittedTable
from pdpatrol.missions.report.records import FindingRecord, Report
from pdpatrol.missions.report.wording import existence_text, kind_text, site_text


def findings_table(report: Report) -> FittedTable:
    """Return the table of findings, with their errors where the truth is known."""
    findings = report.findings
    seed = "" if report.seed is None else f", seed {report.seed}"
    confirmed = ["-" if finding.confirmed_s is None else f"{finding.confirmed_s:.1f}" for finding in findings]
    more = {"found\nat (s)": confirmed}
    if report.evaluation is not None:
        errors = {match.finding_id: f"{match.error_m:.2f}" for match in report.evaluation.matches}
        more["error\n(m)"] = [errors.get(finding.id, "false") for finding in findings]
    return _table(findings, f"Findings: {report.scenario}{seed}", more)


def candidates_table(report: Report) -> FittedTable:
    """Return the table of sources that were detected but not confirmed."""
    title = "Not confirmed: detected from too few directions, from too far away, or beyond the fence"
    return _table(report.candidates, title, {"state": [finding.state for finding in report.candidates]})


def _table(findings: Sequence[FindingRecord], title: str, more: dict[str, list[str]]) -> FittedTable:
    columns = {
        "#": [str(finding.id) for finding in findings],
        "x, y, z\n(m)": ["{:.2f}, {:.2f}, {:.2f}".format(*finding.position_m) for finding in findings],
        "95 %\n± (m)": [f"{finding.ellipse95.semi_major_m:.2f}" for finding in findings],
        "exists": [existence_text(finding) for finding in findings],
    }
    if any(finding.sites or finding.state == "outside" for finding in findings):
        columns["site"] = [site_text(finding).replace(", ", "\n") for finding in findings]
    if any(finding.discharge for finding in findings):
        columns["kind"] = [kind_text(finding) for finding in findings]
    columns |= more
    texts = ("site", "kind", "state")
    table = FittedTable(title, {heading: "left" if heading in texts else "right" for heading in columns})
    for row in zip(*columns.values(), strict=True):
        table.add_row(*row)
    return table
