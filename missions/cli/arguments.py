"""Arguments of a command, parsed by tyro and checked by pydantic, and the options that several commands have."""

import inspect
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import tyro
from pydantic import ConfigDict, ValidationError, validate_call

from dirmusic import InputFileError
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.cli.process import wrapped
from pdpatrol.missions.cli.terminal import refuse


def optional(metavar: str, name: str | None = None) -> Any:  # noqa: ANN401 - tyro does not publish the type
    """Describe an option whose default its help text states in words.

    Args:
        metavar: Form of the value.
        name: Name of the option, if it is not that of the parameter.
    """
    return tyro.conf.arg(name=name, metavar=metavar, help_behavior_hint="")


ScenarioName = Annotated[str, tyro.conf.arg(metavar="[SCENARIO]")]
MissionFolder = Annotated[Path, tyro.conf.arg(metavar="DIR")]
OutFolder = Annotated[Path | None, optional("DIR", "out")]
Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]
JsonOutput = Annotated[bool, tyro.conf.arg(name="json", help_behavior_hint="")]
Settings = Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(name="set", metavar="KEY=VALUES")]


def call_command(function: Callable[..., None], arguments: Sequence[str]) -> None:
    """Parse arguments and call the function of a command.

    Invalid input prints one line per error and exits with status 2.
    """
    checked = validate_call(config=ConfigDict(revalidate_instances="always"))(function)
    try:
        parse_arguments(checked, arguments)()
    except ValidationError as error:
        refuse(*map(_option_error, error.errors()))
    except InputFileError as error:
        refuse(*error.faults)
    except UserCodeError as error:
        refuse(str(error))


def parse_arguments(function: Callable[..., None], arguments: Sequence[str]) -> Callable[[], None]:
    """Return the call of the function of a command that arguments state; print its help and exit if they ask for it.

    Arguments that do not fit print one line per error and exit with status 2.
    """

    def bind(*values: Any, **options: Any) -> Callable[[], None]:  # noqa: ANN401 - the arguments of any command
        return partial(function, *values, **options)

    # not by functools.wraps: tyro would read the docstring of the function, and keep the line breaks of arguments
    bind.__dict__["__signature__"] = inspect.signature(function)
    bind.__annotations__ = get_type_hints(function, include_extras=True)
    bind.__doc__ = re.sub(r"\n {8}(?=\S)", " ", inspect.getdoc(function) or "")
    prog, help_text, error_text = f"pdpatrol {function.__name__}", StringIO(), StringIO()
    try:
        with redirect_stdout(help_text), redirect_stderr(error_text):
            return tyro.cli(bind, prog=prog, args=arguments, config=(tyro.conf.FlagCreatePairsOff,))
    finally:
        for line in help_text.getvalue().splitlines():
            sys.stdout.write(f"{wrapped(line.rstrip())}\n")
        if error_text.getvalue():
            refuse(*_usage_errors(error_text.getvalue(), prog))


WORDS = (
    (r"^Error parsing (\S+): could not convert string to float: ", r"\1: must be a number, got "),
    (r"^Error parsing (\S+): invalid literal for int\(\) with base 10: ", r"\1: must be a whole number, got "),
    (r"^Error parsing ", ""),
    (r"^[Ii]nvalid choice (.+) for argument '(.+)'. Expected one of \((.+)\) ?\.$", r"\2: must be one of \3, got \1"),
    (r"^Missing value for argument '(.+)'\. Expected .*$", r"\1: must have a value"),
    (r"^Unrecognized options: ", "unknown: "),
)
"""Beginnings of errors of tyro, and the words in which all other errors are."""


def _usage_errors(text: str, prog: str) -> list[str]:
    """Return the box that tyro draws around an error as one line per error."""
    error, *others = re.split(r"^\s*-{3,}\s*$", text, flags=re.MULTILINE)[1:]
    if error.lstrip().startswith("Missing from"):
        names = re.findall(r"^ {6}(\S+)", error, flags=re.MULTILINE)
        return [f"{name}: must be given; see `{prog} --help`" for name in names]
    line = " ".join(error.split())
    for pattern, words in WORDS:
        line = re.sub(pattern, words, line)
    meant = re.findall(r"^ +(--\S+)", others[0], flags=re.MULTILINE) if "Perhaps you meant" in others[0] else []
    return [f"{line}; see `{prog} --help`" + (f"; did you mean {' or '.join(meant)}?" if meant else "")]


def _option_error(item: Any) -> str:  # noqa: ANN401 - a dictionary of pydantic
    option = [part for part in item["loc"] if isinstance(part, str)][-1].replace("_", "-")
    must = re.sub(r"^(Input|Tuple) should|^Value error, must", "must", item["msg"])
    return f"--{option}: {must}, got {item['input']!r:.60}"
