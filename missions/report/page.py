"""Self-contained HTML pages from Jinja templates, and report.html."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from datetime import datetime
from io import BytesIO
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib import rc_context
from matplotlib.figure import Figure

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.report.figures import STYLE, draw_gains, draw_phase_pattern, draw_site_plan
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import (
    ADVICE_LIMITS,
    PULSE_CLASSES,
    SITE_STATES,
    advice_of,
    battery_text,
    kind_text,
    site_text,
    summary_text,
    title_text,
)


def render(template: str, **content: object) -> str:
    """Fill a template that extends `base.html`; the date of issue is the current local time.

    Args:
        template: Path of a file in the folder `missions`.
        content: Variables of the template; text is escaped, `Markup` is not.
    """
    issued = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %z")
    return ENVIRONMENT.get_template(template).render(issued=issued, **content)


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
    patterns = {
        finding.id: embed(draw_phase_pattern(finding.discharge), f"Phase-resolved pattern of finding {finding.id}")
        for finding in report.findings
        if finding.discharge is not None
    }
    return render(
        "report/report.html",
        title="Partial discharge survey",
        subject=title_text(log.meta),
        report=report,
        field=log.meta.get("field_data", {}),
        has_map="scenario" in log.meta,
        summary=summary_text(report),
        battery=battery_text(report),
        plan=embed(draw_site_plan(log, report), "Site plan with the path driven, sites, and findings by their ids"),
        patterns=patterns,
        gains=report.array and embed(draw_gains(report.array), "Gain of the antennas by the angle off boresight"),
        pulse_classes=[(getattr(report.pulses, name), text) for name, text in PULSE_CLASSES.items()],
        settings=_settings(log.meta),
        advice_limits=ADVICE_LIMITS,
        site_states=SITE_STATES,
        advice_of=advice_of,
    )


def _settings(meta: Mapping[str, Any]) -> dict[str, str]:
    """Return the settings of the measurement, one line for each table, without empty values.

    Yard and route are omitted because the plan shows them, and sources because they are the truth.
    """
    known, lines = meta.get("settings") or meta.get("scenario", {}), dict[str, str]()
    for name in ("survey", "array", "receiver", "estimator", "locating", "pose_sensor", "radio", "robot"):
        values = [
            f"{key} {value}"
            for key, value in known.get(name, {}).items()
            if value not in (None, []) and not isinstance(value, dict)
        ]
        if values:
            lines[name] = ", ".join(values)
    return lines


def _breakable(text: str) -> Markup:
    """Allow line breaks after slashes and underscores, and forbid them in percentages such as `> 99 %`."""
    escaped = escape(text.replace("> ", ">\N{NO-BREAK SPACE}").replace(" %", "\N{NO-BREAK SPACE}%"))
    return escaped.replace("/", Markup("/<wbr>")).replace("_", Markup("_<wbr>"))


ENVIRONMENT = Environment(
    loader=PackageLoader("pdpatrol.missions", ""),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.filters |= {"breakable": _breakable, "percent": percent, "site": site_text, "kind": kind_text}
