"""Rerun recordings of mission logs, and viewers for them. No other package imports Rerun."""

from pdpatrol.missions.recording.notebook import notebook_viewer
from pdpatrol.missions.recording.recorder import Recorder, write_recording
from pdpatrol.missions.recording.viewer import LiveView, open_viewer, serve, take_screenshot

__all__ = ["LiveView", "Recorder", "notebook_viewer", "open_viewer", "serve", "take_screenshot", "write_recording"]
