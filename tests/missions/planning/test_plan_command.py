"""The command `pdpatrol plan`."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from pdpatrol.envs.scenario import SHIPPED, load_scenario
from pdpatrol.missions.planning.output import as_json
from tests.missions.conftest import Refused, call
from tests.missions.planning.one_plan import plan_of
from tests.processes import pdpatrol

pytestmark = pytest.mark.whole


def test_plan_writes_table_picture_json_and_route(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")  # names of sites on one line
    done = pdpatrol("plan", "one_source", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder, plan = tmp_path / "runs" / "plan-one_source", plan_of("one_source")
    assert {path.name for path in folder.iterdir()} == {"plan.png", "plan.json", "route.toml"}
    assert all(name in done.stdout for name in plan.detectability.names)
    assert f"13 of 13 sites detectable in sight, 3 dB above the trigger; {len(plan.stops_m)} stops" in done.stdout
    data = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    assert data == as_json(plan)
    picture = imread(folder / "plan.png")
    assert min(picture.shape[:2]) > 600
    assert len(np.unique(picture.reshape(-1, picture.shape[-1]), axis=0)) > 50

    yard = (SHIPPED / "one_source.toml").read_text(encoding="utf-8")
    before, _, rest = yard.partition("[route]")
    pasted = before + (folder / "route.toml").read_text(encoding="utf-8") + "\n[" + rest.partition("\n[")[2]
    (tmp_path / "pasted.toml").write_text(pasted, encoding="utf-8")
    route = load_scenario(tmp_path / "pasted.toml").route
    assert np.array(route.waypoints_m).tolist() == plan.stops_m.tolist()
    assert route.dock_m == plan.scenario.route.dock_m


def test_plan_uses_settings_and_amplitude(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = ("--set", "receiver.noise_v=4e-3", "--amplitude-v", "0.06", "--json", "--out", "here")
    call("plan", "one_source", *given)
    data = json.loads(capsys.readouterr().out)
    assert data == json.loads((tmp_path / "here" / "plan.json").read_text(encoding="utf-8"))
    assert data["amplitude_v"] == 0.06
    levels = [site["detection"]["level_db"] for site in data["sites"] if site["detection"]]
    strongest = max(detection.level_db for detection in plan_of("one_source").detections() if detection)
    assert max(levels, default=0.0) < strongest - 6.0


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["nowhere"], "nowhere: no such scenario"),
        (["one_source", "--amplitude-v", "nan"], "--amplitude-v: must be"),
        (["one_source", "--set", "receiver.noise_v=1e-3,2e-3"], "--set: receiver.noise_v must have one value, got 2"),
        (["one_source", "--set", "noise=1"], "noise: unknown key"),
        (["one_source", "--out", "file"], "--out"),
    ],
)
def test_plan_refuses_invalid_input(arguments: list[str], fault: str, tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    (line,) = refused("plan", *arguments, cwd=tmp_path)
    assert fault in line
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text(encoding="utf-8") == "kept"
