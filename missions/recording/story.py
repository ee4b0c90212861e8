"""What happens, in words: the activity of the robot, its candidates and findings, events, and the closing card."""

from typing import Any

import numpy as np
import rerun as rr

from dirmusic.locating.finding import ellipse95
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.words import name_of, percent
from pdpatrol.missions.recording.motion import LogBin, set_step, time_of
from pdpatrol.missions.recording.scene import labels_3d
from pdpatrol.missions.report.closing_card import closing_card
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.missions.report.records import Report
from pdpatrol.missions.report.wording import phase_text

N_EVENTS = 10
"""Number of the latest events that are listed."""

NEAR_M = 3.0
"""Distance from a site, and size of the 95 % ellipse, up to which a candidate is said to be near the piece."""


def draw_start(stream: rr.RecordingStream, log: MissionLog) -> None:
    """Describe the start of a mission, at time zero."""
    stream.reset_time()
    stream.set_time("sim_time", duration=0.0)
    n_sites = len(log.meta.get("sites", ()))
    known = f"The map has {n_sites} sites where a discharge can occur. " if n_sites else ""
    title = f"### The {'mission' if log.meta['policy'] else 'survey'} starts"
    _draw_text(stream, "mission/status", [title, "", f"{known}Nothing has been detected yet."])
    _draw_text(stream, "mission/events", ["None yet"])


def draw_events(stream: rr.RecordingStream, part: LogBin) -> None:
    """List the latest events at the time of each event of a bin, so that the list never shows the future."""
    steps, stop = np.unique(part.tables["event"]["step"], return_counts=True)
    for step, end in zip(steps.tolist(), (part.first["event"] + np.cumsum(stop)).tolist(), strict=True):
        latest = part.log.table("event", max(end - N_EVENTS, 0), end)
        lines = [
            f"- **{time_of(part.log, at):.0f} s** {text}"
            for at, text in zip(latest["step"].tolist(), latest["text"].tolist(), strict=True)
        ]
        set_step(stream, part.log, step)
        _draw_text(stream, "mission/events", lines[::-1])


def draw_story(stream: rr.RecordingStream, part: LogBin) -> None:
    """Describe the activity of the robot and the candidates and findings at the end of a bin."""
    step = part.tables["step"]
    doing = phase_text(Phase(step["phase"][-1], step["phase_target"][-1]))
    table = findings_at(part.log, part.end, "candidate", "confirmed", "outside")
    lines = [f"### The robot {doing}", ""]
    if not table["id"].size:
        lines += ["Nothing has been detected at a definite place yet."]
    for row in range(table["id"].size)[-8:]:
        state, number, position_m = table["state"][row], table["id"][row], table["position_m"][row]
        size_m = ellipse95(table["covariance_m2"][row, :2, :2]).semi_major_m
        size = f"{size_m:.2f} m" if size_m < 100.0 else "> 100 m"
        exists = percent(table["existence"][row]) + ", possibly two" * bool(table["possibly_two"][row])
        place = "beyond the fence" if state == "outside" else _place_text(part.log, position_m, size_m)
        # not a table, whose columns overlap in the frame after one of them becomes wider
        lines.append(f"- **{name_of(state, number)}** {place}, within {size}, probability {exists}")
    _draw_text(stream, "mission/status", lines)


def _place_text(log: MissionLog, position_m: np.ndarray, size_m: float) -> str:
    """Return the piece of equipment near a position if it is known well enough; else x and y."""
    sites = log.meta.get("sites", {})
    places_m = np.array(list(sites.values())).reshape(-1, 3)
    off_m = np.linalg.norm(places_m[:, :2] - position_m[:2], axis=-1)
    if max(size_m, off_m.min(initial=np.inf)) > NEAR_M:
        return f"around ({position_m[0]:.0f}, {position_m[1]:.0f}) m"
    nearest = list(sites)[int(off_m.argmin())]
    return f"near {nearest.partition('/')[0]}"


def draw_outcome(stream: rr.RecordingStream, report: Report) -> None:
    """Draw the closing card of a mission, and name the findings on the plan by their sites."""
    card = closing_card(report)
    lines = [f"### {card.title}", "", card.remark, ""]
    for row in card.rows:
        lines += [f"**{row.what}**: {row.kind}; {row.where}", "", f"**{row.when}**: {row.action}", ""]
    _draw_text(stream, "mission/status", lines)
    for finding in report.findings:
        label = f"{finding.id} {finding.sites[0].name.rpartition('/')[2] if finding.sites else ''}".strip()
        stream.log(f"world/findings/{finding.id}/label", labels_3d({label: finding.position_m}))


def _draw_text(stream: rr.RecordingStream, path: str, lines: list[Any]) -> None:
    """Show lines of Markdown, in which no number is apart from its percent sign."""
    escaped = "\n".join(lines).replace("<", "&lt;").replace("_", "\\_").replace(" %", "\N{NO-BREAK SPACE}%")
    stream.log(path, rr.TextDocument(escaped, media_type=rr.MediaType.MARKDOWN))
