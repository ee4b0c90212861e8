"""Following of a survey while it is recorded: receive, locate and print until the end of the stream."""

import os
import time
from pathlib import Path

from rich.console import Console

from pdpatrol.missions.cli.process import deferred_signals
from pdpatrol.missions.cli.terminal import fail, note, say
from pdpatrol.missions.field.follow import SurveyFollower
from pdpatrol.missions.field.line_sources import open_source
from pdpatrol.missions.field.survey import SurveyOptions


def title_of(source: Path) -> Path:
    """Return a file name for a source: itself, stdin, or port-NUMBER."""
    name = str(source)
    if name == "-":
        return Path("stdin")
    return Path(f"port-{name.rpartition(':')[2]}") if ":" in name and not source.exists() else source


def follow_survey(
    source: Path, survey: SurveyOptions, folder: Path, idle_s: float | None, live: bool, console: Console
) -> SurveyFollower:
    """Locate while records arrive, up to the end of the stream, a signal, or a time without new lines.

    Args:
        source: File, folder, `-` or 127.0.0.1:PORT.
        survey: Array, poses, yard and date.
        folder: Folder for the table of received records.
        idle_s: Time without new lines after which to end; None to wait without limit.
        live: Show the survey in the Rerun viewer.
        console: Console to print findings on.
    """
    viewer = None
    if live:
        os.environ.setdefault("RUST_LOG", "off")  # otherwise Rerun complains when the user closes the viewer
        from pdpatrol.missions.recording import LiveView  # Rerun is optional

        viewer = LiveView()
    latest_s = time.monotonic()  # time of the latest lines
    pieces = open_source(str(source), note, lambda: idle_s is not None and time.monotonic() - latest_s > idle_s)
    follower = SurveyFollower(folder, title_of(source), survey, note)
    longest_s, n_stored = 0.0, follower.n_records

    def show() -> None:
        for text in follower.news():
            say(text, console)
        if viewer and follower.locator:
            viewer.update(follower.locator.log)

    with deferred_signals() as signals:
        if n_stored:
            note(f"{n_stored} records were received before: continued")
            show()
        looked_s = latest_s = time.monotonic()
        for lines in pieces:
            follower.add(lines)
            show()
            if lines:
                latest_s = time.monotonic()
            # a record of this piece may have arrived right after the look before
            longest_s, looked_s = max(longest_s, time.monotonic() - looked_s), time.monotonic()
            if signals:
                break
        pieces.close()
        follower.add([], is_end=True)
        show()
        if viewer and follower.locator:
            viewer.update(follower.locator.finish())
    if not follower.n_records:
        fail(f"{source}: no record was received")
    say(f"{follower.n_records - n_stored} records received, each located within {longest_s:.2f} s", console)
    return follower
