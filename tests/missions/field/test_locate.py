"""Field data in, findings out: the shipped example and simulated surveys."""

import json
import runpy
import shutil
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from dirmusic import GaussianPattern
from dirmusic.arrays import FloatArray
from pdpatrol.missions.field.field_data import read_field_data
from pdpatrol.missions.report.records import Report
from pdpatrol.sensing import ArrayConfig, HelicalArray
from pdpatrol.sensing.radio.surroundings import level_transform
from tests.missions.conftest import Refused
from tests.missions.field.surveys import EXAMPLE, locate, log_of_table, orbit, survey, write
from tests.processes import assert_times_add_up, pdpatrol

SOURCE_M = (11.0, 9.0, 1.5)


@pytest.mark.whole
def test_waveforms_and_strengths_give_the_same_position(tmp_path: Path) -> None:
    done = pdpatrol("locate", EXAMPLE.with_name("waveforms.csv"), "--json", "--timing", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert_times_add_up(done.stderr, "reading", "locating", "log, report and recording")
    assert done.stdout == (tmp_path / "out" / "report.json").read_text()
    files = {"log.npz", "report.json", "report.html", "mission.rrd", "calibration.toml"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == files
    report, expected = Report.model_validate_json(done.stdout), locate(EXAMPLE, noise_v=None)
    assert (len(report.findings), report.candidates) == (1, ())
    place_m = np.array(report.findings[0].position_m)
    assert np.linalg.norm(place_m - expected.findings[0].position_m) < 0.05
    truth = json.loads(EXAMPLE.with_name("truth.json").read_text())
    assert np.linalg.norm((place_m - truth["position_m"])[:2]) < 0.3


def test_shipped_example_is_made_by_its_script(tmp_path: Path) -> None:
    shutil.copy(EXAMPLE.parent / "make_example.py", tmp_path)
    runpy.run_path(str(tmp_path / "make_example.py"), run_name="__main__")
    for name in ("strengths.csv", "waveforms.csv", "truth.json"):
        assert (tmp_path / name).read_text() == (EXAMPLE.parent / name).read_text()
    for path in sorted((EXAMPLE.parent / "waveforms").glob("*.npz")):
        with np.load(path) as shipped, np.load(tmp_path / "waveforms" / path.name) as made:
            assert all(np.array_equal(shipped[key], made[key]) for key in shipped.files)


def test_assumed_boresights_of_unusual_arrays_are_noted(tmp_path: Path) -> None:
    header, *rows = EXAMPLE.read_text().splitlines()
    (tmp_path / "t.csv").write_text("\n".join([f"{header},strength_7,std_7", *(f"{row},0,0.001" for row in rows)]))
    assumed, given = (
        [note for note in locate(tmp_path / "t.csv", noise_v=None, boresights_deg=angles).notes if "boresights" in note]
        for angles in (None, (90.0, 30.0, -30.0, -90.0, -150.0, 150.0, 0.0))
    )
    assert assumed[0].startswith("boresights of 7 channels are assumed, evenly spaced clockwise from 90 degrees")
    assert given == []


@pytest.mark.parametrize("start_s", [-1000.0, 1.7e9])
def test_survey_may_begin_at_any_time(tmp_path: Path, start_s: float) -> None:
    header, *rows = EXAMPLE.read_text().splitlines()
    shifted = [f"{float(row.split(',')[0]) + start_s:.1f},{row.split(',', 1)[1]}" for row in rows]
    (tmp_path / "t.csv").write_text("\n".join([header, *shifted]))
    expected, report = (locate(table, noise_v=None) for table in (EXAMPLE, tmp_path / "t.csv"))
    assert report.findings[0].position_m == pytest.approx(expected.findings[0].position_m, abs=1e-3)
    assert report.sim_time_s == expected.sim_time_s == 260.0


def located(folder: Path, rows: list[list[float]], yard_m: tuple[float, float] | None = None) -> Report:
    """Return the report of simulated rows."""
    return locate(write(folder / "s.csv", rows), yard_m=yard_m)


def miss_m(report: Report, source_m: tuple[float, float, float] = SOURCE_M) -> float:
    """Return the horizontal distance from a source to the nearest finding."""
    return min((np.hypot(*np.subtract(each.position_m, source_m)[:2]) for each in report.findings), default=np.inf)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_pulse_per_pose_is_enough(tmp_path: Path, seed: int) -> None:
    report = located(tmp_path, survey(orbit(24, 4.0, (10.0, 10.0), 0.7), SOURCE_M, seed=seed))
    assert len(report.findings) == 1
    assert miss_m(report) < 0.3


def test_survey_from_one_pose_lists_its_candidate_once(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("\n".join(EXAMPLE.read_text().splitlines()[:7]))
    report = locate(tmp_path / "t.csv", noise_v=None)
    assert (report.findings, [candidate.id for candidate in report.candidates]) == ((), [1])


@pytest.mark.whole
@pytest.mark.parametrize("seed", [1, 2])
def test_two_sources_are_two_findings(tmp_path: Path, seed: int) -> None:
    sources_m = [(8.0, 12.0, 1.5), (14.0, 9.0, 1.5)]
    report = located(tmp_path, survey(np.repeat(orbit(16, 7.0, (11.0, 10.5)), 5, axis=0), *sources_m, seed=seed))
    assert len(report.findings) == 2
    assert max(miss_m(report, source_m) for source_m in sources_m) < 0.3


def test_mains_phase_classifies_the_discharge(tmp_path: Path) -> None:
    header, *rows = EXAMPLE.read_text().splitlines()
    phases_deg = 270.0 + np.random.default_rng(9).normal(0.0, 14.0, len(rows))  # corona: near one crest of the mains
    lines = [f"{header},mains_phase_deg", *(f"{row},{p:.1f}" for row, p in zip(rows, phases_deg, strict=True))]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    (without,), (finding,) = (locate(table, noise_v=None).findings for table in (EXAMPLE, tmp_path / "t.csv"))
    assert without.discharge is None
    assert finding.discharge is not None
    assert finding.discharge.kind == "corona"


@pytest.mark.whole
def test_noise_alone_is_not_a_finding(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    rows = [[10.0 * k, *pose, *rng.uniform(0.0005, 0.005, 6)] for k, pose in enumerate(orbit(60, 5.0, (0.0, 0.0)))]
    assert located(tmp_path, rows).findings == ()


def test_source_beyond_the_fence_is_outside(tmp_path: Path) -> None:
    rows = survey(np.repeat(orbit(16, 4.0, (15.0, 10.0)), 4, axis=0), (24.0, 10.0, 1.5), seed=5)
    report = located(tmp_path, rows, yard_m=(20.0, 20.0))
    assert report.findings == ()
    assert "outside" in {candidate.state for candidate in report.candidates}


@pytest.mark.whole
def test_bearings_along_one_line_are_not_a_finding(tmp_path: Path) -> None:
    poses = np.column_stack([np.linspace(0, 6, 40), np.full(40, 5.0), np.zeros(40)])
    report = located(tmp_path, survey(poses, (15.0, 5.0, 1.5), seed=6))
    assert (len(report.findings), len(report.candidates)) == (0, 1)


def test_four_channels_are_the_first_four_of_six(tmp_path: Path) -> None:
    poses = orbit(40, 4.0, (10.0, 10.0))
    poses[:, 2] = np.arctan2(*(SOURCE_M[k] - poses[:, k] for k in (1, 0)))  # the four elements look ahead
    assert miss_m(located(tmp_path, survey(poses, SOURCE_M, seed=7, n_elements=4))) < 0.3


@pytest.mark.whole
def test_dead_channel_is_noted_and_left_out(tmp_path: Path) -> None:
    rows = survey(np.repeat(orbit(16, 4.0, (10.0, 10.0)), 3, axis=0), SOURCE_M, seed=8)
    rows = [[*row[:6], 0.0, *row[7:]] for row in rows]
    assert miss_m(located(tmp_path, rows)) < 0.3
    data = read_field_data(tmp_path / "s.csv", noise_v=1e-3)
    assert data.notes == ("channel 3 is zero throughout: left out",)
    assert data.channels.tolist() == [0, 1, 3, 4, 5]


@pytest.mark.whole
@pytest.mark.parametrize("seed", range(2))
def test_one_source_of_a_long_survey_is_one_finding(tmp_path: Path, seed: int) -> None:
    """The first fit comes before the pulses of a new source make several findings."""
    corners_m = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [0.0, 15.0], [0.0, 0.0]])
    side_m = np.array([0.0, 20.0, 35.0, 55.0, 70.0])
    along_m = (0.2 * np.arange(4000)) % 70.0
    yaw_rad = np.array([0.0, 0.5, 1.0, -0.5])[np.searchsorted(side_m, along_m, side="right") - 1] * np.pi
    poses = np.column_stack([*(np.interp(along_m, side_m, corner_m) for corner_m in corners_m.T), yaw_rad])
    rows = survey(np.repeat(poses, 5, axis=0), (12.0, 8.0, 1.5), seed=seed)
    for k, row in enumerate(rows):
        row[0] = 0.1 * k
    report = located(tmp_path, rows)
    assert len(report.findings) == 1
    assert miss_m(report, (12.0, 8.0, 1.5)) < 0.3


@pytest.mark.whole
def test_likelihood_maps_become_rarer_over_days(tmp_path: Path) -> None:
    header, *rows = EXAMPLE.read_text().splitlines()
    hours = [f"{3600.0 * hour},{row.split(',', 1)[1]}" for hour, row in zip(range(600), cycle(rows), strict=False)]
    (tmp_path / "t.csv").write_text("\n".join([header, *hours]))
    steps = log_of_table(tmp_path / "t.csv").column("likelihood", "step")
    assert (np.diff(steps[:100]) == 1).all()  # hour by hour for four days
    assert np.diff(steps)[-10:-1].min() >= 5
    assert steps[-1] == len(hours) - 1


@pytest.mark.whole
def test_height_by_a_pattern_with_vertical_cut_is_sound(tmp_path: Path) -> None:
    """Beams that are 100 degrees high and 50 wide: the height is within its stated deviation.

    All elements have the same factor of the elevation, so that ratios of strengths hardly state the height; taken for
    round, the beams would state a wrong one.
    """
    lines = ["NAME sector"]
    for name, width_deg in (("HORIZONTAL", 50.0), ("VERTICAL", 100.0)):
        off_deg = np.minimum(np.arange(360.0), 360.0 - np.arange(360.0))
        attenuation_db = np.minimum(12.04 * np.square(off_deg / width_deg), 28.0)
        lines += [f"{name} 360", *(f"{a} {loss_db:.3f}" for a, loss_db in enumerate(attenuation_db))]
    (tmp_path / "sector.msi").write_text("\n".join(lines))
    array = HelicalArray.nominal(ArrayConfig(pattern=str(tmp_path / "sector.msi")))
    rng, source_m, rows = np.random.default_rng(3), np.array([10.0, 10.0, 3.0]), list[list[float]]()
    for k, (x, y, yaw) in enumerate(np.repeat(orbit(10, 4.5, (10.0, 10.0)), 4, axis=0)):
        strength = 0.4 * array.free_space_response(source_m, level_transform(np.array([x, y, yaw])))[0]
        rows.append([3.0 * k, x, y, np.degrees(yaw), *np.abs(strength + rng.normal(0.0, 1e-3, strength.size))])
    (finding,) = locate(write(tmp_path / "s.csv", rows), pattern=tmp_path / "sector.msi").findings
    assert np.linalg.norm(np.array(finding.position_m[:2]) - source_m[:2]) < 0.1
    assert abs(finding.position_m[2] - 3.0) < 2.0 * finding.position_std_m[2]


def test_turned_pattern_is_noted(tmp_path: Path) -> None:
    """The beam of a pattern whose zero is not the boresight is described in a note."""
    rows = [f"{a},{float(GaussianPattern()(np.radians(a - 30))):.6f}" for a in range(-180, 181)]
    (tmp_path / "turned.csv").write_text("\n".join(["angle_deg,gain", *rows]))
    notes = locate(EXAMPLE, noise_v=None, pattern=tmp_path / "turned.csv").notes
    expected = "pattern turned.csv: strongest at 30 degrees, not at 0; beam 101 degrees wide at -3 dB; front-to-back"
    assert any(note.startswith(expected) for note in notes)


@pytest.mark.whole
def test_measured_pattern_is_used(tmp_path: Path) -> None:
    """The position is that of the default pattern with a table of it, and another one with the mirrored table."""
    usual, positions_m = locate(EXAMPLE, noise_v=None).findings[0].position_m, list[FloatArray]()
    for sign in (1, -1):
        rows = [f"{a},{float(GaussianPattern()(np.radians(sign * a))):.6f}" for a in range(-179, 180, 2)]
        (tmp_path / "p.csv").write_text("\n".join(["angle_deg,gain", *rows]))
        (finding,) = locate(EXAMPLE, noise_v=None, pattern=tmp_path / "p.csv").findings
        positions_m.append(np.array(finding.position_m))
    given_m, mirrored_m = positions_m
    assert np.linalg.norm(given_m - usual) < 0.1
    assert np.linalg.norm(mirrored_m - usual) > 0.3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("none.csv", "none.csv: cannot be read"),
        ("t.csv --noise-v 1 --pattern t.csv", "t.csv"),
        ("t.csv --noise-v 1 --pattern ../flat.csv", "--pattern, --boresights-deg: `pattern` must not be flat"),
        (
            "t.csv --noise-v 1 --pattern ../sectors.csv",
            "--pattern, --boresights-deg: must distinguish all azimuths, but receives ",
        ),
        ("t.csv --noise-v 1 --boresights-deg 0", "--boresights-deg must have one number per channel, 3, got 1"),
        ("t.csv --noise-v 1 --out .", "--out: . must be a new or empty folder"),
        ("t.csv", "or --noise-v"),
    ],
)
def test_refusal_is_one_line_and_leaves_nothing(tmp_path: Path, arguments: str, message: str, refused: Refused) -> None:
    flat = "\n".join(["angle_deg,gain", *(f"{a},1" for a in range(0, 360, 10))])
    (tmp_path.parent / "flat.csv").write_text(flat)
    sectors = "\n".join(["angle_deg,gain", *(f"{a},{1 if abs(a) <= 45 else 0.1}" for a in range(-180, 180, 5))])
    (tmp_path.parent / "sectors.csv").write_text(sectors)
    (tmp_path / "t.csv").write_text("time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_3\n0,0,0,0,1,2,3\n")
    (line,) = refused("locate", *arguments.split(), cwd=tmp_path)
    assert message in line
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


def test_options_out_of_range_are_one_line_each(tmp_path: Path, refused: Refused) -> None:
    options = {
        "--boresights-deg": ["nan"],
        "--gain-error": ["-1"],
        "--position-std-m": ["101"],
        "--gate-ns": ["1e308"],
        "--yard-m": ["1e300", "5"],
        "--date": ["today"],
    }
    words = [word for option, values in options.items() for word in (option, *values)]
    lines = refused("locate", EXAMPLE, *words, cwd=tmp_path)
    assert {line.partition(":")[0] for line in lines} == set(options)
    assert list(tmp_path.iterdir()) == []
