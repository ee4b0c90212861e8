"""Self-contained HTML pages from Jinja templates, and report.html."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from datetime import datetime
from functools import cache
from io import BytesIO
from itertools import groupby
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure

from pdpatrol.missions.record.finding_pulses import finding_pulses
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.report.figures import STYLE, draw_detected_from, draw_phase_pattern, draw_site_plan
from pdpatrol.missions.report.records import Report, SiteInspections
from pdpatrol.missions.report.wording import (
    ADVICE_LIMITS,
    PULSE_CLASSES,
    advice_of,
    kind_text,
    site_text,
    summary_text,
)

SETTINGS = ("array", "receiver", "estimator", "locating", "pose_sensor", "radio", "robot")
"""Tables of a scenario that describe the measurement; yard and route are on the plan, sources are the truth."""


def render(template: str, **content: object) -> str:
    """Fill a template that extends `base.html`; the date of issue is the current local time.

    Args:
        template: Path of a file in the folder `missions`.
        content: Variables of the template; text is escaped, `Markup` is not.
    """
    issued = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    return _environment().get_template(template).render(issued=issued, **content)


def embed(figure: Figure, description: str) -> Markup:
    """Return a figure as an image element that contains its SVG; the description is for screen readers."""
    buffer = BytesIO()
    with rc_context(STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    data = base64.b64encode(buffer.getvalue()).decode()
    return Markup('<img alt="{}" src="data:image/svg+xml;base64,{}">').format(description, data)


def report_page(log: MissionLog, report: Report) -> str:
    """Return the text of report.html.

    Args:
        log: Log of a finished or killed mission.
        report: Report of that log.
    """
    pulses = finding_pulses(log)
    figures: dict[int, tuple[Markup | None, Markup]] = {}
    for finding in report.findings:
        number, pattern = finding.id, None
        if finding.discharge is not None:
            pattern = embed(draw_phase_pattern(finding.discharge), f"Phase-resolved pattern of finding {number}")
        detected_from = draw_detected_from(log, finding, pulses.get(number))
        figures[number] = pattern, embed(detected_from, f"Poses and bearings from which finding {number} was detected")
    return render(
        "report/report.html",
        title="Partial discharge survey",
        subject=report.scenario if report.seed is None else f"{report.scenario}, mission {report.seed}",
        report=report,
        is_field="field_data" in log.meta,
        field=log.meta.get("field_data", {}),
        summary=summary_text(report),
        plan=embed(draw_site_plan(log, report), "Site plan with the path driven, sites, and findings by their ids"),
        figures=figures,
        inspected=_by_equipment(report.inspection) if report.inspection else [],
        pulse_classes=[(getattr(report.pulses, name), text) for name, text in PULSE_CLASSES.items()],
        settings=_settings(log.meta),
        advice_limits=ADVICE_LIMITS,
        advice_of=advice_of,
    )


def _by_equipment(inspection: SiteInspections) -> list[tuple[str, str]]:
    """Return each piece of equipment with its inspected sites."""
    pieces: list[tuple[str, str]] = []
    for piece, group in groupby(inspection.sites, lambda site: site.name.partition("/")[0]):
        sites = list(group)
        own = [site.name.partition("/")[2] for site in sites if site.state == "inspected"]
        if own:
            pieces.append((piece, f"all {len(own)}" if len(own) == len(sites) > 1 else ", ".join(own)))
    return pieces


def _settings(meta: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings of the measurement, one line for each table, without empty values."""
    known, lines = meta.get("scenario") or meta.get("settings", {}), dict[str, str]()
    for name in SETTINGS:
        values = {
            key: value for key, value in known.get(name, {}).items() if value not in (None, []) and key != "faults"
        }
        texts = [f"{key} {_value_text(value)}" for key, value in values.items() if not isinstance(value, dict)]
        if texts:
            lines[name] = ", ".join(texts)
    return lines


def _value_text(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_value_text, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _breakable(text: str) -> Markup:
    """Allow line breaks after slashes and underscores, and forbid them before percent signs."""
    escaped = str(Markup.escape(text)).replace("/", "/<wbr>").replace("_", "_<wbr>")
    return Markup(escaped.replace(" %", "\N{NO-BREAK SPACE}%").replace("&gt; ", "&gt;\N{NO-BREAK SPACE}"))


def _css_string(text: str) -> Markup:
    """Escape a text for use between quotes in CSS."""
    return Markup("".join(c if c.isascii() and (c.isalnum() or c in " .,_-") else f"\\{ord(c):x} " for c in text))


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("pdpatrol.missions", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "css_string": _css_string,
        "breakable": _breakable,
        "percent": percent,
        "site": site_text,
        "kind": kind_text,
    }
    return environment
