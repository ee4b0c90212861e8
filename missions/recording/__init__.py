"""MissionLog to Rerun: the only package that imports it."""

from missions.recording.recorder import Recorder, write_recording
from missions.recording.recording_file import check_recording
from missions.recording.viewer import live_stream, open_viewer, serve

__all__ = ["Recorder", "check_recording", "live_stream", "open_viewer", "serve", "write_recording"]
