"""`pdpatrol gap`: differences between a recording and the simulation of the same drive."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dirmusic.arrays import FloatArray
from pdpatrol.envs.scenario import load_scenario
from pdpatrol.missions.cli.arguments import call_command
from pdpatrol.missions.cli.gap import gap
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.field.gap.compare import Gap, compare, survey_of
from pdpatrol.missions.field.gap.noise_free import NoiseFreeDrive, World
from pdpatrol.missions.field.gap.recorded_strengths import estimate_noise, group_pulses
from pdpatrol.missions.field.gap.sources import SITE_STD_M, RecordedSource, choose_sources
from pdpatrol.missions.field.gap.world_fit import FAR_ACROSS, DriveFit
from pdpatrol.sensing.receiver.receiver import Receiver
from tests.missions.field.gap_recordings import FIVE, YARD, Planted, loop_poses, record, recorded_sites


def compared(folder: Path, seed: int, planted: Planted) -> tuple[Gap, FloatArray]:
    """Compare a recording with the scenario; return also the true gains in dB."""
    path, scenario = folder / "recording.csv", load_scenario(YARD)
    gain_db = record(path, seed, planted)
    return compare(read_field_data(path), scenario, survey_of(scenario, YARD)), gain_db


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 100, 400])
def test_five_planted_differences_are_found_and_nothing_else(tmp_path: Path, seed: int) -> None:
    """With seed 100, poses that a fit holds far from the true ones must not make the errors of all seem larger.

    With seed 400, the step of a derivative moves a source into equipment, from where nothing is received.
    """
    found, gain_db = compared(tmp_path, seed, FIVE)
    rows = {row.quantity: row for row in found.rows}
    planted = {"noise floor": 6.0, "beam width": 10.0, "gain of channel 3": -3.0, "pose errors": 2.0}
    assert {name for name, row in rows.items() if row.is_claimed} == {*planted, "ground"}
    assert rows["ground"].estimate == "wet_soil"
    for name, true in planted.items():
        low, high = map(float, rows[name].interval)
        assert low < true < high, name
    estimated_db = [float(rows[f"gain of channel {k}"].estimate) for k in range(1, 7)]
    np.testing.assert_allclose(estimated_db, gain_db - np.median(gain_db), atol=0.5)


@pytest.mark.slow
def test_poses_beyond_edges_of_shadows_are_found() -> None:
    """Strengths that the model of the fit caused itself are explained at all poses, also where paths change."""
    rng, scenario, n = np.random.default_rng(0), load_scenario(YARD), 30
    pose, site_m = loop_poses(scenario, n, rng), scenario.yard.site_position("breaker/pole")
    world = World(
        positions_m=site_m[np.newaxis],
        axes=rng.standard_normal((1, 3)),
        pointing_rad=np.zeros(6),
        beam_width=1.0,
        ground="gravel",
    )
    step, source = np.arange(n), np.zeros(n, dtype=np.intp)
    strengths_v = NoiseFreeDrive(scenario=scenario, step=step, source=source).strengths(pose, world)
    groups, _ = group_pulses(strengths_v, step, source)
    recorded = pose + 2.0 * scenario.pose_sensor.std * rng.standard_normal(pose.shape)
    at_site = RecordedSource(name="breaker/pole", places=((site_m, SITE_STD_M**2 * np.eye(3)),))
    fit = DriveFit(scenario, groups, 1e-8, np.linspace(0.0, 600.0, n), recorded, [at_site]).solve("gravel")
    along = np.einsum("gi,gi->g", fit.residual, groups.unit)
    across = np.linalg.norm(fit.residual - along[:, np.newaxis] * groups.unit, axis=1)
    assert across.max() < 0.5 * FAR_ACROSS


@pytest.mark.slow
def test_recording_as_the_scenario_states_claims_nothing(tmp_path: Path) -> None:
    found, _ = compared(tmp_path, 3, Planted())
    assert not [row for row in found.rows if row.is_claimed]


@pytest.mark.parametrize("seed", [200, 202])
def test_sources_are_the_sites_that_explain_the_pulses(tmp_path: Path, seed: int) -> None:
    """No finding is needed, and the planted differences do not matter."""
    record(tmp_path / "recording.csv", seed, FIVE)
    data = read_field_data(tmp_path / "recording.csv")
    found = choose_sources(data, load_scenario(YARD), findings=())
    assert {source.name for source in found.sources} == set(recorded_sites(seed))
    assert found.pulse.size > 0.8 * data.step.size


@pytest.mark.parametrize("noise_db", [0.0, 6.0])
def test_noise_follows_from_scatter_of_strength_ratios(noise_db: float) -> None:
    """Levels scatter by 3 dB, and weak channels as strengths do; neither changes the estimate."""
    rng, receiver = np.random.default_rng(0), load_scenario(YARD).receiver
    model = Receiver(receiver, 6)
    noise_v2 = model.filtered_noise_v**2 * 10 ** (noise_db / 10) + model.step_v**2 / 12
    unit = rng.uniform(0.01, 1.0, (30, 1, 6))
    level_v = 0.2 * 10 ** (rng.normal(0.0, 3.0, (30, 10, 1)) / 20)
    noise = np.sqrt(model.front_end.noise_on_pulse * noise_v2) * rng.standard_normal((30, 10, 6))
    strengths_v = np.abs(level_v * unit + noise).reshape(-1, 6)
    found = estimate_noise(strengths_v, np.repeat(np.arange(30), 10), receiver)
    assert found is not None
    assert abs(found.db - noise_db) < 3.0 * found.std_db
    assert found.std_db < 0.3


@pytest.mark.whole
@pytest.mark.slow
def test_gap_writes_a_scenario_that_loads(tmp_path: Path) -> None:
    record(tmp_path / "recording.csv", 3, FIVE)
    gap(tmp_path / "recording.csv", yard=YARD, out_dir=tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"gap.json", "gap.png", "fitted.toml"}
    fitted = load_scenario(tmp_path / "out" / "fitted.toml")
    assert fitted.radio.ground == "wet_soil"
    assert fitted.receiver.noise_v == pytest.approx(2e-3, rel=0.1)
    assert fitted.nature.receiver.faults[0].channel == 3
    assert len(fitted.sources) == 2
    assert json.loads((tmp_path / "out" / "gap.json").read_text())["rows"][0]["is_claimed"]


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the only line that the command prints before it ends with status 2."""
    with pytest.raises(SystemExit) as ended:
        call_command(gap, arguments)
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    return line


def test_unusable_recordings_give_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    record(tmp_path / "recording.csv", 0, Planted(), n_poses=2)
    table = pd.read_csv("recording.csv")
    table.drop(columns=["strength_6", "std_6"]).to_csv("five_channels.csv", index=False)
    yard = f"--yard={YARD}"
    assert "must have a confirmed finding" in refused(capsys, "recording.csv", yard)
    assert "must have 6 live channels as the scenario, got 5" in refused(capsys, "five_channels.csv", yard)
    assert "missing.csv" in refused(capsys, "missing.csv", yard)
    assert "missing.toml" in refused(capsys, "recording.csv", "--yard=missing.toml")
    (tmp_path / "tilted.toml").write_text(
        YARD.read_text().replace(
            "n_elements = 6",
            "elements = [{ azimuth_deg = 0, elevation_deg = 20 }, { azimuth_deg = 120 }, { azimuth_deg = -120 }]",
        )
    )
    assert "must be level and on the ring" in refused(capsys, "recording.csv", "--yard=tilted.toml")
    assert not (tmp_path / "runs").exists()
