"""The replay of a mission as the output of a notebook cell."""

from rerun.notebook import Viewer

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.blueprint import blueprint
from pdpatrol.missions.recording.recorder import Recorder


def notebook_viewer(log: MissionLog) -> Viewer:
    """Return a Rerun viewer that shows a mission, as wide as the cell; it needs the extra `notebook`.

    Browsers load the viewer from app.rerun.io, or from this machine if `RERUN_NOTEBOOK_ASSET` is `serve-local`.

    Args:
        log: Log of a finished or killed mission.

    Raises:
        ImportError: If the extra is not installed.
    """
    recorder = Recorder(log)
    viewer = Viewer(
        width="auto", height="auto", recording=recorder.stream, blueprint=blueprint(log.meta, is_live=False)
    )
    recorder.update(is_over=True)
    return viewer
