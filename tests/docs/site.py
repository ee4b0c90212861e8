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
