"""Field data in, findings out: the shipped example, other people's surveys, and every way a file can be wrong."""

import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dirmusic import ArrayModel, ElementSpread, GaussianPattern, InputFileError, PoseError, write_pattern
from pdpatrol.missions.field.array_model import array_model
from pdpatrol.missions.field.field_data import FieldData, read_field_data
from pdpatrol.missions.field.locate_field_data import locate_field_data
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.records import Report
from pdpatrol.sensing import ArrayConfig, ElementConfig, HelicalArray
from pdpatrol.sensing.nature.pulse_shape import unit_pulse_energy
from pdpatrol.sensing.radio.surroundings import in_array_frame, level_transform, rays_between
from tests.processes import assert_tells_time

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "locate"
PDPATROL = str(Path(sys.executable).with_name("pdpatrol"))
NOISE_V = 1e-3
FOUR_OF_SIX = tuple(ElementConfig(azimuth_deg=azimuth) for azimuth in (90.0, 30.0, -30.0, -90.0))
HEADER = "time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_3"
SPREAD = ElementSpread(gain=0.05, pointing_rad=np.radians(2.0))
POSE_ERROR = PoseError(position_m=0.05, heading_rad=np.radians(0.5), correlation_s=5.0)


def pdpatrol(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PDPATROL, *arguments], cwd=cwd, capture_output=True, text=True, timeout=120)


def located(data: FieldData, *, fence_m: tuple[float, float] | None = None) -> Report:
    array = array_model(data, SPREAD, None, None, 0.12, 0.6)
    return make_report(locate_field_data(data, array, POSE_ERROR, fence_m=fence_m), 0.0)


def survey(
    path: Path, poses: np.ndarray, sources_m: list[tuple[float, float, float]], seed: int, n_elements: int = 6
) -> list[list[float]]:
    """A strength table of one pulse per pose and source, from an imperfect array at imperfectly known poses."""
    rng = np.random.default_rng(seed)
    config = ArrayConfig(elements=FOUR_OF_SIX) if n_elements == 4 else ArrayConfig()
    array = HelicalArray.draw(config, rng)
    energy_to_noise = unit_pulse_energy(20e9) / NOISE_V**2
    rows: list[list[float]] = []
    for k, (x, y, yaw) in enumerate(poses):
        for source in sources_m:
            source_m = in_array_frame(np.array(source), level_transform(np.array([x, y, yaw])))
            rays = rays_between(array.positions_m, source_m)
            amplitude = 0.27 * rays.spreading * array.gain(rays.azimuth_rad, rays.elevation_rad)
            energy = rng.noncentral_chisquare(90, np.square(amplitude) * energy_to_noise)
            believed = [*(np.array([x, y]) + rng.normal(0, 0.05, 2)), np.degrees(yaw) + rng.normal(0, 0.5)]
            rows.append([30.0 * k, *believed, *(NOISE_V * np.sqrt(np.maximum(energy - 90, 0)))])
    write(path, rows)
    return rows


def write(path: Path, rows: list[list[float]]) -> Path:
    n = len(rows[0]) - 4
    header = ",".join(["time_s", "x_m", "y_m", "yaw_deg", *(f"strength_{k + 1}" for k in range(n))])
    path.write_text("\n".join([header, *(",".join(f"{v:.6f}" for v in row) for row in rows), ""]))
    return path


def orbit(n: int, radius_m: float, centre: tuple[float, float], turn: float = 1.0) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi * turn, n, endpoint=False)
    return np.column_stack([centre[0] + radius_m * np.cos(angle), centre[1] + radius_m * np.sin(angle), angle + 2.0])


