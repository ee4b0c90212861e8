"""What goes on, in words: what the robot does and why, what it has found, events and phases of the mission."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from dirmusic.locating.finding import ellipse95
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.scenario.locating import LocatingConfig
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.record.which_site import percent
from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import Canvas, Slice, Table
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.words import kind_in_words

FloatArray = NDArray[np.float64]

MOST_LISTED = 8
"""Findings in the table of the status."""

PHASE_WORDS = {
    "patrol": "drives the route",
    "listen": "stands and listens",
    "return to dock": "returns to the dock",
    "back off": "backs off from an obstacle",
    "random": "drives at random",
    "field": "data from the field",
}


def phase_words(phase: Phase) -> str:
    """Describe what a policy is doing."""
    if phase.name == "patrol" and phase.target:
        return f"drives to waypoint {phase.target}"
    if phase.name == "seek" and phase.target:
        return f"goes for candidate {phase.target}"
    return PHASE_WORDS.get(phase.name, str(phase))


class Status:
    """Draws text, phases and events.

    Args:
        canvas: What to draw on.
        meta: Of the log.
    """

    def __init__(self, canvas: Canvas, meta: Mapping[str, Any]) -> None:
        self._canvas = canvas
        self._waypoints = np.array(meta.get("route", {}).get("waypoints_m", ())).reshape(-1, 2)
        self._rules = _rules(meta)
        self._phase: Phase | None = None
        self._phases: dict[Phase, palette.Colour] = {}
        self._findings: dict[int, dict[str, Any]] = {}
        self._text = ""

    def draw(self, part: Slice) -> None:
        """Draw the slice."""
        self._draw_phases(part)
        event = part.event
        if event["step"].size:
            texts, levels = event["text"].tolist(), event["kind"].tolist()
            self._canvas.columns(paths.EVENTS, event["step"], rr.TextLog.columns(text=texts, level=levels))
        steps, texts = list[int](), list[str]()
        finding, row = part.finding, 0
        for end in part.bin_ends.tolist():
            while row < finding["step"].size and finding["step"][row] <= end:
                self._take_up(finding, row)
                row += 1
            row_of_step = end - part.first_step
            phase = Phase(str(part.step["phase"][row_of_step]), int(part.step["phase_target"][row_of_step]))
            text = self._words(phase, part.step["pose"][row_of_step])
            if text != self._text:
                self._text = text
                steps.append(end)
                texts.append(text)
        self._write(np.array(steps, dtype=np.intp), texts)

    def draw_end(self, log: MissionLog, reason: str) -> None:
        """Draw what a mission that is over has found.

        Args:
            log: Of the mission, whole.
            reason: Why it is over.
        """
        report, step = make_report(log, 0.0), np.array([max(log.n_rows("step") - 1, 0)])
        found = report.findings
        what = "Mission" if "scenario" in log.meta else "Survey"
        lines = [f"### {what} over after {report.sim_time_s:.0f} s: {reason}"]
        lines += ["Nothing was confirmed." if not found else "| | site | kind | within |"]
        lines += ["|---|---|---|---|"] if found else []
        for one in found:
            place = f"{one.sites[0].name}, {percent(one.sites[0].probability)}" if one.sites else ""
            size = f"{one.ellipse95.semi_major_m:.2f} m"
            cells = (f"**finding {one.id}**", place, kind_in_words(one), size)
            lines.append(f"| {' | '.join(_escaped(cell) for cell in cells)} |")
            label = [f"finding {one.id}: {place}".rstrip(": ")]
            self._canvas.columns(f"{paths.finding_path(one.id)}/label", step, rr.Points3D.columns(labels=label))
        self._write(step, ["\n\n".join(lines[:1]) + "\n\n" + "\n".join(lines[1:])])

    def _write(self, steps: NDArray[Any], texts: list[str]) -> None:
        kinds = [rr.MediaType.MARKDOWN] * len(texts)
        self._canvas.columns(paths.STATUS, steps, rr.TextDocument.columns(text=texts, media_type=kinds))

    def _take_up(self, finding: Table, row: int) -> None:
        number = int(finding["id"][row])
        self._findings.pop(number, None)
        if finding["state"][row] not in ("dropped", "ghost"):
            self._findings[number] = {name: column[row] for name, column in finding.items()}

    def _words(self, phase: Phase, pose: FloatArray) -> str:
        lines = [f"### {phase_words(phase)[:1].upper()}{_escaped(phase_words(phase)[1:])}", ""]
        number = phase.target
        if phase.name == "patrol" and 0 < number <= len(self._waypoints):
            lines.append(f"{np.linalg.norm(self._waypoints[number - 1] - pose[:2]):.0f} m away.")
        if phase.name == "seek" and number in self._findings:
            lines.append(self._why(self._findings[number], pose))
        if self._findings:
            lines += ["", "| | place (m) | height | 95 % ellipse | aperture |", "|---|---|---|---|---|"]
        for number, one in sorted(self._findings.items())[-MOST_LISTED:]:
            x, y, z = one["position_m"]
            is_finding = one["state"] == "confirmed"
            name = f"**finding {number}**" if is_finding else f"candidate {number}"
            name += ", beyond the fence" if one["state"] == "outside" else ""
            aperture = f"{np.degrees(one['aperture_rad']):.0f}°"
            lines.append(f"| {name} | {x:.1f}, {y:.1f} | {z:.1f} m | {_size(one)} | {aperture} |")
        return "\n".join(lines)

    def _why(self, one: Mapping[str, Any], pose: FloatArray) -> str:
        """Why the robot goes for a candidate: what it needs to be confirmed."""
        away = f"It is {np.linalg.norm(one['position_m'][:2] - pose[:2]):.0f} m away"
        if self._rules is None:
            return f"{away}."
        needs: list[str] = []
        missing_deg = np.degrees(self._rules.confirm_aperture_rad - one["aperture_rad"])
        if missing_deg > 0.0:
            needs.append(f"{np.ceil(missing_deg):.0f}° more aperture")
        if ellipse95(one["covariance_m2"][:2, :2]).semi_major_m > self._rules.confirm_semi_major_m:
            needs.append(f"an ellipse of {self._rules.confirm_semi_major_m:g} m, now {_size(one)}")
        if needs:
            return f"{away}. To be confirmed it needs {' and '.join(needs)}."
        return f"{away}, and known well enough; it must be detected near by, in sight, most of the time."

    def _draw_phases(self, part: Slice) -> None:
        steps, states = list[int](), list[Phase]()
        phases = map(Phase, part.step["phase"].tolist(), part.step["phase_target"].tolist())
        for step, phase in zip(part.steps.tolist(), phases, strict=True):
            if phase != self._phase:
                self._phase = phase
                steps.append(step)
                states.append(phase)
        if new := [phase for phase in dict.fromkeys(states) if phase not in self._phases]:
            self._phases |= {phase: palette.PHASES.get(phase.name, palette.OTHER_PHASE) for phase in new}
            words = [phase_words(phase) for phase in self._phases]
            colours = list(self._phases.values())
            style = rr.StateConfiguration(values=[str(phase) for phase in self._phases], labels=words, colors=colours)
            self._canvas.still(paths.PHASE, style)
        self._canvas.columns(
            paths.PHASE, np.array(steps), rr.StateChange.columns(state=[str(phase) for phase in states])
        )


def _rules(meta: Mapping[str, Any]) -> LocatingRules | None:
    """By which candidates are confirmed; None where nobody knows."""
    given = meta.get("scenario", {}).get("locating")
    if given is None or given.get("locator") is not None:
        return None
    return LocatingConfig.model_validate({**given, "calibration": None}).rules()


def _size(one: Mapping[str, Any]) -> str:
    """Longer half-axis of the 95 % ellipse, two digits."""
    semi_major_m = ellipse95(one["covariance_m2"][:2, :2]).semi_major_m
    return (
        f"{semi_major_m:.2f} m" if semi_major_m < 1.0 else f"{semi_major_m:.2g} m" if semi_major_m < 100 else "> 100 m"
    )


def _escaped(text: str) -> str:
    """Foreign text as plain text in Markdown; bold of our own stays."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("_", "\\_")
