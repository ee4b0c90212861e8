"""Viewer, report and trend in a browser, in both themes."""

import re
from pathlib import Path

import numpy as np
import psutil
import pytest
from numpy.typing import NDArray

from pdpatrol.missions.cli.mission_files import write_mission
from tests.browser.browser import NEEDS_CHROMIUM, Theme, n_colours, opened, picture, picture_when
from tests.missions.replay.short_mission import pdpatrol, short_mission
from tests.missions.replay.test_viewer import started

pytestmark = [
    pytest.mark.whole,
    NEEDS_CHROMIUM,
    pytest.mark.filterwarnings("default"),  # psutil leaves files open if a process ends while it is inspected
]

MIDDLE, DRAWN_COLOURS = (slice(150, 450), slice(150, 800)), 400
"""Where the yard is drawn, and its smallest number of colours; before it is drawn, it has one colour."""


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("browser") / "schöne Mission"
    folder.mkdir()
    short_mission(12.0).save(folder)
    return folder


def address(process: psutil.Popen) -> str:
    assert process.stdout is not None
    (url,) = re.findall(r"http://\S+", process.stdout.readline())
    return url


def has_drawn(seen: NDArray[np.uint8]) -> bool:
    return n_colours(seen[MIDDLE]) > DRAWN_COLOURS


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_replay_in_a_browser_draws_the_mission(mission: Path, theme: Theme) -> None:
    with started("replay", mission.name, "--web", cwd=mission.parent, on_screen=False) as process:
        with opened(f"{address(process)}&renderer=webgl", theme) as (page, errors):
            seen = picture_when(page, f"replay-{theme}", has_drawn)
        assert has_drawn(seen)
        frame = float(seen[:20].mean())  # the bar at the top
        assert frame > 200 if theme == "light" else frame < 60
        assert errors == []


def write_report(folder: Path) -> Path:
    write_mission(short_mission(12.0), 0.0, folder)
    return folder / "report.html"


def write_trend_page(folder: Path) -> Path:
    for date in ("2026-03-02", "2026-03-09"):
        (folder / date).mkdir()
        short_mission(45.0, date=date).save(folder / date)
    done = pdpatrol("trend", "2026-03-02", "2026-03-09", "--out", "trend", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "trend" / "trend.html"


PAGES = {"report": write_report, "trend": write_trend_page}
"""Functions that write a page into a folder."""


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_page_shows_text_and_pictures_and_loads_nothing(name: str, theme: Theme, tmp_path: Path) -> None:
    folder = tmp_path / "Prüfung 1"
    folder.mkdir()
    file = PAGES[name](folder)
    with opened(file.as_uri(), theme) as (page, errors):
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.reload()
        seen = picture(page, f"{name}-{theme}")
        words, height = page.inner_text("body"), page.evaluate("document.body.scrollHeight")
        drawn = page.evaluate("[...document.querySelectorAll('img')].filter(x => x.clientHeight > 50).length")
    assert "one_source" in words
    assert drawn >= 1
    assert height > 500
    assert n_colours(seen) > 50
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    assert errors == []
