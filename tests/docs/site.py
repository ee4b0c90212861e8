"""The pages of docs/, built apart from the repository, and what their HTML names."""

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
    """Build the pages into `site` in a folder that holds `docs`, and is given the rest of what they are made of."""
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)
    shutil.copy(ROOT / "zensical.toml", folder)  # a link would have it built where that points to
    return subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder), "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )


class Named(NamedTuple):
    """Something that a page names: the tag and attribute, and the address."""

    tag: str
    attribute: str
    address: str


class Page(HTMLParser):
    """One built page.

    Attributes:
        named: Addresses in it: links, pictures, scripts, stylesheets.
        anchors: What a link can point to within it.
        words: Its text.
    """

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.named: list[Named] = []
        self.anchors: set[str] = set()
        self.words = ""
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what a tag names."""
        for name, value in attrs:
            if value is not None and name in ("href", "src", "srcset", "data", "poster"):
                self.named.append(Named(tag, name, value))
            if value is not None and name in ("id", "name"):
                self.anchors.add(value)

    def handle_data(self, data: str) -> None:
        """Collect words."""
        self.words += data
