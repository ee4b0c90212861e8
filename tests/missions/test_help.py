"""Help and messages: they fit the width of the terminal, no word is cut, and mistyped names get a suggestion."""

import os
import pty
import re
import subprocess
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from pdpatrol.missions.cli import COMMANDS
from pdpatrol.missions.cli.terminal import say
from tests.missions.conftest import Refused, call
from tests.processes import PDPATROL

WIDTHS = (60, 80, 120, 200)


def words(text: str) -> set[str]:
    """Return the words of a text, without rules; a list may be broken after its commas."""
    return {word for word in re.split(r"[\s,]+", text) if word.strip("-")}


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_verb_fits_the_width(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = dict[int, str]()
    for width in (5000, *WIDTHS):
        monkeypatch.setenv("COLUMNS", str(width))
        with pytest.raises(SystemExit) as ended:
            call(command, "--help")
        assert ended.value.code == 0
        shown[width] = capsys.readouterr().out
        assert max(map(len, shown[width].splitlines())) <= width
        assert words(shown[width]) == words(shown[5000])
    assert shown[80].startswith(f"usage: pdpatrol {command} ")
    assert not re.search(r"None|STR|\{\[|default: \)", shown[80])


@pytest.mark.parametrize("width", WIDTHS)
def test_bare_command_prints_a_short_help(width: int, tmp_path: Path) -> None:
    environment = os.environ | {"COLUMNS": str(width)}
    done = subprocess.run([PDPATROL], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert max(map(len, done.stdout.splitlines())) <= width
    assert len(done.stdout.splitlines()) <= 45
    assert re.findall(r"^  ([a-z]+) ", done.stdout, flags=re.MULTILINE) == list(COMMANDS)


def on_terminal(words: list[str], width: int, cwd: Path) -> str:
    """Run a command on a terminal of a width, and return what it shows."""
    ours, theirs = pty.openpty()
    environment = os.environ | {"COLUMNS": str(width)}
    subprocess.run(words, cwd=cwd, env=environment, stdout=theirs, stderr=theirs, check=False, timeout=60)
    os.close(theirs)
    shown = os.read(ours, 100_000).decode()
    os.close(ours)
    return shown.replace("\r\n", "\n")


@pytest.mark.parametrize("width", WIDTHS)
def test_errors_are_wrapped_on_a_terminal_only(width: int, tmp_path: Path) -> None:
    (line,) = subprocess.run([PDPATROL, "rnu"], cwd=tmp_path, capture_output=True, text=True).stderr.splitlines()
    shown = on_terminal([PDPATROL, "rnu"], width, tmp_path)
    assert max(map(len, shown.splitlines())) <= width
    assert shown.split() == line.split()
    assert line.endswith("; did you mean run?")


@pytest.mark.parametrize("width", WIDTHS)
def test_messages_are_wrapped_on_a_terminal_only(width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    path = "/a/folder/with/a/name/that/is/longer/than/the/line/of/a/narrow/terminal/log.npz"
    text = f"{'Written to a folder and read again after some time, '.strip()} " * 8 + path
    for is_terminal in (False, True):
        file = StringIO()
        say(text, Console(file=file, force_terminal=is_terminal, highlight=False), hanging=2)
        lines = file.getvalue().splitlines()
        assert (len(lines) > 1) == is_terminal
        assert [line for line in lines if is_terminal and len(line) > width] in ([], [f"  {path}"])
        assert file.getvalue().split() == text.split()


@pytest.mark.parametrize(
    ("arguments", "suggestion"),
    [
        ("run one_sorce", "one_source"),
        ("plan transformer_bey", "transformer_bay"),
        ("sweep suite/claen", None),
        ("sweep suite/opne", "suite/open"),
        ("run --policy seak", "seek"),
        ("sweep one_source --policy pat", "patrol"),
    ],
)
def test_mistyped_name_gets_a_suggestion(
    arguments: str, suggestion: str | None, tmp_path: Path, refused: Refused
) -> None:
    (line,) = refused(*arguments.split(), cwd=tmp_path)
    assert line.endswith(f"did you mean {suggestion}?") == (suggestion is not None)
    assert "did you mean" in line or "available" in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "lines"),
    [
        ("run --sed 3", ["unknown: --sed, 3; see `pdpatrol run --help`; did you mean --seed?"]),
        ("run one_source spare", ["unknown: spare; see `pdpatrol run --help`"]),
        ("run --seed x", ["--seed: must be a whole number, got 'x'; see `pdpatrol run --help`"]),
        ("run --seed", ["--seed: must have a value; see `pdpatrol run --help`"]),
        ("plan --amplitude-v x", ["--amplitude-v: must be a number, got 'x'; see `pdpatrol plan --help`"]),
        ("sweep --engine x", ["--engine: must be one of 'pool', 'ray', got 'x'; see `pdpatrol sweep --help`"]),
        (
            "gap",
            [
                "RECORDING.csv: must be given; see `pdpatrol gap --help`",
                "--yard: must be given; see `pdpatrol gap --help`",
            ],
        ),
    ],
)
def test_arguments_that_do_not_fit_print_a_line_per_error(
    arguments: str, lines: list[str], tmp_path: Path, refused: Refused
) -> None:
    assert refused(*arguments.split(), cwd=tmp_path) == lines
    assert list(tmp_path.iterdir()) == []
