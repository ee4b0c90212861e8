"""Build the documentation outside the repository and collect the addresses in its HTML."""

import os
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
LINKED = (
    "CHANGELOG.md",
    "CITATION.cff",
    "dirmusic",
    "envs",
    "examples",
    "missions",
    "pdpatrol",
    "robot_models",
    "sensing",
)


def build_site(folder: Path) -> subprocess.CompletedProcess[str]:
    """Build the pages into `site` in a folder that holds `docs`; the other inputs are linked into it."""
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)
    shutil.copy(ROOT / "zensical.toml", folder)  # a link would make the build write to its target
    return subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder), "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )


class Named(NamedTuple):
    """An address in a page, with its tag and attribute."""

    tag: str
    attribute: str
    address: str


class Page(HTMLParser):
    """A built page.

    Attributes:
        named: Addresses in it: links, pictures, scripts, stylesheets.
        anchors: Targets for links within it.
        words: Its text.
    """

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.named: list[Named] = []
        self.anchors: set[str] = set()
        self.words = ""
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the addresses and anchors of a tag."""
        for name, value in attrs:
            if value is not None and name in ("href", "src", "srcset", "data", "poster"):
                self.named.append(Named(tag, name, value))
            if value is not None and name in ("id", "name"):
                self.anchors.add(value)

    def handle_data(self, data: str) -> None:
        """Collect the text."""
        self.words += data
