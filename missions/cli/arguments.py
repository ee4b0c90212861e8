"""Arguments of a verb, parsed by tyro and checked by pydantic, and the options that several verbs have."""

import inspect
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
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


def call_verb(function: Callable[..., None], arguments: Sequence[str]) -> None:
    """Parse arguments and call the function of a verb.

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
    """Return the call of the function of a verb that arguments state; print its help and exit if they ask for it."""

    def bind(*values: Any, **options: Any) -> Callable[[], None]:  # noqa: ANN401 - the arguments of any verb
        return partial(function, *values, **options)

    # not by functools.wraps: tyro would read the docstring of the function, and keep the line breaks of arguments
    bind.__dict__["__signature__"] = inspect.signature(function)
    bind.__annotations__ = get_type_hints(function, include_extras=True)
    bind.__doc__ = re.sub(r"\n {8}(?=\S)", " ", inspect.getdoc(function) or "")
    help_text = StringIO()
    try:
        with redirect_stdout(help_text):
            return tyro.cli(
                bind, prog=f"pdpatrol {function.__name__}", args=arguments, config=(tyro.conf.FlagCreatePairsOff,)
            )
    finally:
        for line in help_text.getvalue().splitlines():
            sys.stdout.write(f"{wrapped(line.rstrip())}\n")


def _option_error(item: Any) -> str:  # noqa: ANN401 - a dictionary of pydantic
    option = [part for part in item["loc"] if isinstance(part, str)][-1].replace("_", "-")
    must = re.sub(r"^(Input|Tuple) should|^Value error, must", "must", item["msg"])
    return f"--{option}: {must}, got {item['input']!r:.60}"
