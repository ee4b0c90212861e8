"""Pictures of scenarios and plans: all equipment is named, no two texts overlap, and no file is replaced."""

from itertools import combinations
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from pdpatrol.envs.scenario import load_scenario
from pdpatrol.envs.scenario.scenario import Scenario
from pdpatrol.envs.substation.substation import SubstationParameters, draw_substation
from pdpatrol.envs.substation.substation_file import substation_text
from pdpatrol.missions.planning.output import draw_plan
from pdpatrol.missions.scenario_picture import draw_scenario
from tests.missions.conftest import Refused, call
from tests.missions.planning.one_plan import plan_of

pytestmark = pytest.mark.whole

YARD = """
[yard]
fence_m = [[0.0, 0.0], [40.0, 0.0], [40.0, 20.0], [30.0, 26.0], [0.0, 26.0]]
equipment = [
  { name = "transformer_1", kind = "power_transformer", position_m = [9.0, 12.0] },
  { name = "transformer_2", kind = "power_transformer", position_m = [20.0, 12.0] },
  { name = "breaker_1", kind = "circuit_breaker", position_m = [29.0, 8.0] },
  { name = "ct_l1", kind = "current_transformer", position_m = [29.0, 13.0] },
  { name = "ct_l2", kind = "current_transformer", position_m = [31.0, 13.0] },
  { name = "ct_l3", kind = "current_transformer", position_m = [33.0, 13.0] },
  { name = "vt_1", kind = "voltage_transformer", position_m = [26.0, 18.0] },
  { name = "vt_2", kind = "voltage_transformer", position_m = [28.0, 18.0] },
  { name = "cabinet_1", kind = "cabinet", BOX, position_m = [5, 20] },
  { name = "cabinet_2", kind = "cabinet", BOX, position_m = [6.3, 20] },
  { name = "cabinet_3", kind = "cabinet", BOX, position_m = [7.6, 20] },
  { name = "wall_1", kind = "wall", WALL, position_m = [14.5, 12.0] },
]
[map]
missing = ["cabinet_2"]
moved = [{ name = "breaker_1", by_m = [0.8, -0.9] }]
extra = [{ name = "shed", kind = "building", BOX, position_m = [17.0, 22.0] }]
[route]
dock_m = [3.0, 3.0]
waypoints_m = [[14.5, 4.0], [25.0, 5.0], [36.0, 5.0], [36.0, 16.0], [23.0, 20.0], [12.0, 20.0], [14.5, 4.0]]
[[zones]]
name = "walkway"
polygon_m = [[10.0, 1.0], [20.0, 1.0], [20.0, 3.0], [10.0, 3.0]]
limit_mps = 0.3
[georeference]
latitude_deg = 50.0
longitude_deg = 8.0
heading_deg = 30.0
[array]
[[sources]]
name = "tank"
position_m = [20.0, 16.5, 1.5]
[[sources]]
name = "either"
sites = ["transformer_1/*"]
[[interferers]]
name = "tram"
position_m = [-30.0, 5.0, 3.0]
amplitude_v = 1.0
[[interferers]]
name = "drill"
position_m = [35.0, 2.0, 1.0]
amplitude_v = 1.0
[nature.pose_sensor]
frame_offset_m = [0.3, 0.1]
[[nature.moving]]
name = "fitter"
kind = "person"
path_m = [[24.0, 3.0], [38.0, 3.0], [38.0, 15.0]]
speed_mps = 1.0
"""
"""Twelve pieces, of which the map shows one elsewhere and one not at all; two phases of a current transformer share a
name."""


def small_yard(folder: Path) -> Scenario:
    box, wall = 'shape = "box", footprint_m = [1.0, 0.6], height_m = 1.8', 'shape = "box", footprint_m = [0.3, 9.0]'
    text = YARD.replace("BOX", box).replace("WALL", f"{wall}, height_m = 4.0")
    (folder / "yard.toml").write_text(text, encoding="utf-8")
    return load_scenario(folder / "yard.toml")


@pytest.fixture(scope="module")
def large_yard(tmp_path_factory: pytest.TempPathFactory) -> Figure:
    """Draw the substation of 328 pieces on 224 x 222 m."""
    folder = tmp_path_factory.mktemp("large")
    substation = draw_substation(SubstationParameters(400, "breaker_and_a_half", 18, 5))
    (folder / "site.toml").write_text(substation_text(substation, 3), encoding="utf-8")
    scenario = load_scenario(folder / "site.toml")
    assert len(scenario.yard.equipment) == 328
    return draw_scenario(scenario)


