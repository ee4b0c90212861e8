"""Locate discharges while the records of a survey arrive."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from dirmusic import Finding, PulseBatch
from dirmusic.locating.rules import LocatingRules
from pdpatrol.missions.field.field_data import FieldData, steps_of, strength_columns, survey_rows
from pdpatrol.missions.field.input_table import InputTable
from pdpatrol.missions.field.line_sources import Report
from pdpatrol.missions.field.locate_field_data import FieldLocator
from pdpatrol.missions.field.record_table import RecordTable
from pdpatrol.missions.field.survey import SurveyOptions
from pdpatrol.missions.record.words import percent

RECEIVED = "received.csv"
"""Name of the table of received records in the output folder."""

MARGIN_M = 40.0
"""Margin of the map around the first poses. Assumed; the map is only shown, and made anew at the end."""

MOVED_SHARE = 0.5
"""Change of the position, and of the longer half-axis, as a share of the half-axis, from which on a finding is printed
again (assumed)."""

FINDING_EVENTS = ("candidate", "confirmed", "outside", "dropped")
"""Events that the lines on findings state as well."""


class SurveyFollower:
    """Locates with the records of a survey as they arrive, and stores them.

    The findings are made as in a mission: by the data so far, fitted once per second of the survey, with a faulty
    channel left out from its discovery on. Rows within 1 s, 0.1 m and 2 degrees are pooled. Records that were stored
    before are fitted once per 5000, so that a survey that is continued is soon up to date. At the end, `locate` of the
    stored table gives the final findings.

    Args:
        folder: Folder with the table of received records, which is continued if it exists.
        source: Name of the source of the records.
        survey: Array, poses, yard and date.
        report: Called with a line on each record that is left out, and on gaps.

    Attributes:
        path: Table of received records.
        n_records: Number of records in it.

    Raises:
        InputFileError: If the header, or an option of the survey, cannot be used; also in later calls.
    """

    def __init__(self, folder: Path, source: Path, survey: SurveyOptions, report: Report) -> None:
        self.path, self.n_records = folder / RECEIVED, 0
        self._source, self._survey = source, survey
        self._table = RecordTable(self.path, source, survey.noise_v, report)
        self._locator: FieldLocator | None = None
        self._n_events = 0
        self._printed: dict[int, Finding] = {}
        for table in self._table.stored():
            self._locate(table, is_past=True)

    @property
    def locator(self) -> FieldLocator | None:
        """Locator with the log so far; None before the first record."""
        return self._locator

    def add(self, lines: list[str], *, is_end: bool = False) -> None:
        """Store and locate the records of the next lines; with `is_end`, also records that are held back."""
        table = self._table.add(lines, is_end=is_end)
        if table.lines.size:
            self._locate(table)

    def _locate(self, table: InputTable, *, is_past: bool = False) -> None:
        poses, phase_rad, pulses = survey_rows(table, self._survey.noise_v, 0.0, self._survey.heading)
        steps, step, _ = steps_of(poses, 0)
        n_channels = len(strength_columns(table)[0])
        data = FieldData(
            path=self._source,
            time_s=steps[:, 0],
            pose=steps[:, 1:],
            step=step,
            pulses=PulseBatch.detected(steps[step, 0], pulses.strengths_v, pulses.variance_v2, phase_rad),
            channels=np.arange(n_channels),
            n_recorded=n_channels,
        )
        if self._locator is None:
            self._locator = FieldLocator(data, self._survey, LocatingRules(), MARGIN_M)
        if is_past:
            self._locator.catch_up(data)
        else:
            self._locator.add(data)
        self.n_records += len(poses)

    def news(self) -> Iterator[str]:
        """Return a line for each event, and for each finding that has changed, since the last call."""
        if self._locator is None:
            return
        log, findings = self._locator.log, self._locator.findings
        events = log.table("event", self._n_events)
        self._n_events += events["kind"].size
        for step, kind, text in zip(events["step"], events["kind"], events["text"], strict=True):
            if kind not in FINDING_EVENTS:
                yield f"{log.column('step', 'time_s', step, step + 1)[0]:8.1f} s  {text}"
        if not log.n_rows("step"):
            return
        time_s = log.column("step", "time_s", log.last_step)[0]
        gone = dict(self._printed)
        for finding in findings:
            before = gone.pop(finding.id, None)
            if before is None or _has_changed(before, finding):
                self._printed[finding.id] = finding
                yield f"{time_s:8.1f} s  {_line(finding)}"
        for number in gone:
            del self._printed[number]
            yield f"{time_s:8.1f} s  {_name(gone[number])} was multipath, interference, or part of another source"


def _has_changed(before: Finding, now: Finding) -> bool:
    moved_m = float(np.linalg.norm((now.position_m - before.position_m)[:2]))
    change_m = max(moved_m, abs(now.semi_major_m - before.semi_major_m))
    return before.state != now.state or change_m > MOVED_SHARE * before.semi_major_m


def _name(finding: Finding) -> str:
    return f"{'finding' if finding.state == 'confirmed' else finding.state} {finding.id}"


def _line(finding: Finding) -> str:
    x, y, z = finding.position_m
    size = f"95 % in {finding.semi_major_m:.2f} m, probability {percent(finding.existence)}"
    return f"{_name(finding)} at ({x:.2f}, {y:.2f}, {z:.2f}) m, {size}"
