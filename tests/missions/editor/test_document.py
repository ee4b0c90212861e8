"""Edits of the text of a scenario file."""

import tomllib
from pathlib import Path

import pytest

from pdpatrol.envs.scenario import SHIPPED, check_content
from pdpatrol.missions.editor.document import NEW_YARD, Edit, EditError, Keys, edited

EQUIPMENT = ("yard", "equipment")

YARD = """\
# a yard
[yard] # fenced
size_m = [30.0, 24.0] # outside

# the transformer
[[yard.equipment]]
name = "transformer" # the big one
kind = "power_transformer"
position_m = [15.0, 13.0] # its middle

# a box with sites of its own
[[yard.equipment]]
name = "box"
kind = "cabinet"
shape = "box"
position_m = [5.0, 13.0]
footprint_m = [1.0, 1.0]
height_m = 2.0
[yard.equipment.sites]
door = [0.5, 0.0, 1.0] # seldom closed

# where the robot drives
[route]
dock_m = [3.0, 3.0]
waypoints_m = [
  [5.0, 4.0], # first
  # far out
  [25.0, 4.0],
]

[array]

[[sources]]
name = "discharge"
sites = ["transformer/hv_bushing_1", "box/door"] # one of two

[map]
missing = ["box"]
"""
COMMENTS = [line[line.index("#") :] for line in YARD.splitlines() if "#" in line]


def made(text: str, *edits: tuple[str, Keys, str]) -> str:
    return edited(text, [Edit.model_validate({"operation": o, "path": p, "value": v}) for o, p, v in edits])


def changed_lines(before: str, after: str) -> tuple[set[str], set[str]]:
    """Return the lines that were removed and added."""
    old, new = before.split("\n"), after.split("\n")
    return set(old) - set(new), set(new) - set(old)


@pytest.mark.parametrize(
    ("path", "value", "old", "new"),
    [
        ((*EQUIPMENT, 0, "position_m"), "[15.5, 12.0]", "[15.0, 13.0]", "[15.5, 12.0]"),
        ((*EQUIPMENT, 0, "kind"), "gis_bay", '"power_transformer"', '"gis_bay"'),
        ((*EQUIPMENT, 1, "sites", "door"), "[0.5, 0.1, 1.0]", "[0.5, 0.0, 1.0]", "[0.5, 0.1, 1.0]"),
        (("yard", "size_m"), "[31.0, 24.0]", "[30.0, 24.0]", "[31.0, 24.0]"),
        (("route", "waypoints_m", 1), "[24.0, 4.0]", "[25.0, 4.0]", "[24.0, 4.0]"),
        (("route", "waypoints_m"), "[[5.0, 4.0], [24.0, 4.0]]", "[25.0, 4.0]", "[24.0, 4.0]"),
    ],
)
def test_replaced_value_is_all_that_changes(path: Keys, value: str, old: str, new: str) -> None:
    assert made(YARD, ("set", path, value)) == YARD.replace(old, new)


@pytest.mark.parametrize(
    ("path", "value", "line", "before"),
    [
        ((*EQUIPMENT, 0, "yaw_deg"), "90.0", "yaw_deg = 90.0", "# a box with sites of its own"),
        ((*EQUIPMENT, 1, "yaw_deg"), "90.0", "yaw_deg = 90.0", "[yard.equipment.sites]"),
        (("yard", "fence_m"), "[[0.0, 0.0]]", "fence_m = [[0.0, 0.0]]", "# the transformer"),
        (("sources", 0, "kind"), "void", 'kind = "void"', "[map]"),
    ],
)
def test_new_key_stands_in_its_table_above_later_comments(path: Keys, value: str, line: str, before: str) -> None:
    after = made(YARD, ("set", path, value))
    assert changed_lines(YARD, after) == (set(), {line})
    lines = [text for text in after.split("\n") if text]
    assert lines[lines.index(line) + 1] == before
    assert made(after, ("remove", path, "")) == YARD


def test_new_pieces_and_sources_stand_after_the_last_ones() -> None:
    piece, source = '{ name = "vt", kind = "voltage_transformer", position_m = [9.0, 9.5] }', '{ name = "second" }'
    after = made(YARD, ("insert", (*EQUIPMENT, 2), piece), ("insert", ("sources", 1), source))
    added = '\n[[yard.equipment]]\nname = "vt"\nkind = "voltage_transformer"\nposition_m = [9.0, 9.5]\n'
    assert after == YARD.replace("closed\n", "closed\n" + added).replace(
        "two\n", 'two\n\n[[sources]]\nname = "second"\n'
    )
    assert made(after, ("remove", (*EQUIPMENT, 2), ""), ("remove", ("sources", 1), "")) == YARD


