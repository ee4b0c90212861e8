"""Verbs of the command line, called in the process of the test: starting a command takes two seconds longer."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from pdpatrol.missions.cli import module_of
from pdpatrol.missions.cli.arguments import call_command

Refused = Callable[..., list[str]]


def call(command: str, *arguments: object) -> None:
    """Call a command with its arguments as on the command line, in the current folder."""
    call_command(
        getattr(import_module(f"pdpatrol.missions.cli.{module_of(command)}"), module_of(command)),
        [str(each) for each in arguments],
    )


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Refused:
    """Return a function that calls a command, checks its exit status, and returns its error lines."""

    def refused(command: str, *arguments: object, cwd: Path) -> list[str]:
        monkeypatch.chdir(cwd)
        with pytest.raises(SystemExit) as ended:
            call(command, *arguments)
        printed = capsys.readouterr()
        assert (ended.value.code, printed.out) == (2, "")
        return printed.err.strip().splitlines()

    return refused
