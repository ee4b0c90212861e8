"""Build the documentation outside the repository."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

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


def build_site(folder: Path) -> Path:
    """Build a copy of the pages in a folder, and return the folder of the pages; other inputs are linked into it."""
    shutil.copytree(ROOT / "docs", folder / "docs")
    for name in LINKED:
        (folder / name).symlink_to(ROOT / name)
    shutil.copy(ROOT / "zensical.toml", folder)  # a link would make the build write to its target
    done = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(folder), "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "site"