@pytest.mark.whole
def test_waveforms_and_their_strengths_give_the_same_fix_near_the_truth(tmp_path: Path) -> None:
    truth = json.loads((EXAMPLE / "truth.json").read_text())
    fixes = []
    for table in ("strengths.csv", "waveforms.csv"):
        done = pdpatrol("locate", str(EXAMPLE / table), "--json", "--timing", "--out", table, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert_tells_time(done.stderr, "reading", "locating", "log, report and recording")
        report = json.loads(done.stdout)
        assert report == json.loads((tmp_path / table / "report.json").read_text())
        assert len(report["findings"]) == 1
        assert report["candidates"] == []
        fixes.append(report["findings"][0]["position_m"][:2])
        assert {path.name for path in (tmp_path / table).iterdir()} == {
            "log.npz",
            "report.json",
            "report.html",
            "mission.rrd",
            "calibration.toml",
        }
    assert np.linalg.norm(np.subtract(*fixes)) < 0.05
    assert np.linalg.norm(fixes[0] - np.array(truth["position_m"])[:2]) < 0.3


def test_the_example_is_what_its_script_makes(tmp_path: Path) -> None:
    shutil.copy(EXAMPLE / "make_example.py", tmp_path)
    spec = importlib.util.spec_from_file_location("make_example", tmp_path / "make_example.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.main()
    for name in ("strengths.csv", "waveforms.csv", "truth.json"):
        assert (tmp_path / name).read_text() == (EXAMPLE / name).read_text()
    for path in sorted((EXAMPLE / "waveforms").glob("*.npz")):
        with np.load(path) as shipped, np.load(tmp_path / "waveforms" / path.name) as made:
            assert all(np.array_equal(shipped[key], made[key]) for key in shipped.files)


def test_the_log_of_field_data_reads_back_and_holds_no_truth(tmp_path: Path) -> None:
    data = read_field_data(EXAMPLE / "strengths.csv")
    log = locate_field_data(data, array_model(data, SPREAD, None, None, 0.12, 0.6), POSE_ERROR)
    log.save(tmp_path)
    back = MissionLog.load(tmp_path)
    assert back.n_rows("step") == 14
    assert back.n_rows("pulse") == 84
    assert np.isnan(back.column("step", "true_pose")).all()
    assert "truth" not in back.meta
    assert make_report(back, 0.0).evaluation is None


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_pulse_from_each_of_a_few_poses_is_enough(tmp_path: Path, seed: int) -> None:
    survey(tmp_path / "s.csv", orbit(24, 4.0, (10.0, 10.0), 0.7), [(11.0, 9.0, 1.5)], seed)
    report = located(read_field_data(tmp_path / "s.csv", noise_v=NOISE_V))
    assert len(report.findings) == 1
    assert np.linalg.norm(np.subtract(report.findings[0].position_m[:2], (11.0, 9.0))) < 0.3


@pytest.mark.parametrize("seed", [1, 2])
def test_two_sources_heard_in_turn_are_two_findings(tmp_path: Path, seed: int) -> None:
    sources = [(8.0, 12.0, 1.5), (14.0, 9.0, 1.5)]
    survey(tmp_path / "s.csv", np.repeat(orbit(16, 7.0, (11.0, 10.5)), 5, axis=0), sources, seed)
    report = located(read_field_data(tmp_path / "s.csv", noise_v=NOISE_V))
    found = np.array([f.position_m[:2] for f in report.findings])
    assert len(found) == 2
    for source in sources:
        assert np.linalg.norm(found - np.array(source[:2]), axis=-1).min() < 0.3


def test_the_phase_of_the_mains_tells_the_kind_of_discharge(tmp_path: Path) -> None:
    survey(tmp_path / "s.csv", np.repeat(orbit(20, 4.0, (10.0, 10.0)), 3, axis=0), [(11.0, 9.0, 1.5)], 9)
    header, *rows = (tmp_path / "s.csv").read_text().splitlines()
    assert located(read_field_data(tmp_path / "s.csv", noise_v=NOISE_V)).findings[0].discharge is None
    rng = np.random.default_rng(9)
    phases = 270.0 + rng.normal(0.0, 14.0, len(rows))  # corona: about the crest of one half cycle, all pulses alike
    lines = [f"{header},mains_phase_deg", *(f"{row},{p:.1f}" for row, p in zip(rows, phases, strict=True))]
    (tmp_path / "phase.csv").write_text("\n".join(lines))
    (finding,) = located(read_field_data(tmp_path / "phase.csv", noise_v=NOISE_V)).findings
    assert finding.discharge is not None
    assert finding.discharge.kind == "corona"


def test_noise_alone_is_no_finding(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    rows = [[10.0 * k, *p, *rng.uniform(0.0005, 0.005, 6)] for k, p in enumerate(orbit(60, 5.0, (0.0, 0.0)))]
    report = located(read_field_data(write(tmp_path / "n.csv", rows), noise_v=NOISE_V))
    assert report.findings == ()


def test_a_source_beyond_the_fence_is_told_apart(tmp_path: Path) -> None:
    survey(tmp_path / "s.csv", np.repeat(orbit(16, 4.0, (15.0, 10.0)), 4, axis=0), [(24.0, 10.0, 1.5)], 5)
    report = located(read_field_data(tmp_path / "s.csv", noise_v=NOISE_V), fence_m=(20.0, 20.0))
    assert report.findings == ()
    assert "outside" in {candidate.state for candidate in report.candidates}


def test_one_line_of_bearings_is_no_finding(tmp_path: Path) -> None:
    poses = np.column_stack([np.linspace(0, 6, 40), np.full(40, 5.0), np.zeros(40)])
    survey(tmp_path / "s.csv", poses, [(15.0, 5.0, 1.5)], 6)
    report = located(read_field_data(tmp_path / "s.csv", noise_v=NOISE_V))
    assert report.findings == ()
    assert len(report.candidates) == 1


def test_four_channels_are_the_first_four_elements_of_six(tmp_path: Path) -> None:
    centre = (11.0, 9.0)
    poses = orbit(40, 4.0, (10.0, 10.0))
    poses[:, 2] = np.arctan2(centre[1] - poses[:, 1], centre[0] - poses[:, 0])  # four elements look ahead
    survey(tmp_path / "s.csv", poses, [(*centre, 1.5)], 7, n_elements=4)
    report = located(read_field_data(tmp_path / "s.csv", noise_v=NOISE_V))
    assert np.linalg.norm(np.subtract(report.findings[0].position_m[:2], centre)) < 0.3


def test_a_dead_channel_is_named_left_out_and_does_no_harm(tmp_path: Path) -> None:
    rows = survey(tmp_path / "s.csv", np.repeat(orbit(16, 4.0, (10.0, 10.0)), 3, axis=0), [(11.0, 9.0, 1.5)], 8)
    for row in rows:
        row[4 + 2] = 0.0
    data = read_field_data(write(tmp_path / "dead.csv", rows), noise_v=NOISE_V)
    assert data.notes == ("channel 3 is zero throughout: left out",)
    assert data.channels.tolist() == [0, 1, 3, 4, 5]
    report = located(data)
    assert np.linalg.norm(np.subtract(report.findings[0].position_m[:2], (11.0, 9.0))) < 0.3


def test_as_many_boresights_as_channels_are_wanted(tmp_path: Path) -> None:
    data = read_field_data(EXAMPLE / "strengths.csv")
    with pytest.raises(InputFileError, match="got 2 for 6 channels"):
        array_model(data, SPREAD, None, (0.0, 90.0), 0.12, 0.6)
    turned = array_model(data, SPREAD, None, tuple(range(0, 360, 60)), 0.12, 0.6)
    assert isinstance(turned, ArrayModel)


@pytest.mark.whole
def test_semicolons_and_a_byte_order_mark_are_noted_and_change_nothing(tmp_path: Path) -> None:
    text = (EXAMPLE / "strengths.csv").read_text()
    german = text.replace(",", ";").replace(".", ",")
    (tmp_path / "german.csv").write_bytes(b"\xef\xbb\xbf" + german.replace("\n", "\r\n").encode())
    done = pdpatrol("locate", "german.csv", "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert "note: german.csv: semicolons" in done.stderr
    assert "note: german.csv: begins with a byte-order mark" in done.stderr
    plain = pdpatrol("locate", str(EXAMPLE / "strengths.csv"), "--json", cwd=tmp_path)
    assert json.loads(done.stdout)["findings"] == json.loads(plain.stdout)["findings"]
    assert (tmp_path / "runs" / "german" / "log.npz").exists()


@pytest.mark.whole
def test_a_measured_pattern_is_used(tmp_path: Path) -> None:
    write_pattern(GaussianPattern(), tmp_path / "p.csv")
    done = pdpatrol("locate", str(EXAMPLE / "strengths.csv"), "--json", "--pattern", "p.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    off_m = np.linalg.norm(np.subtract(json.loads(done.stdout)["findings"][0]["position_m"][:2], (14.0, 9.0)))
    assert off_m < 0.3
    mirrored = [f"{-a},{g:.6f}" for a in range(179, -180, -2) for g in [float(GaussianPattern()(np.radians(a)))]]
    (tmp_path / "m.csv").write_text("\n".join(["angle_deg,gain", *mirrored]))
    worse = pdpatrol("locate", str(EXAMPLE / "strengths.csv"), "--json", "--pattern", "m.csv", cwd=tmp_path)
    wrong = json.loads(worse.stdout)["findings"]
    assert not wrong or np.linalg.norm(np.subtract(wrong[0]["position_m"][:2], (14.0, 9.0))) > 2.0 * off_m


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["none.csv"], "none.csv: cannot be read"),
        (["t.csv", "--noise-v", "0"], "--noise-v: got 0.0; allowed is above 0"),
        (["t.csv", "--gain-error", "-1"], "--gain-error: got -1.0; allowed is 0 or more"),
        (["t.csv", "--noise-v", "1", "--pattern", "t.csv"], "columns time_s"),
        (["t.csv", "--noise-v", "1", "--pattern", "../flat.csv"], "--pattern, --boresights-deg: `pattern` is flat"),
        (["t.csv", "--noise-v", "1", "--boresights-deg", "0"], "--boresights-deg: got 1 for 3 channels"),
        (["t.csv", "--noise-v", "1", "--out", "."], "--out: . is not empty"),
        (["t.csv"], "no --noise-v"),
    ],
)
@pytest.mark.whole
def test_a_refusal_is_one_line_and_leaves_nothing(tmp_path: Path, arguments: list[str], told: str) -> None:
    flat = "\n".join(["angle_deg,gain", *(f"{a},1" for a in range(0, 360, 10))])
    (tmp_path.parent / "flat.csv").write_text(flat)
    (tmp_path / "t.csv").write_text(f"{HEADER}\n0,0,0,0,1,2,3\n")
    done = pdpatrol("locate", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]
