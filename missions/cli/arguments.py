"""Arguments of a verb, parsed by tyro and checked by pydantic, and the options that several verbs have."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro
from pydantic import ConfigDict, ValidationError, validate_call

from dirmusic import InputFileError
from pdpatrol.envs.user_code import UserCodeError
from pdpatrol.missions.cli.terminal import refuse

MissionFolder = Annotated[Path, tyro.conf.arg(metavar="DIR")]
OutFolder = Annotated[Path | None, tyro.conf.arg(name="out", metavar="DIR")]
JsonOutput = Annotated[bool, tyro.conf.arg(name="json")]
Settings = Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(name="set", metavar="KEY=VALUES")]


def call_verb(function: Callable[..., None], arguments: Sequence[str]) -> None:
    """Parse arguments and call the function of a verb.

    Invalid input prints one line per error and exits with status 2.
    """
    prog = f"pdpatrol {function.__name__}"
    checked = validate_call(config=ConfigDict(revalidate_instances="always"))(function)
    try:
        tyro.cli(checked, prog=prog, args=arguments, config=(tyro.conf.FlagCreatePairsOff,))
    except ValidationError as error:
        refuse(*map(_option_error, error.errors()))
    except InputFileError as error:
        refuse(*error.faults)
    except UserCodeError as error:
        refuse(str(error))


def _option_error(item: Any) -> str:  # noqa: ANN401 - a dictionary of pydantic
    option = [part for part in item["loc"] if isinstance(part, str)][-1].replace("_", "-")
    must = re.sub(r"^(Input|Tuple) should|^Value error, must", "must", item["msg"])
    return f"--{option}: {must}, got {item['input']!r:.60}"
