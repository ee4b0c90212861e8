"""Site of the documentation, opened from disk in a browser."""

import shutil
from pathlib import Path

import pytest

from tests.browser.browser import NEEDS_CHROMIUM, opened
from tests.docs.site import ROOT, build_site

pytest.importorskip("zensical", reason="uv run --group docs")
pytestmark = [pytest.mark.whole, NEEDS_CHROMIUM]

LEFT = "favicon.png"
"""File that Chromium stops loading if the next page is opened first; `tests/docs` checks that it exists."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("docs") / "schöne Seiten"
    folder.mkdir()
    shutil.copytree(ROOT / "docs", folder / "docs")
    done = build_site(folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"


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
        page.keyboard.type("georeference", delay=20)
        page.wait_for_selector("text=Where on Earth", timeout=60_000)
        assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
        assert [error for error in errors if LEFT not in error] == []
