"""Output folders are never shared by two processes or overwritten; files are complete or absent."""

import subprocess
from pathlib import Path

import pytest

from pdpatrol.missions.atomic_file import atomic_file, write_text
from tests.processes import start_python

pytestmark = pytest.mark.whole

RESERVES = """
import sys
from pathlib import Path
from pdpatrol.missions.cli.terminal import output_folder
with output_folder(Path(sys.argv[1]) if sys.argv[1] else None, "name") as folder:
    print(folder, flush=True)
    sys.stdin.read()
    if sys.argv[2:]:
        (folder / "kept").touch()
"""


def refusal(process: subprocess.Popen[str]) -> str:
    """Return the single error line of a process that refuses to run."""
    _, errors = process.communicate()
    assert process.returncode == 2, errors
    (line,) = errors.splitlines()
    return line


@pytest.mark.parametrize("n_pairs", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_one_of_two_processes_gets_the_folder(n_pairs: int, tmp_path: Path) -> None:
    for k in range(n_pairs):
        pair = [start_python(RESERVES, f"folder_{k}", "keep", cwd=tmp_path) for _ in range(2)]
        results = [process.communicate() for process in pair]
        assert sorted(process.returncode for process in pair) == [0, 2], results
        assert [path.name for path in (tmp_path / f"folder_{k}").iterdir()] == ["kept"]


@pytest.mark.parametrize("is_killed", [False, True])
def test_reserved_folder_is_refused_and_removed_if_empty(is_killed: bool, tmp_path: Path) -> None:
    first = start_python(RESERVES, "folder", cwd=tmp_path)
    assert first.stdout is not None
    assert first.stdout.readline() == "folder\n"
    if is_killed:
        first.kill()
    line = refusal(start_python(RESERVES, "folder", cwd=tmp_path))
    assert "folder must be a new or empty folder, which no other command writes to" in line
    first.communicate()
    assert (tmp_path / "folder").exists() == is_killed


def test_empty_folder_is_kept_and_a_full_one_refused(tmp_path: Path) -> None:
    folder = tmp_path / "o[1]x[old] :smile: \n\x1b[31m"
    folder.mkdir()
    start_python(RESERVES, folder.name, cwd=tmp_path).communicate()
    assert list(folder.iterdir()) == []
    (folder / "file").touch()
    line = refusal(start_python(RESERVES, folder.name, cwd=tmp_path))
    assert line == "--out: o[1]x[old] :smile: \\n\\x1b[31m must be a new or empty folder"
    assert [path.name for path in folder.iterdir()] == ["file"]


def test_default_folders_are_numbered(tmp_path: Path) -> None:
    some = [start_python(RESERVES, "", "keep", cwd=tmp_path) for _ in range(3)]
    assert [process.communicate()[1] for process in some] == ["", "", ""]
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {"name", "name-2", "name-3"}


def fail_while_writing(path: Path) -> None:
    with atomic_file(path) as temporary:
        temporary.write_text("half")
        assert path.read_text() == "before"
        raise ZeroDivisionError


def test_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    write_text(path, "before")
    with pytest.raises(ZeroDivisionError):
        fail_while_writing(path)
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("file.txt", "before")]


def test_error_names_the_file_and_not_its_temporary(tmp_path: Path) -> None:
    path = tmp_path / "none" / "report.json"
    with pytest.raises(FileNotFoundError) as raised:
        write_text(path, "{}")
    assert raised.value.filename == str(path)