def texts_of(figure: Figure) -> list[Text]:
    """Return all texts that are shown, without the numbers at the axes."""
    figure.draw_without_rendering()
    both = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    ticks = {label for axis in both for label in axis.get_ticklabels(which="both")}
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text) and text not in ticks]
    return [text for text in texts if text.get_visible() and text.get_text()]


def assert_texts_do_not_overlap(figure: Figure) -> None:
    boxes = {text: text.get_window_extent() for text in texts_of(figure)}
    overlapping = [
        (one.get_text(), other.get_text()) for one, other in combinations(boxes, 2) if boxes[one].overlaps(boxes[other])
    ]
    assert overlapping == []
    frame = figure.bbox.padded(0.5)
    within = {text for text, box in boxes.items() if frame.x0 < box.x0 < box.x1 < frame.x1}
    outside = [text.get_text() for text, box in boxes.items() if not frame.y0 < box.y0 < box.y1 < frame.y1]
    outside += [text.get_text() for text in boxes if text not in within]
    assert outside == []


def test_small_yard_names_everything_without_overlaps(tmp_path: Path) -> None:
    figure = draw_scenario(small_yard(tmp_path))
    assert_texts_do_not_overlap(figure)
    shown = [text.get_text() for text in texts_of(figure)]
    names = {
        *("transformer_1", "transformer_2", "breaker_1", "ct", "vt_1", "vt_2", "wall_1"),
        *("cabinet_1", "cabinet_2", "cabinet_3", "shed: only on the map", "breaker_1 on the map"),
        *("walkway, 0.3 m/s", "fitter", "tank", "drill", "5 m", "fence", "discharge site", "dock", "route"),
        *("1", "2", "3", "4", "5", "6", "source either, at one of 5 sites", "not on the robot's map"),
    }
    assert names - {text.strip() for text in shown} == set()
    assert "7" not in shown  # where the first waypoint is
    (title,) = (text for text in shown if text.startswith("yard: 40 x 26 m"))
    assert "tram: outside the yard, at (-30, 5, 3) m" in title
    assert "pose_sensor.frame_offset_m = [0.3, 0.1]" in title


def test_large_yard_names_every_bay_and_most_pieces_without_overlaps(large_yard: Figure) -> None:
    assert_texts_do_not_overlap(large_yard)
    shown = [text.get_text() for text in texts_of(large_yard)]
    bays = {*(f"d{k:02}" for k in range(1, 10)), *(f"e{k:02}" for k in range(1, 19))}
    assert bays - set(shown) == set()
    for piece in ("qa1", "qa2", "qa3", "qb2", "qb3", "qb4", "qb5", "bc1", "bc2", "bc3"):
        assert shown.count(piece) == 9


def test_picture_of_a_plan_states_the_tour_without_overlaps() -> None:
    figure = draw_plan(plan_of("one_source"))
    assert_texts_do_not_overlap(figure)
    assert "82 m; at most 0.0 % longer than the shortest" in figure.get_suptitle().replace("\n", " ")


def test_picture_is_written_next_to_the_file_and_never_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    small_yard(tmp_path / "folder")
    call("scenarios", "folder/yard.toml", "--picture")
    assert "Written: folder/yard.png" in capsys.readouterr().out
    call("scenarios", "one_source", "--picture", "other.png")
    capsys.readouterr()
    pictures = [tmp_path / "folder" / "yard.png", tmp_path / "other.png"]
    before = [picture.read_bytes() for picture in pictures]
    assert all(content.startswith(b"\x89PNG") for content in before)
    for words, given in (
        (["folder/yard.toml", "--picture"], "folder/yard.png"),
        (["one_source", "--picture", "other.png"], "other.png"),
        (["one_source", "--picture", "plan.svg"], "plan.svg"),
        (["one_source", "--picture", "nowhere/plan.png"], "nowhere/plan.png"),
    ):
        (line,) = refused("scenarios", *words, cwd=tmp_path)
        assert line == f"--picture: must be a new .png file in an existing folder, got {given}"
    assert [picture.read_bytes() for picture in pictures] == before
    assert {path.name for path in tmp_path.iterdir()} == {"folder", "other.png"}
    (line,) = refused("scenarios", "--picture", cwd=tmp_path)
    assert "needs a scenario" in line
