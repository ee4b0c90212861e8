"""Folders for output: one process each, and never written twice."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.missions.atomic_file import atomic_file, write_text
from pdpatrol.missions.cli.output.folders import CLAIM

pytestmark = pytest.mark.whole

CLAIMS = """
import sys, time
from pathlib import Path
from pdpatrol.missions.cli.output.folders import output_folder
with output_folder(Path(sys.argv[1]) if sys.argv[1] else None, "name") as folder:
    print(folder, flush=True)
    sys.stdin.read()
    if sys.argv[2:]:
        (folder / "kept").touch()
"""


def claim(folder: str, *arguments: str, cwd: Path) -> subprocess.Popen[str]:
    """A process that has claimed a folder, or not; it goes on until its standard input is closed."""
    return subprocess.Popen(
        [sys.executable, "-c", CLAIMS, folder, *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def told(process: subprocess.Popen[str]) -> str:
    """The one line of a refusal."""
    _, errors = process.communicate()
    assert process.returncode == 2, errors
    (line,) = errors.splitlines()
    return line


@pytest.mark.parametrize("n_pairs", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_of_two_that_want_one_folder_at_once_one_has_it(n_pairs: int, tmp_path: Path) -> None:
    for k in range(n_pairs):
        pair = [claim(f"folder_{k}", "keep", cwd=tmp_path) for _ in range(2)]
        results = [process.communicate() for process in pair]
        statuses = sorted(process.returncode for process in pair)
        assert statuses == [0, 2], results
        assert [path.name for path in (tmp_path / f"folder_{k}").iterdir()] == ["kept"]


def test_a_folder_that_is_claimed_is_refused_with_the_name_of_who_has_it(tmp_path: Path) -> None:
    first = claim("folder", cwd=tmp_path)
    assert first.stdout is not None
    assert first.stdout.readline() == "folder\n"
    line = told(claim("folder", cwd=tmp_path))
    assert f"folder is being written to (process {first.pid}, since " in line
    first.communicate()
    assert not (tmp_path / "folder").exists(), "nothing was written to it, and it was not there before"


def test_what_a_killed_process_has_left_is_told_and_stays(tmp_path: Path) -> None:
    first = claim("folder", cwd=tmp_path)
    assert first.stdout is not None
    first.stdout.readline()
    (tmp_path / "folder" / "log").touch()
    first.kill()
    first.communicate()
    line = told(claim("folder", cwd=tmp_path))
    assert f"folder was left by a command that was cut off (process {first.pid}, " in line
    assert {path.name for path in (tmp_path / "folder").iterdir()} == {CLAIM, "log"}


def test_a_folder_that_was_there_stays_and_one_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    claim("mine", cwd=tmp_path).communicate()
    assert list((tmp_path / "mine").iterdir()) == []
    (tmp_path / "mine" / "file").touch()
    assert "mine is not empty" in told(claim("mine", cwd=tmp_path))
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["file"]


def test_names_are_printed_as_they_are_but_for_what_a_terminal_would_obey(tmp_path: Path) -> None:
    folder = tmp_path / "o[1]x[old] :smile: \n\x1b[31m"
    folder.mkdir()
    (folder / "file").touch()
    line = told(claim(folder.name, cwd=tmp_path))
    assert line.startswith("--out: o[1]x[old] :smile: \\n\\x1b[31m is not empty")


def test_without_a_folder_given_each_takes_the_next_free_one(tmp_path: Path) -> None:
    some = [claim("", "keep", cwd=tmp_path) for _ in range(3)]
    assert [process.communicate()[1] for process in some] == ["", "", ""]
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {"name", "name-2", "name-3"}


def write_half(path: Path) -> None:
    with atomic_file(path) as temporary:
        temporary.write_text("half")
        assert path.read_text() == "before"
        raise ZeroDivisionError


def test_a_file_is_there_whole_or_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    write_text(path, "before")
    with pytest.raises(ZeroDivisionError):
        write_half(path)
    assert [each.name for each in tmp_path.iterdir()] == ["file.txt"]
    assert path.read_text() == "before"


def test_what_cannot_be_written_is_named_by_the_name_that_it_would_have(tmp_path: Path) -> None:
    path = tmp_path / "none" / "report.json"
    with pytest.raises(FileNotFoundError) as raised:
        write_text(path, "{}")
    assert raised.value.filename == str(path)
