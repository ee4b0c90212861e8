"""The process that compiles ahead of a first mission; it loads nothing, and so can be started before all else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Self

PACKAGE = Path(__file__).parents[2] / "dirmusic"


class SecondProcess:
    """Runs `compile_ahead` beside this process, once, and no longer than this process lives or the block lasts.

    It starts with this object if by the look of the disk nothing has been compiled yet, and so loads while this process
    does; and else when it is told to, if ever.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        if nothing_is_kept():
            self.start()

    def start(self) -> None:
        """Start it, unless it was started before."""
        self._process = self._process or subprocess.Popen(
            [sys.executable, "-P", "-m", "pdpatrol.missions.compile_ahead"],  # not what lies in the folder
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()


def nothing_is_kept() -> bool:
    """Whether no compiled function is kept where the compiler does so first; it may have been denied that place."""
    told = os.environ.get("NUMBA_CACHE_DIR")
    kept = Path(told) if told else PACKAGE / "__pycache__"
    return next(kept.rglob("*.nbi"), None) is None and (bool(told) or os.access(PACKAGE, os.W_OK))
