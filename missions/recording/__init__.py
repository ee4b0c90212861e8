"""MissionLog to Rerun: the only package that imports it."""

from missions.recording.recorder import Recorder, write_recording
from missions.recording.recording_file import check_recording
from missions.recording.viewer import LiveView, open_viewer, serve

__all__ = ["LiveView", "Recorder", "check_recording", "open_viewer", "serve", "write_recording"]
