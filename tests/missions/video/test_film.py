"""Films of missions: what they show was known at the time, from the log alone."""

import os
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.video.moments import MOST_RAYS, Moments, smooth_yaw
from pdpatrol.robot_models.posed_yard import on_picture
from tests.missions.replay.short_mission import pdpatrol, short_mission

pytestmark = pytest.mark.whole

END_S = 6.0


@pytest.fixture(scope="module")
def log() -> MissionLog:
    return short_mission(END_S)


@pytest.fixture(scope="module")
def folder(log: MissionLog, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("films") / "möte 1"
    folder.mkdir()
    log.save(folder)
    return folder


def test_a_moment_shows_what_was_known_by_then_and_nothing_later(log: MissionLog) -> None:
    moments = Moments(log, array_height_m=0.6, stays_s=1.0)
    step, finding = log.table("step"), log.table("finding")
    pulse_step = log.column("pulse", "step")[log.column("bearing", "pulse")]
    for k in (0, 9, 25, log.n_rows("step") - 1):
        moment = moments.at(k)
        np.testing.assert_array_equal(moment.pose, step["pose"][k])
        np.testing.assert_array_equal(moment.true_pose, step["true_pose"][k])
        known = set(finding["id"][finding["step"] <= k].tolist())
        assert {one.id for one in moment.findings} <= known
        fresh = (pulse_step <= k) & (step["time_s"][pulse_step] >= step["time_s"][k] - 1.0)
        told = log.column("bearing", "bearing_rad")[fresh][-MOST_RAYS:]
        np.testing.assert_array_equal(moment.rays.bearing_rad, told)
        assert ((moment.rays.freshness >= 0.0) & (moment.rays.freshness <= 1.0)).all()
    assert moments.at(log.n_rows("step") - 1).news == "mission over: interrupted"


def test_a_dropped_candidate_is_no_longer_shown(log: MissionLog) -> None:
    changed = MissionLog(log.meta)
    for name in ("step", "finding"):
        for row in range(log.n_rows(name)):
            changed.append(name, **{column: values[row] for column, values in log.table(name).items()})
    row = {column: values[-1] for column, values in log.table("finding").items()}
    last = log.n_rows("step") - 1
    assert Moments(changed, 0.6, 1.0).at(last).findings
    for number in set(log.column("finding", "id").tolist()):
        changed.append("finding", **row | {"id": number, "step": last, "state": "dropped"})
    assert not Moments(changed, 0.6, 1.0).at(last).findings


def test_the_camera_turns_as_the_robot_does_across_the_seam_and_without_its_jitter() -> None:
    turning = np.angle(np.exp(1j * np.linspace(3.0, 4.0, 400)))
    looked = smooth_yaw(turning, frame_s=0.1)
    assert np.abs(np.diff(looked)).max() < 0.01
    assert looked[-1] == pytest.approx(4.0, abs=0.05)
    jitter = smooth_yaw(0.3 * np.cos(np.pi * np.arange(400)), frame_s=0.1)
    assert np.ptp(jitter[100:]) < 0.06


def test_on_the_plan_east_is_right_north_and_up_are_up() -> None:
    middle = np.array([20.0, 15.0])
    here, east, north, above = on_picture(
        np.array([[20.0, 15.0, 0.0], [21.0, 15.0, 0.0], [20.0, 16.0, 0.0], [20.0, 15.0, 1.0]]), middle
    )
    np.testing.assert_allclose(here, [0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(east, [1.0, 0.0], atol=1e-12)
    assert north[0] == above[0] == 0.0
    assert north[1] ** 2 + above[1] ** 2 == pytest.approx(1.0)  # sine and cosine of one slope
    assert north[1] > above[1] > 0.0


def test_a_gif_moves_and_ends_on_its_last_frame(folder: Path) -> None:
    done = pdpatrol("replay", folder.name, "--video", "film ü.gif", "--pace", "3", cwd=folder.parent)
    if "MuJoCo found no OpenGL" in done.stderr:
        pytest.skip(done.stderr)
    assert (done.returncode, done.stderr) == (0, "")
    with Image.open(folder.parent / "film ü.gif") as film:
        assert film.size == (960, 480)
        seconds, pictures = 0.0, []
        for frame in range(film.n_frames):  # type: ignore[attr-defined]
            film.seek(frame)
            seconds += film.info["duration"] / 1000
            pictures.append(np.asarray(film.convert("RGB"), dtype=float))
    assert seconds == pytest.approx(END_S / 3 + 2.0, abs=0.4)
    camera, plan = (slice(60, 420), slice(0, 460)), (slice(60, 420), slice(480, 960))
    for part in (camera, plan):
        assert np.ptp(pictures[0][part]) > 100  # not blank
        assert (np.abs(pictures[0][part] - pictures[-1][part]).max(axis=-1) > 30).mean() > 0.005  # it moves
    assert {path.name for path in folder.iterdir()} == {"log.npz"}


def test_without_ffmpeg_one_line_says_what_helps(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if find_spec("imageio_ffmpeg"):
        pytest.skip("the extra `video` brings ffmpeg")
    monkeypatch.setenv("PATH", os.devnull)
    done = pdpatrol("replay", folder.name, "--video", "film.mp4", cwd=folder.parent)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("--video: no ffmpeg on this machine")
    assert not (folder.parent / "film.mp4").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--video", "a.avi"], "--video: got a.avi; allowed is a name that ends in .mp4 or .gif"),
        (["--video", "a.gif", "--pace", "0"], "--pace: got 0.0; allowed is 0.1 to 1000, with --video"),
        (["--pace", "3"], "--pace: got 3.0; allowed is 0.1 to 1000, with --video"),
    ],
)
def test_what_cannot_be_filmed_is_refused_in_one_line(arguments: list[str], told: str, folder: Path) -> None:
    done = pdpatrol("replay", folder.name, *arguments, cwd=folder.parent)
    assert (done.returncode, done.stderr.strip()) == (2, told)


def test_data_from_the_field_are_no_film(log: MissionLog, tmp_path: Path) -> None:
    field = MissionLog({name: fact for name, fact in log.meta.items() if name != "scenario"})
    field.append("step", **{column: values[0] for column, values in log.table("step").items()})
    field.save(tmp_path)
    done = pdpatrol("replay", ".", "--video", "a.gif", cwd=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "not of a simulated mission" in line
