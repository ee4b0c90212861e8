"""The documentation builds without warnings, has no dead links and loads nothing from the network."""

import re
import shutil
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.docs.site import ROOT, Page, build_site

pytestmark = pytest.mark.whole

pytest.importorskip("zensical", reason="uv run --group docs")

LARGEST_MB = 12.0


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    shutil.copytree(ROOT / "docs", folder / "docs")
    done = build_site(folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"


@cache
def page(file: Path) -> Page:
    return Page(file)


def pages(site: Path) -> list[Path]:
    return sorted(file for file in site.rglob("*.html") if file.name != "404.html")


def test_every_page_is_built_and_in_navigation(site: Path) -> None:
    sources = {file.relative_to(ROOT / "docs").with_suffix("") for file in (ROOT / "docs").rglob("*.md")}
    assert {file.relative_to(site).with_suffix("") for file in pages(site)} == sources
    navigation = (ROOT / "zensical.toml").read_text(encoding="utf-8")
    assert [name for name in sources if f'"{name.as_posix()}.md"' not in navigation] == []


def test_links_and_pictures_exist(site: Path) -> None:
    dead: list[str] = []
    for file in pages(site):
        for tag, _, address in page(file).named:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            if not target.is_file():
                dead.append(f"{file.relative_to(site)}: <{tag}> {address}")
            elif parts.fragment and target.suffix == ".html" and parts.fragment not in page(target).anchors:
                dead.append(f"{file.relative_to(site)}: <{tag}> {address}: no such place")
    assert dead == []


def test_pages_have_one_title(site: Path) -> None:
    titles = {str(file): file.read_text(encoding="utf-8").count("<h1") for file in pages(site)}
    assert {file: n for file, n in titles.items() if n != 1} == {}


def test_pages_load_nothing_from_the_network(site: Path) -> None:
    loaded = [
        f"{file.relative_to(site)}: <{tag}> {address}"
        for file in pages(site)
        for tag, _, address in page(file).named
        if tag != "a" and urlsplit(address).scheme not in ("", "data")
    ]
    assert loaded == []
    styles = [file for file in site.rglob("*.css") if "url(http" in file.read_text(encoding="utf-8")]
    assert styles == []


def test_formulas_and_included_files_are_rendered(site: Path) -> None:
    assert "<math" in (site / "explanation" / "algorithm.html").read_text(encoding="utf-8")
    left = [str(file) for file in pages(site) if re.search(r"\.\. math::|:math:|-?8 *< *--", page(file).words)]
    assert left == []
    drawn = [formula for file in pages(site) for formula in re.findall(r"<math.*?</math>", file.read_text("utf-8"))]
    assert len(drawn) > 20
    assert [formula for formula in drawn if "\\" in formula] == []


def test_public_names_of_dirmusic_are_documented(site: Path) -> None:
    import dirmusic

    anchors = page(site / "reference" / "dirmusic.html").anchors
    assert [name for name in dirmusic.__all__ if f"dirmusic.{name}" not in anchors] == []


def test_first_page_links_main_topics() -> None:
    """The text itself links them; the navigation, which is on every page, does not count."""
    linked = set(re.findall(r"\]\(([\w/-]+)\.md", (ROOT / "docs" / "index.md").read_text(encoding="utf-8")))
    assert linked >= {"how-to/antenna", "how-to/yard", "how-to/locate", "answers", "reference/cite"}


def test_site_is_small(site: Path) -> None:
    assert sum(file.stat().st_size for file in site.rglob("*") if file.is_file()) < LARGEST_MB * 1e6


def test_dead_link_fails_the_build(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    with (tmp_path / "docs" / "index.md").open("a", encoding="utf-8") as first:
        first.write("\n[nowhere](nowhere.md)\n")
    done = build_site(tmp_path)
    assert done.returncode != 0
    assert "page does not exist" in done.stdout + done.stderr
