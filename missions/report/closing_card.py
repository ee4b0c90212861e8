"""Closing card of a mission: place, kind, severity and due date of each finding."""

from typing import NamedTuple

from pdpatrol.missions.report.records import FindingRecord, Report
from pdpatrol.missions.report.wording import existence_text, kind_text, site_text


class ClosingRow(NamedTuple):
    """One finding.

    Attributes:
        what: Number and probability that a source exists.
        where: Most probable sites, or the position if these are not known, and the size of the 95 % ellipse.
        kind: Kind of discharge.
        when: Class of severity, and the date or time by which to act.
        action: Recommended action.
    """

    what: str
    where: str
    kind: str
    when: str
    action: str


class ClosingCard(NamedTuple):
    """Summary at the end of a mission.

    Attributes:
        title: Number of findings.
        rows: Findings.
        remark: Number of open candidates, and the end of the mission.
    """

    title: str
    rows: tuple[ClosingRow, ...]
    remark: str


def closing_card(report: Report) -> ClosingCard:
    """Make the closing card of a mission."""
    n_found = len(report.findings)
    title = f"{n_found} discharge{'' if n_found == 1 else 's'} located" if n_found else "No discharge was confirmed"
    n_outside = sum(candidate.state == "outside" for candidate in report.candidates)
    n_open = len(report.candidates) - n_outside
    remarks = [f"The {'mission' if report.policy else 'survey'} ended after {report.sim_time_s:.0f} s"]
    remarks[0] += f": {report.ending or 'killed'}."
    remarks += [f"Candidates that could not be confirmed: {n_open}."] * bool(n_open)
    remarks += [f"Sources beyond the fence: {n_outside}."] * bool(n_outside)
    return ClosingCard(title, tuple(_row(finding) for finding in report.findings), " ".join(remarks))


def _row(finding: FindingRecord) -> ClosingRow:
    advice = finding.assessment
    assert advice is not None  # of a confirmed finding
    x_m, y_m, _ = finding.position_m
    where = site_text(finding) if finding.sites else f"at ({x_m:.2f}, {y_m:.2f}) m"
    due = f"by {advice.due}" if advice.due else f"within {advice.within_days} days"
    return ClosingRow(
        what=f"Finding {finding.id}, probability {existence_text(finding)}",
        where=f"{where}, 95 % within {finding.ellipse95.semi_major_m:.2f} m",
        kind=f"kind {kind_text(finding)}",
        when=f"Severity {advice.severity}, act {due}",
        action=advice.action,
    )
