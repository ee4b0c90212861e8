"""Figures of a finding in words, the same in terminal and pages."""

from __future__ import annotations

from pdpatrol.missions.record.which_site import SiteProbability, in_words, percent
from pdpatrol.missions.report.records import FindingRecord

BEYOND_THE_FENCE = "beyond the fence"
UNKNOWN = "unknown"


def site_in_words(finding: FindingRecord) -> str:
    """Where a finding is, with probabilities; no site of the yard for what lies beyond the fence."""
    if finding.state == "outside":
        return BEYOND_THE_FENCE
    if not finding.sites:
        return "not known"
    return in_words([SiteProbability(site.name, site.probability) for site in finding.sites])


def kind_in_words(finding: FindingRecord) -> str:
    """Kind of discharge with its confidence; of an unknown one there is none to tell."""
    discharge = finding.discharge
    if discharge is None:
        return "not known"
    if discharge.kind == UNKNOWN:
        return UNKNOWN
    return f"{discharge.kind} {percent(discharge.confidence)}"
