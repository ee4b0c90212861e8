"""Verbs of the command line that refuse their arguments, called in the test's own process."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

from pdpatrol.missions.cli.arguments import call_verb

Refused = Callable[..., list[str]]


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Refused:
    """Return a function that calls a verb, checks its exit status, and returns the lines by which it refuses."""

    def refused(verb: str, *arguments: object, cwd: Path) -> list[str]:
        monkeypatch.chdir(cwd)
        with pytest.raises(SystemExit) as ended:
            call_verb(getattr(import_module(f"pdpatrol.missions.cli.{verb}"), verb), [str(each) for each in arguments])
        printed = capsys.readouterr()
        assert (ended.value.code, printed.out) == (2, "")
        return printed.err.strip().splitlines()

    return refused
