"""Verbs of the command line, called in the process of the test: starting a command takes two seconds longer."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from pdpatrol.missions.cli import module_of
from pdpatrol.missions.cli.arguments import call_verb

Refused = Callable[..., list[str]]


def call(verb: str, *arguments: object) -> None:
    """Call a verb with its arguments as on the command line, in the current folder."""
    call_verb(
        getattr(import_module(f"pdpatrol.missions.cli.{module_of(verb)}"), module_of(verb)),
        [str(each) for each in arguments],
    )


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Refused:
    """Return a function that calls a verb, checks its exit status, and returns its error lines."""

    def refused(verb: str, *arguments: object, cwd: Path) -> list[str]:
        monkeypatch.chdir(cwd)
        with pytest.raises(SystemExit) as ended:
            call(verb, *arguments)
        printed = capsys.readouterr()
        assert (ended.value.code, printed.out) == (2, "")
        return printed.err.strip().splitlines()

    return refused
