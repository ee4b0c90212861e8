"""Foreign code, which users name in a scenario or on the command line: loaded and called so that a fault is one line.

A file's folder acts as a package of its own: the file may `from . import sibling`, files of one name in two folders
stay apart, and a file that changed is loaded anew.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import os
import sys
import textwrap
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any


class ForeignCodeError(Exception):
    """Foreign code that cannot be loaded, raised an exception or gave a wrong result; one line with file and line."""


def load_object(name: str, folder: str | Path, expected: str) -> Any:  # noqa: ANN401 - whatever has that name
    """The object of that name: a class or a function, as a rule.

    Args:
        name: `my_file.py:Name`, relative to `folder`, or `package.module:Name`, installed or on PYTHONPATH.
        folder: The current folder for the command line, the folder of the file for a scenario.
        expected: What should be there, for the error's text.

    Raises:
        ForeignCodeError: If there is no such file, module or name, or importing it raises an exception.
    """
    place, _, attribute = name.rpartition(":")
    if not (place and attribute.isidentifier()):
        raise ForeignCodeError(f"{name}: names no code; expected my_file.py:Name or package.module:Name, {expected}")
    if place.endswith(".py"):
        file = (Path(folder) / place).resolve()
        if not file.is_file():
            raise ForeignCodeError(f"{_shown(file)}: no such file; expected {expected}")
    else:
        with calling(place, expected):
            file = Path(getattr(importlib.util.find_spec(place), "origin", None) or place)
    with calling(file, expected):
        module = _load_file(file) if place.endswith(".py") else importlib.import_module(place)
        if hasattr(module, attribute):
            return getattr(module, attribute)
    names = [n for n in vars(module) if getattr(vars(module)[n], "__module__", "") == module.__name__ and n[0] != "_"]
    known = textwrap.shorten(", ".join(names), 240) or "no class and no function"
    raise ForeignCodeError(f"{_shown(file)}: no `{attribute}` in it; it has {known}; expected {expected}")


def _load_file(file: Path) -> ModuleType:
    """The module of a file: the one that is loaded already, unless a Python file of its folder changed since."""
    package = f"foreign_{hashlib.sha256(os.fsencode(file.parent)).hexdigest()[:16]}"
    stamp = {path.name: (path.stat().st_mtime_ns, path.stat().st_size) for path in file.parent.glob("*.py")}
    if getattr(sys.modules.get(package), "stamp", None) != stamp:
        for stale in [name for name in sys.modules if name.partition(".")[0] == package]:
            del sys.modules[stale]
        sys.modules[package] = ModuleType(package)
        vars(sys.modules[package]).update(__path__=[str(file.parent)], stamp=stamp)
        importlib.invalidate_caches()
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # its time stamps of whole seconds miss changes
    try:
        return importlib.import_module(f"{package}.{file.stem}")
    finally:
        sys.dont_write_bytecode = before


@contextmanager
def calling(thing: object, expected: str) -> Iterator[None]:
    """Context for calls of foreign code: an exception there, even SystemExit, becomes a ForeignCodeError.

    It names the innermost line that was running in the foreign file or another of its folder, else the definition.

    Args:
        thing: What is called: a class, a function, or an object that foreign code made.
        expected: What the call should have done, for the error's text.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        if isinstance(error, ForeignCodeError):
            raise
        text = traceback.format_exception_only(error)[0].strip()
        folder = _source_of(thing)[0].parent
        frames = traceback.extract_tb(error.__traceback__)[2:]  # without this function and its caller
        foreign = [_shown(Path(f.filename), f.lineno) for f in frames if os.path.dirname(f.filename) == str(folder)]
        place = foreign[-1] if foreign else place_of(thing)
        if isinstance(error, SyntaxError):
            text, broken = f"{type(error).__name__}: {error.msg}", Path(error.filename or "")
            place = _shown(broken, error.lineno) if broken.is_file() else place
        if isinstance(error, ModuleNotFoundError) and (folder / f"{error.name}.py").is_file():
            text += f"; a file of the same folder: `from . import {error.name}`"
        raise ForeignCodeError(f"{place}: {textwrap.shorten(text, 240)}; expected {expected}") from error


def place_of(thing: object) -> str:
    """`file:line` where a class or function is defined; for any other object, where its class is."""
    return _shown(*_source_of(thing))


def _source_of(thing: object) -> tuple[Path, int | None]:
    """File and line of a definition; a name and None where they are not known."""
    if isinstance(thing, (str, Path)):
        return Path(thing), None
    thing = inspect.unwrap(thing) if callable(thing) else type(thing)
    definition: Any = thing if inspect.isclass(thing) or inspect.isroutine(thing) else type(thing)
    file, line = Path(definition.__qualname__), None
    with suppress(TypeError, OSError, SyntaxError):
        file = Path(inspect.getfile(definition))
        line = inspect.getsourcelines(definition)[1] or 1
    return file, line


def _shown(file: Path, line: int | None = None) -> str:
    shown = str(file.relative_to(Path.cwd()) if file.is_relative_to(Path.cwd()) else file)
    return f"{shown}:{line}" if line else shown
