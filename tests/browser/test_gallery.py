"""Replays of the gallery in a browser, as the documentation serves them."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.browser.browser import (
    NEEDS_CHROMIUM,
    Theme,
    ThrottledHandler,
    assert_theme,
    keep_replay,
    n_colours,
    opened,
    picture_when,
    served,
)
from tests.docs.site import ROOT, build_site

pytest.importorskip("zensical", reason="uv run --group docs")
pytestmark = [
    pytest.mark.whole,
    NEEDS_CHROMIUM,
    pytest.mark.filterwarnings("default"),  # connections that the browser leaves open
]

GALLERY = runpy.run_path(str(ROOT / "docs" / "make_gallery.py"))
MAX_BYTES = 3_000_000
"""Largest recording that a visitor should have to load."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the built pages with their replays."""
    folder = build_site(tmp_path_factory.mktemp("gallery"))
    GALLERY["make_gallery"](folder)
    return folder


def has_drawn(seen: NDArray[np.uint8]) -> bool:
    """Return whether the yard is drawn; the empty plan has one colour."""
    return n_colours(seen[200:500, 600:1100]) > 400


def test_recordings_are_small_and_the_page_states_how_they_are_made(site: Path) -> None:
    sizes = {file.stem: file.stat().st_size for file in (site / "replay").glob("*.rrd")}
    assert set(sizes) == set(GALLERY["MISSIONS"])
    assert max(sizes.values()) < MAX_BYTES, sizes
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    for name, arguments in GALLERY["MISSIONS"].items():
        assert f"uv run pdpatrol {arguments}\n" in page.partition(f'data-recording="{name}"')[2].partition("###")[0]


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_click_on_a_picture_replays_the_mission(theme: Theme, site: Path) -> None:
    """The viewer is loaded after the click, and has the theme of the page."""
    with served(site) as url, opened(f"{url}/gallery.html", theme) as (page, errors):
        page.set_viewport_size({"width": 1600, "height": 1000})
        page.wait_for_load_state("networkidle")
        loaded = page.evaluate("performance.getEntriesByType('resource').map(entry => entry.name)")
        assert loaded
        assert [address for address in loaded if address.startswith(f"{url}/replay/")] == []
        page.click("[data-recording=two_sources]")
        page.wait_for_url("**/replay/index.html*two_sources.rrd*")
        seen = picture_when(page, f"gallery-clicked-{theme}", has_drawn)
        assert has_drawn(seen)
        assert_theme(seen, theme)
        assert errors == []


@pytest.mark.parametrize("name", GALLERY["MISSIONS"])
def test_replay_is_drawn_in_all_widths_and_themes(name: str, site: Path) -> None:
    with served(site) as url:
        address = f"{url}/replay/index.html?hide_welcome_screen&renderer=webgl&url={url}/replay/{name}.rrd"
        with opened(address, "light") as (page, errors):
            assert has_drawn(picture_when(page, f"replay-{name}-loaded", has_drawn))
            keep_replay(page, f"replay-{name}")
            assert errors == []


def shows_yard_robot_and_phases(seen: NDArray[np.uint8]) -> bool:
    """Return whether a picture in the dark theme has the plan, the dark body of the robot and the bar of phases."""
    robot_view, bar = seen[70:530, 10:520], seen[614, 5:1185].astype(int)
    robot_share = float((robot_view.max(axis=-1) < 90).mean())  # all of an empty view is dark
    coloured_share = float((np.ptp(bar, axis=-1) > 0.3 * bar.max(axis=-1)).mean())
    return has_drawn(seen) and 2e-4 < robot_share < 0.2 and coloured_share > 0.6


def test_first_fifth_of_a_recording_shows_yard_robot_and_phases(site: Path) -> None:
    """On a slow connection, the first screen is complete before the rest of the file has arrived."""
    with served(site, ThrottledHandler) as url:
        address = f"{url}/replay/index.html?hide_welcome_screen&theme=dark&url={url}/replay/two_sources.rrd"
        with opened(address, "dark") as (page, _):
            page.set_viewport_size({"width": 1600, "height": 1000})
            assert shows_yard_robot_and_phases(picture_when(page, "gallery-first-fifth", shows_yard_robot_and_phases))
            assert 0.2 <= ThrottledHandler.sent_share < 0.21
