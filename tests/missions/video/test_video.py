"""Films of missions."""
# pyright: reportAttributeAccessIssue=false

from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.video import CARD_S, MAX_BEARINGS, OPENING_S, STILL_S, latest_bearings, write_video
from pdpatrol.robot_models.rendering import make_renderer
from tests.missions.replay.short_mission import copy_of, short_mission
from tests.processes import pdpatrol

pytestmark = pytest.mark.whole

END_S = 6.0


@pytest.fixture(scope="module")
def log() -> MissionLog:
    return short_mission(END_S)


@pytest.fixture(scope="module")
def folder(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("videos") / "möte 1"
    folder.mkdir()
    log.save(folder)
    return folder


def test_video_shows_no_bearing_before_its_time(log: MissionLog) -> None:
    time_s = log.column("step", "time_s")
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse")]
    for step in (0, 9, 25, log.n_rows("step") - 1):
        place_m, bearing_rad = latest_bearings(log, step, 1.0)
        recent = (pulse_step <= step) & (time_s[pulse_step] >= time_s[step] - 1.0)
        rows = np.flatnonzero(recent)[-MAX_BEARINGS:]
        np.testing.assert_array_equal(bearing_rad, log.column("bearing", "bearing_rad")[rows])
        np.testing.assert_array_equal(place_m, log.column("step", "pose")[pulse_step[rows], :2])


@pytest.mark.skipif(find_spec("imageio") is None, reason="imageio is not installed")
@pytest.mark.filterwarnings("default")  # imageio leaves a pipe open
@pytest.mark.parametrize("kind", ["gif", "mp4"])
def test_video_moves_between_opening_view_and_closing_card(
    kind: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a screen, the command chooses a renderer that needs none."""
    from imageio.v3 import immeta, imread

    try:
        make_renderer(mujoco.MjModel.from_xml_string("<mujoco/>")).close()
    except RuntimeError as error:
        pytest.skip(str(error))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    video = folder.parent / f"video ü.{kind}"
    done = pdpatrol("replay", folder.name, "--video", video.name, "--pace", "3", cwd=folder.parent)
    assert (done.returncode, done.stderr) == (0, "")
    pictures = imread(video, index=None).astype(float) if kind == "gif" else imread(video).astype(float)
    assert pictures.shape[1:] == ((480, 960, 3) if kind == "gif" else (640, 1280, 3))
    if kind == "mp4":
        assert immeta(video)["duration"] == pytest.approx(END_S / 3 + OPENING_S + STILL_S + CARD_S, abs=0.4)
    height, width = pictures.shape[1:3]
    for half in (slice(0, width // 2), slice(width // 2, width)):
        start, end = round(OPENING_S * 10) + 1, -round(CARD_S * 10) - 1  # without the opening view and the card
        if kind == "gif":  # equal frames are one
            start, end = 1, -2
        first, last = (picture[height // 8 : -height // 8, half] for picture in (pictures[start], pictures[end]))
        assert np.ptp(first) > 100  # not blank
        assert (np.abs(first - last).max(axis=-1) > 30).mean() > 0.005
    assert {path.name for path in folder.iterdir()} == {"log.npz"}


def test_field_data_has_no_video(log: MissionLog, tmp_path: Path) -> None:
    field = copy_of(log, "step", n_steps=1)
    del field.meta["truth"]
    with pytest.raises(ValueError, match="not of a simulated mission"):
        write_video(field, tmp_path / "a.gif", None, print)
