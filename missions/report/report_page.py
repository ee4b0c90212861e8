"""report.html: the survey report of a mission that an operator files, one page for A4."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, NamedTuple

from markupsafe import Markup

from pdpatrol.missions.record.finding_pulses import FindingPulses, finding_pulses
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.report.advice import LIMITS, Advice, advice_for
from pdpatrol.missions.report.inspection import Inspected
from pdpatrol.missions.report.page import inline_svg, render
from pdpatrol.missions.report.pictures.finding_figures import draw_detected_from, draw_phase_pattern
from pdpatrol.missions.report.pictures.site_plan import draw_site_plan
from pdpatrol.missions.report.pulse_counts import WORDS
from pdpatrol.missions.report.records import FindingRecord, Report
from pdpatrol.missions.report.words import UNKNOWN, kind_in_words, site_in_words

SETTINGS = ("array", "receiver", "estimator", "locating", "pose_sensor", "radio", "robot")
"""Tables of a scenario that say how a mission was measured; yard and route are on the plan, sources are the truth."""


class FindingSection(NamedTuple):
    """What the page shows of one finding.

    Attributes:
        finding: As of the report.
        site: Where it is, in words.
        kind: Kind with its confidence, in words.
        phase_pattern: The picture; None without mains phase.
        detected_from: The picture.
        advice: What to do about it.
    """

    finding: FindingRecord
    site: str
    kind: str
    phase_pattern: Markup | None
    detected_from: Markup
    advice: Advice


def report_page(log: MissionLog, report: Report, inspected: Inspected | None) -> str:
    """The page of a mission.

    Args:
        log: The mission, whole or cut short.
        report: As `make_report` made it of the log.
        inspected: As `inspected_sites` made it of the log.
    """
    pulses = finding_pulses(log)
    plan = draw_site_plan(log, report, inspected)
    return render(
        "report.html",
        title="Partial discharge survey",
        subject=report.scenario if report.seed is None else f"{report.scenario}, mission {report.seed}",
        report=report,
        is_field="field_data" in log.meta,
        field=log.meta.get("field_data", {}),
        summary=summary(report),
        plan=inline_svg(plan, "plan", "Site plan with the way driven, sites, and findings by their ids"),
        sections=[_section(log, finding, pulses.get(finding.id)) for finding in report.findings],
        candidates=[(finding, site_in_words(finding), kind_in_words(finding)) for finding in report.candidates],
        inspected=inspected,
        inspected_pieces=_by_piece(inspected) if inspected else [],
        fates=[(getattr(report.pulses, fate), words) for fate, words in FATES.items()],
        settings=_settings(log.meta),
        limits=LIMITS,
        percent=percent,
    )


FATES = {**WORDS, "of_findings": "of the findings and candidates"}
"""What became of pulses, in words for a table."""


def summary(report: Report) -> str:
    """What was found, and what that is worth, in a sentence or two."""
    found = [_in_a_phrase(finding) for finding in report.findings]
    if not found:
        text = "No discharge was located."
    elif len(found) == 1:
        text = f"One discharge was located: {found[0]}."
    else:
        text = f"{_count(len(found))} discharges were located: {'; '.join(found)}."
    outside = sum(candidate.state == "outside" for candidate in report.candidates)
    if outside:
        text += f" {_count(outside)} {'lies' if outside == 1 else 'lie'} beyond the fence."
    if len(report.candidates) > outside:
        text += f" {_count(len(report.candidates) - outside)} more could not be confirmed."
    if missed := report.waypoints.missed:
        n_all = len(missed) + len(report.waypoints.visited)
        text += f" The tour is not whole: {len(missed)} of {n_all} waypoints were missed."
    return f"{text} {coverage(report)}"


def _count(number: int) -> str:
    """The number as a sentence begins with it."""
    words = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine")
    return words[number] if number < len(words) else str(number)


def coverage(report: Report) -> str:
    """How many sites were inspected, and to what level."""
    inspection = report.inspection
    if inspection is None:
        return "There is no map with sites: what was not inspected is not told."
    n_inspected, n_narrow = len(inspection.inspected), len(inspection.heard_narrowly)
    n_sites = n_inspected + n_narrow + len(inspection.not_inspected)
    return (
        f"{n_inspected} of {n_sites} sites were inspected: a discharge of {inspection.level_db:.0f} dBV at 1 m or more "
        "would have been heard there and located."
    )


def _in_a_phrase(finding: FindingRecord) -> str:
    discharge = finding.discharge
    if discharge is None:
        kind = "of a kind that is not known"
    elif discharge.kind == UNKNOWN:
        kind = "its kind unlike any known one"
    else:
        kind = f"{discharge.kind} ({percent(discharge.confidence)})"
    x, y, z = finding.position_m
    site = finding.sites[0] if finding.sites else None
    where = f"at {site.name} ({percent(site.probability)})" if site else f"at ({x:.2f}, {y:.2f}, {z:.2f}) m"
    return f"finding {finding.id} {where}, {kind}"


def _section(log: MissionLog, finding: FindingRecord, pulses: FindingPulses | None) -> FindingSection:
    number, phase_pattern = finding.id, None
    if finding.discharge is not None:
        label = f"Phase-resolved pattern of finding {number}"
        phase_pattern = inline_svg(draw_phase_pattern(finding.discharge), f"phase-{number}", label)
    seen = inline_svg(
        draw_detected_from(log, finding, pulses),
        f"from-{number}",
        f"Poses and bearings from which finding {number} was detected",
    )
    words = site_in_words(finding), kind_in_words(finding)
    return FindingSection(finding, *words, phase_pattern, seen, advice_for(finding))


def _by_piece(inspected: Inspected) -> list[tuple[str, list[str], bool]]:
    """Pieces of equipment with the sites on each that were inspected, and whether these are all of them."""
    pieces: dict[str, list[str]] = {}
    for name in inspected.names("inspected"):
        pieces.setdefault(name.partition("/")[0], []).append(name.partition("/")[2])
    n_sites = Counter(site.name.partition("/")[0] for site in inspected.sites)
    return [(piece, names, len(names) == n_sites[piece]) for piece, names in pieces.items()]


def _settings(meta: Mapping[str, Any]) -> dict[str, str]:
    """Settings of the measurement, one line for each table, without what is left at none."""
    known = meta.get("scenario") or meta.get("settings", {})
    tables = {key: known.get(key, {}) for key in SETTINGS}
    lines = {key: _in_a_line(table) for key, table in tables.items()}
    return {key: line for key, line in lines.items() if line}


def _in_a_line(table: Mapping[str, Any]) -> str:
    given = {key: value for key, value in table.items() if value not in (None, [], {}) and key != "faults"}
    return ", ".join(f"{key} {_shown(value)}" for key, value in given.items() if not isinstance(value, dict))


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return str(value)
