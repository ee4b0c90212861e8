"""A yard is drawn in the editor, saved, checked, planned and run, in a browser."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from pdpatrol.envs.scenario import SHIPPED, load_scenario
from tests.browser.browser import NEEDS_CHROMIUM, Opened, Theme, n_colours, opened, picture
from tests.missions.editor.test_view import LINES
from tests.missions.replay.test_viewer import end, read_address, started
from tests.processes import pdpatrol

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = [
    pytest.mark.whole,
    NEEDS_CHROMIUM,
    pytest.mark.filterwarnings("default"),  # psutil leaves files open if a process ends while it is inspected
]

PIECES = {
    "busbar": [(20.0, 25.0)],
    "disconnector_centre_break": [(12.0, 18.5), (28.0, 18.5)],
    "circuit_breaker": [(12.0, 15.0), (28.0, 15.0)],
    "current_transformer": [(10.0, 11.0), (12.2, 11.0), (14.4, 11.0)],
    "voltage_transformer": [(25.0, 11.0)],
    "surge_arrester": [(12.2, 7.0)],
    "power_transformer": [(28.0, 6.5)],
    "control_building": [(35.0, 25.0)],
}
"""Places of the pieces of the drawn yard, by kind."""

SWITCHYARD = SHIPPED / "switchyard.toml"

STOPS_M = ((20.0, 5.0), (20.0, 13.0), (6.0, 13.0))

AT_110_KV = {kind for kind in PIECES if kind != "control_building"}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """Serve a scenario file to all tests, and return its path and the address."""
    file = tmp_path_factory.mktemp("editor") / "yard.toml"
    file.write_bytes(SWITCHYARD.read_bytes())
    with started("edit", file.name, "--no-open", cwd=file.parent) as process:
        yield file, read_address(process)


@pytest.fixture
def yard(served: tuple[Path, str]) -> Path:
    """Return the path of the served file, which is a copy of a shipped scenario again."""
    served[0].write_bytes(SWITCHYARD.read_bytes())
    return served[0]


@pytest.fixture
def editor(yard: Path, served: tuple[Path, str]) -> Iterator[Opened]:
    """Open the editor of `yard`."""
    with opened(served[1], "light") as (page, errors):
        page.wait_for_selector("#check b")
        yield Opened(page, errors)


def pixel(page: Page, place_m: Sequence[float]) -> tuple[float, float]:
    """Return the place in the window of a place in the yard."""
    at = page.evaluate(
        "([x, y]) => { const p = new DOMPoint(x, -y).matrixTransform(document.querySelector('svg').getScreenCTM());"
        " return [p.x, p.y]; }",
        list(place_m),
    )
    return at[0], at[1]


def click(page: Page, place_m: Sequence[float]) -> None:
    page.mouse.click(*pixel(page, place_m))
    settle(page)


def drag(page: Page, from_m: Sequence[float], to_m: Sequence[float]) -> None:
    page.mouse.move(*pixel(page, from_m))
    page.mouse.down()
    page.mouse.move(*pixel(page, to_m), steps=4)
    page.mouse.up()
    settle(page)


def settle(page: Page) -> None:
    """Wait for the answers to all edits."""
    page.evaluate("queue")


def fill(page: Page, key: str, value: str) -> None:
    page.fill(f"#panel [name={key}]", value)
    page.press(f"#panel [name={key}]", "Enter")
    settle(page)


def save(page: Page) -> None:
    page.click("#save")
    settle(page)
    assert page.inner_text("#saved") == "saved"


def equipment(file: Path) -> dict[str, dict[str, Any]]:
    return {piece["name"]: piece for piece in tomllib.loads(file.read_text(encoding="utf-8"))["yard"]["equipment"]}


def test_yard_of_twelve_pieces_is_drawn_saved_checked_planned_and_run(tmp_path: Path) -> None:
    file = tmp_path / "new.toml"
    with started("edit", "new.toml", "--no-open", cwd=tmp_path) as process:
        with opened(read_address(process), "light") as (page, errors):
            page.wait_for_selector("#check b")
            page.select_option("#kv", "110")
            page.click("#piece")
            for kind, places_m in PIECES.items():
                page.select_option("#kind", kind)
                for place_m in places_m:
                    click(page, place_m)
            page.press("svg", "Escape")
            assert page.locator("g.piece").count() == 12

            click(page, PIECES["power_transformer"][0])
            fill(page, "name", "t1")
            page.click("text=Turn by 90°")
            settle(page)
            page.click("#panel button:text-is('hv_bushing_2')")
            settle(page)
            fill(page, "name", "crack")
            page.select_option("#panel [name=kind]", "void")
            settle(page)
            page.click("#waypoint")
            for place_m in STOPS_M:
                click(page, place_m)
            picture(page, "editor-drawn")
            save(page)
        assert errors == []
        assert end(process).splitlines() == ["Interrupted"]
        assert process.returncode == 130
    drawn = equipment(file)
    assert len(drawn) == 12
    for kind, places_m in PIECES.items():
        pieces = [piece for piece in drawn.values() if piece["kind"] == kind]
        np.testing.assert_allclose([piece["position_m"] for piece in pieces], places_m, atol=1e-9)
        assert all(piece.get("kv") == (110 if kind in AT_110_KV else None) for piece in pieces)
    assert drawn["t1"]["yaw_deg"] == 90.0
    assert load_scenario(file).route.stops_m == STOPS_M
    (source,) = load_scenario(file).sources
    assert (source.name, source.kind, source.sites) == ("crack", "void", ("t1/hv_bushing_2",))

    assert "no errors; 1 source," in pdpatrol("scenarios", "new.toml", cwd=tmp_path).stdout
    planned = pdpatrol("plan", "new.toml", "--out", "plan", cwd=tmp_path)
    assert planned.returncode == 0, planned.stderr
    with file.open("a", encoding="utf-8") as text:
        text.write("\n[task]\ntime_limit_s = 5.0\n")
    ran = pdpatrol("run", "new.toml", "--out", "run", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "run" / "report.html").exists()


def test_dragging_moves_what_was_dragged_by_its_metres(editor: Opened, yard: Path) -> None:
    page, errors = editor
    before = tomllib.loads(yard.read_text(encoding="utf-8"))
    (x, y), dock_m, stop_m = (
        equipment(yard)["ct_1_b"]["position_m"],
        before["route"]["dock_m"],
        before["route"]["waypoints_m"][1],
    )
    drag(page, (x, y - 0.1), (x + 1.04, y - 2.1))
    drag(page, dock_m, (dock_m[0] - 2.0, dock_m[1] + 1.0))
    drag(page, stop_m, (stop_m[0] + 0.5, stop_m[1]))
    save(page)
    after = tomllib.loads(yard.read_text(encoding="utf-8"))
    assert equipment(yard)["ct_1_b"]["position_m"] == pytest.approx([x + 1.0, y - 2.0])
    assert after["route"]["dock_m"] == pytest.approx([dock_m[0] - 2.0, dock_m[1] + 1.0], abs=0.051)
    assert after["route"]["waypoints_m"][1] == pytest.approx([stop_m[0] + 0.5, stop_m[1]], abs=0.051)
    lines = [text.split("\n") for text in (SWITCHYARD.read_text(encoding="utf-8"), yard.read_text(encoding="utf-8"))]
    assert len(lines[0]) == len(lines[1])
    assert sum(a != b for a, b in zip(*lines, strict=True)) == 3
    assert errors == []


def test_waypoints_and_sources_are_added_moved_and_removed(editor: Opened, yard: Path) -> None:
    page, errors = editor
    n_stops = len(load_scenario(yard).route.stops_m)
    page.click("#waypoint")
    click(page, (12.0, 2.0))
    page.press("svg", "Escape")
    click(page, load_scenario(yard).route.stops_m[0])
    page.press("svg", "Delete")
    settle(page)
    click(page, equipment(yard)["vt_3_c"]["position_m"])
    page.click("#panel button:text-is('terminal_box')")
    settle(page)
    sites_m = {
        site: load_scenario(yard).yard.site_position(site)[:2].tolist()
        for site in ("vt_3_c/terminal_box", "vt_3_b/terminal_box")
    }
    drag(page, sites_m["vt_3_c/terminal_box"], sites_m["vt_3_b/terminal_box"])
    save(page)
    after = load_scenario(yard)
    assert len(after.route.stops_m) == n_stops
    assert after.route.stops_m[-1] == pytest.approx((12.0, 2.0), abs=0.051)
    assert after.sources[-1].sites == ("vt_3_b/terminal_box",)
    assert errors == []


def test_zones_people_and_interferers_are_shown_and_moved(served: tuple[Path, str]) -> None:
    file, address = served
    text = (SHIPPED / "quiet_yard.toml").read_text(encoding="utf-8") + LINES
    file.write_text(text, encoding="utf-8")
    with opened(address, "light") as (page, errors):
        page.wait_for_selector("#check b")
        picture(page, "editor-lines")
        for name in ("gravel", "gardener", "tram_line"):
            assert page.locator(f"#names text:text-is('{name}')").count() == 1
        drag(page, (9.0, 2.5), (10.0, 3.0))
        drag(page, (8.0, 15.0), (7.5, 15.0))
        drag(page, (62.0, 12.0), (60.0, 15.0))
        save(page)
    after = load_scenario(file)
    np.testing.assert_allclose(after.zones[0].polygon_m, [(10.0, 1.5), (15.0, 1.5), (15.0, 4.5), (10.0, 4.5)])
    np.testing.assert_allclose(after.nature.moving[0].path_m, [(3.5, 15.0), (11.5, 15.0), (11.5, 21.0)])
    assert after.interferers[0].position_m == pytest.approx((60.0, 15.0, 6.0))
    assert errors == []


def test_errors_are_shown_and_keep_the_file_from_being_saved(editor: Opened, yard: Path) -> None:
    page, errors = editor
    x, y = equipment(yard)["ct_1_b"]["position_m"]
    drag(page, (x, y), (-1.0, y))
    shown = page.inner_text("#check")
    assert "ct_1_b" in shown
    assert "beyond the fence" in shown
    assert page.is_disabled("#save")
    picture(page, "editor-error")
    page.click("#undo")
    settle(page)
    assert page.inner_text("#check") == "No errors"
    page.evaluate("save()")
    settle(page)
    assert yard.read_bytes() == SWITCHYARD.read_bytes()
    assert errors == []


def test_file_changed_meanwhile_is_not_overwritten(editor: Opened, yard: Path) -> None:
    page, _ = editor
    drag(page, equipment(yard)["ct_1_b"]["position_m"], (9.0, 14.0))
    changed = yard.read_text(encoding="utf-8") + "# changed elsewhere\n"
    yard.write_text(changed, encoding="utf-8")
    page.click("#save")
    settle(page)
    assert "has changed on disk" in page.inner_text("#check")
    assert page.inner_text("#saved") == "not saved"
    assert yard.read_text(encoding="utf-8") == changed


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_page_fits_its_window_in_both_themes(theme: Theme, yard: Path, served: tuple[Path, str]) -> None:
    with opened(served[1], theme) as (page, errors):
        for width in (1280, 1920, 390):
            page.wait_for_selector("#check b")
            page.set_viewport_size({"width": width, "height": 800})
            page.click("#zoom :nth-child(3)")
            page.click("#panel button:text-is('breaker_1')")
            seen = picture(page, f"editor-{theme}-{width}")
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert n_colours(seen) > 100
            assert (seen[:20].mean() > 200) == (theme == "light")
            page.reload()
    assert errors == []
