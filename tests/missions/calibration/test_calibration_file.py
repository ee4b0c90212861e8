"""The file of a calibration is read back; errors in it are one line each."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import tomlkit

from dirmusic import InputFileError
from dirmusic.array.element_errors import DRIFT, EstimatedErrors
from pdpatrol.envs import Scenario, load_scenario
from pdpatrol.envs.scenario import ScenarioError, restore_scenario
from pdpatrol.envs.scenario.array import ArrayCalibration, read_calibration
from pdpatrol.missions.cli.mission_files import CALIBRATION_HEADER
from tests.envs.helpers import write_yard
from tests.missions.conftest import Refused, call

ROOT = Path(__file__).parents[3]
NUMBER = {"array.serial_number": 7}


def calibration_of(scenario: Scenario, before: ArrayCalibration | None = None) -> ArrayCalibration:
    """Return a calibration with random errors and a random covariance."""
    rng, n = np.random.default_rng(1), scenario.array.n_channels
    root = rng.normal(0.0, 0.01, (2 * n, 2 * n))
    errors = EstimatedErrors.of_states(rng.normal(0.0, 0.03, 2 * n), root @ root.T, n)
    array, number = scenario.known_array, scenario.array.serial_number
    return ArrayCalibration.after('yard "north", seed 1', errors, 160, array, number, before)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "calibration.toml"
    calibration = calibration_of(load_scenario("one_source", NUMBER)).model_dump(mode="json")
    path.write_text(CALIBRATION_HEADER + tomlkit.dumps(calibration), encoding="utf-8")
    return path


def test_calibration_is_read_back_exactly(file: Path) -> None:
    written = calibration_of(load_scenario("one_source", NUMBER))
    read = read_calibration(file)
    assert read == written
    errors = read.errors()
    assert errors.covariance.tobytes() == written.errors().covariance.tobytes()
    assert errors.covariance.tobytes() == errors.covariance.T.tobytes()


def test_scenario_adds_drift_to_calibration(file: Path) -> None:
    scenario = load_scenario("one_source", {**NUMBER, "locating.calibration": str(file)})
    array, learned = scenario.known_array, read_calibration(file).errors()
    assert array.errors is not None
    np.testing.assert_array_equal(array.errors.state, learned.state)
    drift = np.square(DRIFT * np.repeat([0.05, np.radians(2.0), 0.0], 6))
    np.testing.assert_allclose(array.errors.covariance, learned.covariance + np.diag(drift))


def test_scenario_is_restored_without_calibration_file(file: Path) -> None:
    scenario = load_scenario("one_source", {**NUMBER, "locating.calibration": str(file)})
    file.unlink()
    assert restore_scenario(json.loads(scenario.model_dump_json())) == scenario


def test_calibration_path_is_relative_to_scenario(file: Path) -> None:
    numbered = ("[array]", "[array]\nserial_number = 7")
    yard = write_yard(file.parent, '[locating]\ncalibration = "calibration.toml"', numbered)
    assert load_scenario(yard).locating.calibration == read_calibration(file)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"array.serial_number": 8}, "serial number 8, data sheet "),
        ({"array.gain_error": 0.1}, "serial number 7, data sheet "),
        ({"array.gain_offset": 0.1}, "serial number 7, data sheet "),
        ({"array.pattern": "helix"}, "serial number 7, data sheet "),
        ({"array.n_elements": 8}, "8 elements; got "),
        ({"locating.locator": "mine.py:Mine"}, "must go with the built-in Locator"),
    ],
)
def test_calibration_of_another_array_is_refused(settings: dict[str, object], message: str, file: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("one_source", {**NUMBER, **settings, "locating.calibration": str(file)})
    (line,) = caught.value.faults
    assert "locating.calibration: " in line
    assert message in line


def test_calibration_needs_a_serial_number(file: Path) -> None:
    with pytest.raises(ScenarioError, match="serial_number: is required with a calibration"):
        load_scenario("one_source", {"locating.calibration": str(file)})


DAMAGES = {
    "cut off": (lambda text: text[: len(text) // 2], "not valid TOML"),
    "another format": (lambda text: text.replace("calibration 2", "calibration 1"), "format: must be"),
    "a key less": (lambda text: text.replace("n_missions = 1\n", ""), "n_missions: is required"),
    "not a number": (
        lambda text: text.replace("\noffset = [0.0,", "\noffset = [nan,"),
        "offset.0: must be a finite number, got nan",
    ),
    "an element less": (
        lambda text: text.replace("\noffset = [0.0, ", "\noffset = ["),
        "offset: must have 6 numbers each",
    ),
    "no covariance": (lambda text: text.replace("= [[", "= [[-"), "covariance: must be symmetric and positive"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_calibration_is_refused(damage: str, file: Path) -> None:
    change, message = DAMAGES[damage]
    text = file.read_text(encoding="utf-8")
    assert change(text) != text
    file.write_text(change(text), encoding="utf-8")
    with pytest.raises(InputFileError) as caught:
        read_calibration(file)
    (line,) = caught.value.faults
    assert line.startswith(f"{file}: ")
    assert message in line


@pytest.mark.whole
def test_run_with_damaged_calibration_writes_nothing(file: Path, tmp_path: Path, refused: Refused) -> None:
    file.write_text(file.read_text(encoding="utf-8")[:300], encoding="utf-8")
    table = str(ROOT / "examples" / "locate" / "strengths.csv")
    for command in (["run", "--serial-number", "7"], ["locate", table]):
        for name in (file.name, "none.toml"):
            (line,) = refused(*command, "--calibration", name, "--out", "here", cwd=tmp_path)
            assert line.startswith(f"{name}: ")
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


@pytest.mark.whole
def test_field_data_write_and_use_calibrations(
    tmp_path: Path, refused: Refused, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(ROOT / "examples" / "locate" / "strengths.csv", tmp_path / "strengths.csv")
    monkeypatch.chdir(tmp_path)
    call("locate", "strengths.csv", "--out", "first")
    assert "calibration.toml" in capsys.readouterr().out
    learned = ["--calibration", "first/calibration.toml"]
    call("locate", "strengths.csv", *learned, "--out", "second")
    capsys.readouterr()
    calibrations = [read_calibration(tmp_path / name / "calibration.toml") for name in ("first", "second")]
    assert [calibration.n_missions for calibration in calibrations] == [1, 2]
    (line,) = refused("locate", "strengths.csv", *learned, "--gain-error", "0.1", "--out", "third", cwd=tmp_path)
    assert line.startswith("--calibration: must be a calibration of this array: serial number None, data sheet ")
    assert not (tmp_path / "third").exists()