def test_removed_pieces_take_no_comment_between_tables_with_them() -> None:
    after = made(YARD, ("remove", (*EQUIPMENT, 1), ""), ("remove", (*EQUIPMENT, 0), ""))
    assert "equipment" not in tomllib.loads(after)["yard"]
    assert [text for text in COMMENTS if text not in after] == ["# the big one", "# its middle", "# seldom closed"]
    again = made(after, ("insert", (*EQUIPMENT, 0), '{ name = "new", kind = "kerb" }'))
    assert tomllib.loads(again)["yard"]["equipment"] == [{"name": "new", "kind": "kerb"}]


def test_waypoints_are_inserted_and_removed_within_their_layout() -> None:
    after = made(
        YARD, ("insert", ("route", "waypoints_m", 1), "[9.0, 4.0]"), ("remove", ("route", "waypoints_m", 2), "")
    )
    assert tomllib.loads(after)["route"]["waypoints_m"] == [[5.0, 4.0], [9.0, 4.0]]
    assert changed_lines(YARD, after) == ({"  [25.0, 4.0],"}, {"  [9.0, 4.0],"})


def test_renamed_piece_keeps_its_sources_and_its_error_on_the_map() -> None:
    after = made(YARD, ("rename", (*EQUIPMENT, 1), "kiosk"), ("rename", (*EQUIPMENT, 0), "t1"))
    data = tomllib.loads(after)
    assert [piece["name"] for piece in data["yard"]["equipment"]] == ["t1", "kiosk"]
    assert data["sources"][0]["sites"] == ["t1/hv_bushing_1", "kiosk/door"]
    assert data["map"]["missing"] == ["kiosk"]
    assert all(text in after for text in COMMENTS)


@pytest.mark.parametrize("name", ["switchyard", "transformer_bay", "gis_hall", "bench"])
def test_piece_moved_there_and_back_leaves_the_file_as_it_was(name: str) -> None:
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    for k, piece in enumerate(tomllib.loads(text)["yard"]["equipment"]):
        (x, y), place = piece["position_m"], (*EQUIPMENT, k, "position_m")
        there = made(text, ("set", place, f"[{x + 1.5}, {y}]"))
        removed, added = changed_lines(text, there)
        assert (len(removed), len(added)) == (1, 1)
        assert made(there, ("set", place, f"[{x}, {y}]")) == text


def test_rows_of_an_array_keep_their_layout() -> None:
    rows = ['  { name = "a", kind = "kerb" }, # first', "", "  # then", '  { name = "b", kind = "kerb" },']
    text = "\n".join(["[yard]", "equipment = [", *rows, "]", ""])
    after = made(
        text,
        ("set", (*EQUIPMENT, 0, "yaw_deg"), "90.0"),
        ("remove", (*EQUIPMENT, 1, "kind"), ""),
        ("insert", (*EQUIPMENT, 2), '{ name = "c" }'),
    )
    expected = text.replace('kerb" }, # first', 'kerb", yaw_deg = 90.0 }, # first').replace('b", kind = "kerb"', 'b"')
    assert after == expected.replace("\n]", '\n  { name = "c" },\n]')


def test_line_ends_and_byte_order_mark_are_kept() -> None:
    text = "\ufeff" + YARD.replace("\n", "\r\n")
    after = made(text, ("set", ("route", "dwell_s"), "2.0"), ("insert", ("route", "waypoints_m", 1), "[9.0, 4.0]"))
    assert after.startswith("\ufeff#")
    assert after.count("\n") == after.count("\r\n") == text.count("\n") + 2


def test_text_that_is_not_toml_is_a_string() -> None:
    after = made(YARD, ("set", (*EQUIPMENT, 0, "kv"), "110 or more"), ("set", ("route", "dwell_s"), '"'))
    assert tomllib.loads(after)["yard"]["equipment"][0]["kv"] == "110 or more"
    assert tomllib.loads(after)["route"]["dwell_s"] == '"'


@pytest.mark.parametrize(
    ("text", "operation", "path"),
    [
        (YARD, "set", (*EQUIPMENT, 2, "kv")),
        (YARD, "set", ("nowhere", "kv")),
        (YARD, "remove", (*EQUIPMENT, 0, "kv")),
        (YARD, "insert", (*EQUIPMENT, 0)),
        (YARD, "insert", ("route", "dock_m", "x")),
        ("yard.size_m = [1.0, 2.0]\n", "set", ("yard", "fence_m")),
        ('about = """\n[[sources]]\nx\n# """\n[[sources]]\nname = "a"\n', "remove", ("sources", 0)),
    ],
)
def test_edit_that_the_layout_does_not_allow_is_refused_in_one_line(text: str, operation: str, path: Keys) -> None:
    with pytest.raises(EditError, match=r"^[a-z0-9_.]+: cannot be changed in the layout of this file") as error:
        made(text, (operation, path, "1"))
    assert "\n" not in str(error.value)


def test_new_yard_is_valid(tmp_path: Path) -> None:
    assert check_content(NEW_YARD.encode(), tmp_path / "new.toml").name == "new"
