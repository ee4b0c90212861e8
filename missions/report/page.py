"""Self-contained HTML pages from Jinja templates, and report.html."""

from __future__ import annotations

import base64
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Literal

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib import rc_context
from matplotlib.figure import Figure

from pdpatrol.envs.scenario.severity import SeverityTable, default_severity
from pdpatrol.envs.scenario.survey import IS_DAY
from pdpatrol.missions.record.log_contents import survey_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.words import percent
from pdpatrol.missions.report.figures import STYLE, draw_gains, draw_phase_pattern, draw_site_plan
from pdpatrol.missions.report.finding_pictures import draw_finding_pictures
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.settings import settings_in_words
from pdpatrol.missions.report.wording import (
    SITE_STATES,
    battery_text,
    kind_text,
    pulse_classes,
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


def embed(figure: Figure, description: str, kind: Literal["svg", "jpeg"] = "svg") -> Markup:
    """Return a figure as an image element that contains it; the description is for screen readers."""
    buffer = BytesIO()
    with rc_context(STYLE):
        figure.savefig(buffer, format=kind, metadata={"Date": None} if kind == "svg" else None)
    data, media = base64.b64encode(buffer.getvalue()).decode(), {"svg": "svg+xml"}.get(kind, kind)
    return Markup('<img alt="{}" src="data:image/{};base64,{}">').format(description, media, data)


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
    severity = survey_of(log).severity or default_severity()
    return render(
        "report/report.html",
        title="Partial discharge survey",
        subject=", ".join(filter(None, (report.survey.site, title_text(log.meta)))),
        report=report,
        field=log.meta.get("field_data"),
        has_map="scenario" in log.meta,
        summary=summary_text(report),
        battery=battery_text(report),
        urgent_first=sorted(
            report.findings, key=lambda finding: finding.assessment.within_days if finding.assessment else 0
        ),
        severity=severity,
        ranks=severity_ranks(severity),
        plan=embed(draw_site_plan(log, report), "Site plan with the path driven, sites, and findings by their ids"),
        patterns=patterns,
        pictures=_pictures(log, report),
        gains=report.array and embed(draw_gains(report.array), "Gain of the antennas by the angle off boresight"),
        pulse_classes=pulse_classes(report),
        settings=settings_in_words(log),
        site_states=SITE_STATES,
    )


def _pictures(log: MissionLog, report: Report) -> dict[int, Markup]:
    """Return a picture of the equipment at each finding by number; none without a map or OpenGL."""
    try:
        figures = draw_finding_pictures(log, report)
    except RuntimeError:
        return {}
    names = {finding.id: finding.asset.name if finding.asset else "the yard" for finding in report.findings}
    return {
        number: embed(figure, f"{names[number]} with a ring around finding {number}", "jpeg")
        for number, figure in figures.items()
    }


def severity_ranks(table: SeverityTable) -> dict[str, int]:
    """Return the colour of each class, from 0 for the least urgent one to 3 for the most urgent one."""
    n_classes = len(table.classes)
    return {name: 3 if n_classes == 1 else round(3 * k / (n_classes - 1)) for k, name in enumerate(table.classes)}


def _other_page(given: str, page: str) -> Markup:
    """Return a link to a page, given by its path or its folder; text that is a date stays as it is."""
    if IS_DAY.fullmatch(given):
        return escape(given)
    path = Path(given) if given.endswith(".html") else Path(given) / page
    return Markup('<a href="{}">{}</a>').format(path.absolute().as_uri(), f"{path.parent.name}/{path.name}")


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
ENVIRONMENT.filters |= {
    "breakable": _breakable,
    "other_page": _other_page,
    "percent": percent,
    "site": site_text,
    "kind": kind_text,
}
