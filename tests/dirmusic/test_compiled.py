"""Cache of compiled functions: its folder, and that stale functions are never used."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import dirmusic

SMALL = """
import numba
from dirmusic.kernel import double
print(double(1.0), numba.config.CACHE_DIR or "unset")
"""
KERNEL = """
from dirmusic.compiled import compiled
@compiled
def double(x):
    return 2.0 * x
"""
CALLER = """
from dirmusic.compiled import compiled
from dirmusic.kernel import double
@compiled
def quadruple(x):
    return 2.0 * double(x)
"""


@pytest.fixture
def run(tmp_path: Path):
    """Return a function that runs code with the cache and two small kernels, in the given environment."""
    copy = tmp_path / "code" / "dirmusic"
    copy.mkdir(parents=True)
    for name in ("compiled.py", "arrays.py"):
        shutil.copy(Path(dirmusic.__file__).with_name(name), copy)
    for name, code in (("__init__.py", ""), ("kernel.py", KERNEL), ("caller.py", CALLER)):
        (copy / name).write_text(code, encoding="utf-8")

    def run(code: str, *options: str, **environment: str) -> subprocess.CompletedProcess[str]:
        inherited = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "XDG_"))}
        places = {"PYTHONPATH": str(copy.parent), "HOME": str(tmp_path), "TMPDIR": str(tmp_path)}
        return subprocess.run(
            [sys.executable, "-P", *options, "-c", code],
            env={**inherited, **places, **environment}, capture_output=True, text=True, check=True,
        )  # fmt: skip

    return run


@pytest.mark.whole
def test_cache_is_private_and_keeps_numba_settings(tmp_path: Path, run) -> None:  # noqa: ANN001
    assert run(SMALL, "-W", "error", XDG_CACHE_HOME=str(tmp_path / "cache")).stdout == "2.0 unset\n"
    (folder,) = (tmp_path / "cache" / "pdpatrol").iterdir()
    assert list(folder.rglob("*.nbi"))
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700
    chosen = str(tmp_path / "chosen")
    assert run(SMALL, NUMBA_CACHE_DIR=chosen).stdout == f"2.0 {chosen}\n"
    assert list(Path(chosen).rglob("*.nbi"))


@pytest.mark.whole
def test_change_in_another_file_is_compiled_anew(tmp_path: Path, run) -> None:  # noqa: ANN001
    """Numba itself compares only the file of the called function."""
    code = "from dirmusic.caller import quadruple; print(quadruple(1.0))"
    assert run(code).stdout == "4.0\n"
    (tmp_path / "code" / "dirmusic" / "kernel.py").write_text(KERNEL.replace("2.0", "3.00"), encoding="utf-8")
    assert run(code).stdout == "6.0\n"


def test_cache_of_another_checkout_is_incomplete(tmp_path: Path, run) -> None:  # noqa: ANN001
    """Numba does not share machine code between folders, so a second checkout has to compile."""
    is_complete = "from dirmusic.compiled import *; print(is_cache_complete())"
    run("from dirmusic.compiled import *; mark_cache_complete()")
    assert run(is_complete).stdout == "True\n"
    (tmp_path / "code" / "dirmusic").rename(tmp_path / "dirmusic")
    assert run(is_complete, PYTHONPATH=str(tmp_path)).stdout == "False\n"


def test_old_versions_are_removed(tmp_path: Path, run) -> None:  # noqa: ANN001
    base = tmp_path / ".cache" / "pdpatrol"
    for number in range(9):
        (base / f"old-{number}").mkdir(parents=True)
        os.utime(base / f"old-{number}", (number, number))
    run(SMALL)
    kept = {folder.name for folder in base.iterdir()}
    assert {"old-6", "old-7", "old-8"} < kept
    assert len(kept) == 4


@pytest.mark.whole
def test_cache_falls_back_to_temporary_folder_or_warning(tmp_path: Path, run) -> None:  # noqa: ANN001
    (tmp_path / "file").touch()
    denied = str(tmp_path / "file")
    assert run(SMALL, "-W", "error", XDG_CACHE_HOME=denied).stdout == "2.0 unset\n"
    private = tmp_path / f"pdpatrol-{os.getuid()}"
    assert list(private.rglob("*.nbi"))
    assert stat.S_IMODE(private.stat().st_mode) == 0o700
    shutil.rmtree(private)
    private.touch()
    done = run(SMALL, XDG_CACHE_HOME=denied)
    assert done.stdout == "2.0 unset\n"
    assert done.stderr.count("RuntimeWarning") == 1
