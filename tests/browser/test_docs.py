"""Site of the documentation, opened from disk in a browser, in both themes and on screens of three widths."""

from pathlib import Path

import pytest

from tests.browser.browser import NEEDS_CHROMIUM, Theme, keep, opened
from tests.docs.site import build_site

pytest.importorskip("zensical", reason="uv run --group docs")
pytestmark = [pytest.mark.whole, NEEDS_CHROMIUM]

LEFT = "favicon.png"
"""File that Chromium stops loading if the next page is opened first; `tests/docs` checks that it exists."""

WIDTHS_PX = (1280, 1920, 390)
SCROLL_FROM_PX = 1000
"""Narrowest screen on which code, tables and formulas are shown in full; on narrower ones they scroll in their box."""

OUTSIDE = """() => [...document.querySelectorAll('.md-content *')].filter(element => {
  const box = element.getBoundingClientRect();
  if (box.width === 0 || box.right <= document.documentElement.clientWidth + 1) return false;
  for (let outer = element.parentElement; outer; outer = outer.parentElement)
    if (outer.matches('.md-content *') && getComputedStyle(outer).overflowX !== 'visible') return false;
  return true;
}).map(element => `${element.tagName} ${element.textContent.slice(0, 40)}`)"""
"""Elements that end to the right of the screen and are not within a box that scrolls."""

CUT = """() => [...document.querySelectorAll('.md-content :is(pre, pre > code, table, math, .md-typeset__scrollwrap)')]
  .filter(element => element.scrollWidth > element.clientWidth + 1 && getComputedStyle(element).display !== 'inline')
  .map(element => `${element.tagName} ${element.textContent.slice(0, 40)}`)"""
"""Blocks of code, tables and formulas that are wider than their box."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_site(tmp_path_factory.mktemp("docs") / "schöne Seiten")


def test_every_page_and_the_search_work_from_disk(site: Path) -> None:
    files = [file for file in sorted(site.rglob("*.html")) if file.name != "404.html"]
    assert len(files) > 20
    with opened((site / "index.html").as_uri(), "light") as (page, errors):
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        for file in files:
            page.goto(file.as_uri(), wait_until="load")
            empty = page.evaluate("[...document.images].filter(x => x.complete && !x.naturalWidth).map(x => x.src)")
            assert empty == [], file.name
        page.keyboard.press("Control+k")
        page.wait_for_timeout(500)
        page.keyboard.type("position earth", delay=20)
        page.wait_for_selector("text=Position on Earth", timeout=60_000)
        assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
        assert [error for error in errors if LEFT not in error] == []


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_page_is_wider_than_the_screen_and_no_code_or_table_is_cut(site: Path, theme: Theme) -> None:
    files = [file for file in sorted(site.rglob("*.html")) if file.name != "404.html"]
    faults: list[str] = []
    with opened((site / "index.html").as_uri(), theme) as (page, _):
        for file in files:
            name = file.relative_to(site).with_suffix("").as_posix()
            page.goto(file.as_uri(), wait_until="load")
            for width in WIDTHS_PX:
                page.set_viewport_size({"width": width, "height": 900})
                keep(page, f"docs-{name.replace('/', '-')}-{width}-{theme}", is_whole=width == WIDTHS_PX[0])
                found = page.evaluate(OUTSIDE) + (page.evaluate(CUT) if width > SCROLL_FROM_PX else [])
                if page.evaluate("document.documentElement.scrollWidth > document.documentElement.clientWidth"):
                    found.append("the page itself")
                faults += [f"{name} at {width} px: {each}" for each in found]
    assert faults == []
