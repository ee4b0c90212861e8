"""Sentences of a report: sites, kinds, pulses and summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.which_site import in_words
from pdpatrol.missions.record.words import percent
from pdpatrol.missions.report.records import FindingRecord, Report, SiteInspections

SITE_STATES = {
    "inspected": "inspected",
    "finding": "near a finding",
    "unexplained": "unexplained pulses from there",
    "not_inspected": "not inspected",
}
"""Description of each state of a site."""

PHASES = {
    "patrol": "drives the route",
    "seek": "approaches a candidate",
    "listen": "stands and listens",
    "return to dock": "returns to the dock",
    "return to charge": "returns to the dock to charge",
    "charge": "charges at the dock",
    "back off": "backs off from an obstacle",
    "give way": "gives way to what moves",
    "random": "drives at random",
    "field": "records field data",
}
"""Descriptions of the phases of built-in policies."""


def site_text(finding: FindingRecord) -> str:
    """Return the most probable sites of a finding with their probabilities."""
    if finding.state == "outside":
        return "beyond the fence"
    if not finding.sites:
        return "not known"
    return in_words({site.name: site.probability for site in finding.sites})


def kind_text(finding: FindingRecord) -> str:
    """Return the kind of discharge with its confidence; an unknown kind has none."""
    discharge = finding.discharge
    if discharge is None:
        return "not known"
    return discharge.kind if discharge.kind == "unknown" else f"{discharge.kind} {percent(discharge.confidence)}"


def existence_text(finding: FindingRecord) -> str:
    """Return the probability that a source exists, and whether it is possibly two."""
    return percent(finding.existence) + ", possibly two" * finding.possibly_two


def pulse_classes(report: Report) -> list[tuple[int | None, str]]:
    """Return the number and the description of each class of pulses."""
    kinds = {
        "confirmed findings": bool(report.findings),
        "candidates": any(candidate.state == "candidate" for candidate in report.candidates),
        "sources beyond the fence": any(candidate.state == "outside" for candidate in report.candidates),
    }
    counts, of_what = report.pulses, " or ".join(kind for kind, exists in kinds.items() if exists)
    return [
        (counts.of_findings, f"associated with {of_what or 'findings'}"),
        (counts.unexplained, "of no finding"),
        (counts.rejected, "rejected: clipped, or too weak for a bearing"),
    ]


def title_text(meta: Mapping[str, Any]) -> str:
    """Return scenario, seed and policy of a mission, as far as they are known."""
    seed = None if meta["seed"] is None else f"seed {meta['seed']}"
    return ", ".join(filter(None, (meta["name"], seed, meta["policy"])))


def outcome_text(report: Report) -> str:
    """Return how many sources were found, or how many findings there are if the truth is not known."""
    if report.evaluation is None:
        return f"{len(report.findings)} finding{'' if len(report.findings) == 1 else 's'}"
    return f"found {len(report.evaluation.matches)} of {len(report.evaluation.sources)}"


def phase_text(phase: Phase) -> str:
    """Describe the activity of a policy."""
    towards = {"patrol": "drives to waypoint", "seek": "approaches candidate"}
    if phase.target and phase.name in towards:
        return f"{towards[phase.name]} {phase.target}"
    return PHASES.get(phase.name, str(phase))


def battery_text(report: Report) -> str | None:
    """Return the state of charge at the end, and the charges; None if it is not known."""
    if report.battery_left is None:
        return None
    charges = ", ".join(
        f"at {charge.arrived_s:.0f} s with {100.0 * charge.battery_left:.0f} % left"
        for charge in report.charges
        if charge.arrived_s is not None and charge.battery_left is not None
    )
    return f"{100.0 * report.battery_left:.1f} % of the battery left" + (f", charged {charges}" if charges else "")


def inspection_text(inspection: SiteInspections) -> str:
    """Return the number of inspected sites and the discharges that are excluded there, without a full stop."""
    n_inspected, plural = len(inspection.names("inspected")), "" if inspection.rate_hz == 1.0 else "s"
    return (
        f"{n_inspected} of {len(inspection.sites)} sites were inspected: a discharge of {inspection.level_db:.0f} dBV "
        f"at 1 m and {inspection.rate_hz:g} pulse{plural} per second or more is excluded there"
    )


def summary_text(report: Report) -> str:
    """Summarise findings and inspected sites in a few sentences."""
    n_found, n_missed = len(report.findings), len(report.waypoints.missed)
    n_outside = sum(candidate.state == "outside" for candidate in report.candidates)
    n_open = len(report.candidates) - n_outside
    sentences = [f"{n_found or 'No'} discharge{' was' if n_found < 2 else 's were'} located."]
    if n_double := sum(finding.possibly_two for finding in report.findings):
        sentences.append(f"Possibly two sources close to each other: {n_double}.")
    if n_outside:
        sentences.append(f"Sources beyond the fence: {n_outside}.")
    if n_open:
        sentences.append(f"Sources that could not be confirmed: {n_open}.")
    if n_missed:
        n_waypoints = n_missed + len(report.waypoints.visited)
        sentences.append(f"The tour is incomplete: {n_missed} of {n_waypoints} waypoints were missed.")
    if report.inspection is None:
        sentences.append("Without a map of the sites, the report cannot state what was not inspected.")
    else:
        sentences.append(f"{inspection_text(report.inspection)}.")
    return " ".join(sentences)
