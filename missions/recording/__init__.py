"""MissionLog to Rerun: the only package that imports it."""

from pdpatrol.missions.recording.recorder import Recorder, write_recording
from pdpatrol.missions.recording.recording_file import check_recording, ready_recording
from pdpatrol.missions.recording.viewer.native import LiveView, open_viewer
from pdpatrol.missions.recording.viewer.rerun_process import ViewerError, check_screen
from pdpatrol.missions.recording.viewer.screenshot import take_screenshot
from pdpatrol.missions.recording.viewer.web import serve

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
