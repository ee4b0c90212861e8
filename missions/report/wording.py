"""Sentences of a report: sites, kinds, pulses, summary, and recommended actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.which_site import in_words, percent
from pdpatrol.missions.report.records import FindingRecord, Report, SiteInspections

PULSE_CLASSES = {
    "of_findings": "associated with findings and candidates",
    "unexplained": "of no finding",
    "rejected": "rejected: clipped, or too weak for a bearing",
}
"""Description of each field of `PulseCounts` except the total."""

SITE_STATES = {
    "inspected": "inspected",
    "finding": "near a finding",
    "unexplained": "unexplained pulses from there",
    "not_inspected": "not inspected",
}
"""Description of each state of a site."""

TIME_FRAMES = ("at the next planned inspection", "within three months", "within one month", "within one week")
"""Time frames of actions, by urgency. Assumed."""


class Advice(NamedTuple):
    """Recommended action for a kind of discharge.

    Attributes:
        meaning: Usual cause of such a discharge.
        action: Action on site.
        urgency: Index into `TIME_FRAMES` for a discharge that is not strong.
    """

    meaning: str
    action: str
    urgency: int


ADVICE = {
    "corona": Advice(
        "Corona in air starts at sharp edges and unshielded fittings; outdoors it is mostly harmless by itself.",
        "Inspect the place with an ultraviolet camera and look for loose or missing shielding.",
        0,
    ),
    "surface": Advice(
        "Surface discharges come with pollution, moisture or cracks on an insulator, and grow in wet weather.",
        "Inspect the insulator surface, clean it if it is polluted, and repeat the measurement in dry and wet weather.",
        1,
    ),
    "void": Advice(
        "Discharges in voids lie inside solid or liquid insulation and can erode it without visible signs.",
        "Confirm by a second method on the asset itself: IEC 60270, or dissolved gas analysis where there is oil.",
        2,
    ),
    "floating": Advice(
        "Metal at floating potential is usually a loose or broken contact; its discharges are strong and regular.",
        "Check fasteners, shields and bonds at this place as soon as an outage allows, and measure again until then.",
        2,
    ),
    "unknown": Advice(
        "The kind of discharge is too uncertain to assess.",
        "Repeat the measurement near this place for longer, and inspect it with an ultraviolet camera.",
        1,
    ),
}
"""Actions by kind of discharge. Assumed; they follow common practice."""

ADVICE_LIMITS = (
    "Levels are received field strengths, not apparent charge: no standard sets limits for them. The rules are "
    "assumptions and replace neither the manufacturer's advice nor the judgement of an insulation engineer."
)

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
    "field": "field data",
}
"""Descriptions of the phases of built-in policies."""


def advice_of(finding: FindingRecord) -> tuple[Advice, str, str]:
    """Return the recommended action for a finding, its time frame, and the rule that led to them.

    The rule of a kind applies at a confidence of 80 % or more. A level of at least one volt at 1 m raises the urgency
    by one step. Both are assumed.
    """
    discharge, strength = finding.discharge, finding.strength
    kind = discharge.kind if discharge and discharge.confidence >= 0.8 else "unknown"
    is_strong = strength is not None and strength.level_db is not None and strength.level_db >= 0.0
    known = "uncertain" if kind == "unknown" else f"{kind} with a confidence of at least 80 %"
    rule = f"Rule: kind {known}; level {'at or above' if is_strong else 'below'} 0 dBV at 1 m."
    return ADVICE[kind], TIME_FRAMES[ADVICE[kind].urgency + is_strong], rule


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
