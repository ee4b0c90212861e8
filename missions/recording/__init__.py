"""MissionLog to Rerun: the only package that imports it."""

from missions.recording.recorder import Recorder, write_recording
from missions.recording.recording_file import check_recording, ready_recording
from missions.recording.viewer.native import LiveView, open_viewer
from missions.recording.viewer.rerun_process import ViewerError, check_screen
from missions.recording.viewer.screenshot import take_screenshot
from missions.recording.viewer.web import serve

__all__ = [
    "LiveView",
    "Recorder",
    "ViewerError",
    "check_recording",
    "check_screen",
    "open_viewer",
    "ready_recording",
    "serve",
    "take_screenshot",
    "write_recording",
]
