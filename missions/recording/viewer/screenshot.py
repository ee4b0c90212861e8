"""A picture of the viewer as it shows a recording: drawn without a window, so no screen is needed."""

from __future__ import annotations

import time
from pathlib import Path

from pdpatrol.missions.recording.paths import SIM_TIME
from pdpatrol.missions.recording.viewer.rerun_process import RerunProcess, ViewerError, free_port

SIZE = (1600, 1000)
"""Of the picture, pixels."""

SETTLED_S, LIMIT_S = 7.0, 60.0
"""How long the notes that the viewer opens with stay, and after which a picture is taken that still changes."""

NO_GRAPHICS = "No graphics adapter"
"""Of what Rerun says where nothing can draw."""


def take_screenshot(recording: Path, at_s: float | None = None) -> bytes:
    """The whole viewer as a PNG.

    Args:
        recording: To be shown.
        at_s: Simulated time to show; None for the end.

    Raises:
        ViewerError: If the machine has nothing that draws.
    """
    port = free_port()
    size = "x".join(map(str, SIZE))
    with RerunProcess("--headless", "--window-size", size, "--port", str(port), "--hide-welcome-screen") as viewer:
        try:
            client = viewer.client(port)
            started = time.monotonic()
            client.open(str(recording.resolve()))
            timelines = [line for shown in client.get_state().recordings for line in shown.timelines]
            end_s = max((line.end or 0) * 1e-9 for line in timelines if line.name == SIM_TIME)
            client.set_time(SIM_TIME, duration=end_s if at_s is None else at_s, play_state="paused")
            before, picture = b"", client.take_screenshot()
            while (waited_s := time.monotonic() - started) < SETTLED_S or (picture != before and waited_s < LIMIT_S):
                time.sleep(0.5)
                before, picture = picture, client.take_screenshot()
        except (ViewerError, ConnectionError, RuntimeError) as error:
            if NO_GRAPHICS in str(error):
                raise ViewerError(
                    "nothing on this machine can draw the viewer; install the driver of its graphics card, or Mesa's "
                    "software (Debian: mesa-vulkan-drivers)"
                ) from None
            raise ViewerError(f"the viewer takes no picture: {str(error).splitlines()[0]}") from None
    return picture
