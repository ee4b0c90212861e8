"""Which code a result is of."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[3]
PACKAGES = ("dirmusic", "pdpatrol/sensing", "pdpatrol/robot_models", "pdpatrol/envs", "pdpatrol/missions")
SUFFIXES = (".py", ".toml", ".xml")


@cache
def digest_of_code() -> str:
    """SHA-256 of all files of this project that a mission may depend on: names and contents, in hexadecimal digits.

    It needs no repository, and sees what is not committed.
    """
    total = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted(path for path in (ROOT / package).rglob("*") if path.suffix in SUFFIXES):
            total.update(f"{path.relative_to(ROOT).as_posix()}\0{path.stat().st_size}\0".encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def commit() -> str:
    """The commit that is checked out, with `+` where files differ from it; empty without a repository."""
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--abbrev=12", "--exclude=*", "--dirty=+"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return ""
    return described.stdout.strip()
