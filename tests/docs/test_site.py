"""The documentation builds without warnings, has no dead links and loads nothing from the network."""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import dirmusic
from tests.docs.site import ROOT, build_site
from tests.missions.report.page_reader import PageReader

pytestmark = pytest.mark.whole

pytest.importorskip("zensical", reason="uv run --group docs")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_site(tmp_path_factory.mktemp("built"))


@cache
def page(file: Path) -> PageReader:
    return PageReader(file.read_text(encoding="utf-8"))


def pages(site: Path) -> list[Path]:
    return sorted(file for file in site.rglob("*.html") if file.name != "404.html")


def addresses(site: Path) -> Iterator[tuple[Path, str, str]]:
    """Yield the page, the tag and the address of each link, picture, script and stylesheet."""
    for file in pages(site):
        for tag, attributes in page(file).elements:
            for name in ("href", "src", "srcset", "data", "poster"):
                if (address := attributes.get(name)) is not None:
                    yield file, tag, address


def test_every_page_is_built_with_one_title_and_in_navigation(site: Path) -> None:
    sources = {file.relative_to(ROOT / "docs").with_suffix("") for file in (ROOT / "docs").rglob("*.md")}
    assert {file.relative_to(site).with_suffix("") for file in pages(site)} == sources
    navigation = (ROOT / "zensical.toml").read_text(encoding="utf-8")
    assert [name for name in sources if f'"{name.as_posix()}.md"' not in navigation] == []
    assert [file for file in pages(site) if [tag for tag, _ in page(file).elements].count("h1") != 1] == []


def test_links_and_pictures_exist(site: Path) -> None:
    dead: list[str] = []
    for file, tag, address in addresses(site):
        parts = urlsplit(address)
        if parts.scheme or parts.netloc:
            continue
        target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
        is_page = target.suffix == ".html" and target.is_file()
        if not target.is_file() or (is_page and parts.fragment and parts.fragment not in page(target).ids):
            dead.append(f"{file.relative_to(site)}: <{tag}> {address}")
    assert dead == []


def test_pages_load_nothing_from_the_network(site: Path) -> None:
    loaded = [
        (file, tag, address)
        for file, tag, address in addresses(site)
        if tag != "a" and urlsplit(address).scheme not in ("", "data")
    ]
    assert loaded == []
    assert [file for file in site.rglob("*.css") if "url(http" in file.read_text(encoding="utf-8")] == []


UNRENDERED = re.compile(r"\.\. math::|:math:|\$\$|\$\\|-?8 *< *--")
"""Signs of formulas and of included files."""


def test_formulas_and_included_files_are_rendered(site: Path) -> None:
    for name in ("algorithm", "locating"):
        assert "<math" in (site / "explanation" / f"{name}.html").read_text(encoding="utf-8")
    left = [str(file) for file in pages(site) if UNRENDERED.search(page(file).text)]
    assert left == []
    drawn = [formula for file in pages(site) for formula in re.findall(r"<math.*?</math>", file.read_text("utf-8"))]
    assert len(drawn) > 20
    assert [formula for formula in drawn if "\\" in formula] == []


def test_description_of_a_result_is_one_text(site: Path) -> None:
    """By default, each line of a description would be a row of a table, as if there were several results."""
    text = " ".join(page(site / "reference" / "contracts.html").text.split())
    assert "The standard deviation must be positive and include noise and the error of the method" in text


def test_public_names_of_dirmusic_are_documented(site: Path) -> None:
    ids = page(site / "reference" / "dirmusic.html").ids
    assert [name for name in dirmusic.__all__ if f"dirmusic.{name}" not in ids] == []
