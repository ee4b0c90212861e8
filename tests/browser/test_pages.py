"""Viewer, report, trend and reproduction in a browser, in both themes."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pdpatrol.missions.cli.mission_files import write_mission
from tests.browser.browser import (
    NEEDS_CHROMIUM,
    Theme,
    keep,
    keep_replay,
    n_colours,
    opened,
    picture,
    picture_when,
)
from tests.missions.replay.short_mission import short_mission
from tests.missions.replay.test_viewer import read_address, started
from tests.processes import pdpatrol

pytestmark = [
    pytest.mark.whole,
    NEEDS_CHROMIUM,
    pytest.mark.filterwarnings("default"),  # psutil leaves files open if a process ends while it is inspected
]

WIDTHS_PX = (1280, 1920, 390)

OUTSIDE = """() => [...document.querySelectorAll('body *')].filter(element => {
  const box = element.getBoundingClientRect();
  if (box.width === 0 || box.right <= document.documentElement.clientWidth + 1) return false;
  for (let outer = element.parentElement; outer; outer = outer.parentElement)
    if (getComputedStyle(outer).overflowX !== 'visible') return false;
  return true;
}).map(element => `${element.tagName} ${element.textContent.slice(0, 40)}`)"""
"""Elements that end to the right of the screen and are not within a box that scrolls."""

MIDDLE, DRAWN_COLOURS = (slice(150, 450), slice(150, 800)), 400
"""Part of the picture with the yard, and its smallest number of colours; before it is drawn, it has one colour."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two missions with a confirmed finding each, their reports and trend, and a reproduction."""
    folder = tmp_path_factory.mktemp("browser") / "schöne Missionen 1"
    for date in ("2026-03-02", "2026-03-09"):
        (folder / date).mkdir(parents=True)
        write_mission(short_mission(60.0, date=date), 0.0, folder / date)
    done = pdpatrol("trend", "2026-03-02", "2026-03-09", "--out", "trend", cwd=folder)
    assert done.returncode == 0, done.stderr
    done = pdpatrol("reproduce", "--trials", "100", "--out", "reproduction", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


def has_drawn(seen: NDArray[np.uint8]) -> bool:
    return n_colours(seen[MIDDLE]) > DRAWN_COLOURS


def test_replay_in_a_browser_draws_the_mission(folder: Path) -> None:
    with started("replay", "2026-03-02", "--web", cwd=folder) as process:
        with opened(f"{read_address(process)}&renderer=webgl", "light") as (page, errors):
            assert has_drawn(picture_when(page, "replay-one_source-loaded", has_drawn))
            keep_replay(page, "replay-one_source")
        assert errors == []


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("2026-03-02/report.html", "one_source"),
        ("trend/trend.html", "one_source"),
        ("reproduction/reproduction.html", "Dir-MUSIC"),
    ],
)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_page_shows_text_and_pictures_and_loads_nothing(name: str, title: str, theme: Theme, folder: Path) -> None:
    file = folder / name
    with opened(file.as_uri(), theme) as (page, errors):
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.reload()
        words, height = page.inner_text("body"), page.evaluate("document.body.scrollHeight")
        drawn = page.evaluate("[...document.querySelectorAll('img')].filter(x => x.clientHeight > 50).length")
        for width in WIDTHS_PX:
            page.set_viewport_size({"width": width, "height": 900})
            assert n_colours(picture(page, f"{file.stem}-{width}-{theme}")) > 50
            assert page.evaluate("document.documentElement.scrollWidth") == width
            assert page.evaluate(OUTSIDE) == []
            keep(page, f"{file.stem}-{width}-{theme}-whole", is_whole=True)
    assert title in words
    assert drawn >= 1
    assert height > 500
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    assert errors == []


A4_WIDTH_PX, A4_HEIGHT_PX = 680, 1005
"""Text area of the first page of A4, at 96 pixels per inch."""


def test_report_reads_on_a_phone_and_states_actions_on_page_1(folder: Path) -> None:
    with opened((folder / "2026-03-02" / "report.html").as_uri(), "light") as (page, _):
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        outside = "[...document.querySelectorAll('#actions *')].filter(x => x.getBoundingClientRect().right > 390)"
        assert page.evaluate(f"{outside}.length") == 0
        page.set_viewport_size({"width": A4_WIDTH_PX, "height": A4_HEIGHT_PX})
        page.emulate_media(media="print")
        for name in ("#actions", "#sign-off"):
            bottom_px = page.evaluate(f"document.querySelector('{name}').getBoundingClientRect().bottom")
            assert bottom_px < A4_HEIGHT_PX, name
