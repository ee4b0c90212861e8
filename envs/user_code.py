"""Loading and calling of user code that is named in a scenario or on the command line."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from dirmusic import ESTIMATORS, ArrayModel, BearingEstimator, Bearings, PulseBatch
from dirmusic.bearing.estimators import method_std


class UserCodeError(Exception):
    """Error for user code that cannot be loaded, raises an exception, or returns an invalid result.

    The message is one line with file and line number. An exception raised by the user code is chained as its cause.
    """


def load_object(name: str, expected: str) -> Any:  # noqa: ANN401 - whatever has that name
    """Import a class or function by name.

    Args:
        name: `my_file.py:Name`, or `package.module:Name`, installed or on PYTHONPATH. A file can import other files of
            its folder with `from . import other`.
        expected: Description of the expected object, for error messages.

    Raises:
        UserCodeError: If the file, module or name does not exist, or its import raises an exception.
    """
    place, _, attribute = name.rpartition(":")
    if not (place and attribute.isidentifier()):
        raise UserCodeError(f"{name}: must be my_file.py:Name or package.module:Name; expected {expected}")
    is_file = place.endswith(".py")
    file = Path(place).resolve()
    if not is_file:
        with calling(place, expected):
            file = Path(getattr(importlib.util.find_spec(place), "origin", None) or place)
    elif not file.is_file():
        raise UserCodeError(f"{_relative(file)}: no such file; expected {expected}")
    with calling(file, expected):
        module = _import_file(file) if is_file else importlib.import_module(place)
    if not hasattr(module, attribute):
        own = [
            key
            for key, value in vars(module).items()
            if getattr(value, "__module__", "") == module.__name__ and not key.startswith("_")
        ]
        known = ", ".join(own[:20]) or "no class or function"
        raise UserCodeError(f"{_relative(file)}: must define `{attribute}`, defines {known}; expected {expected}")
    return getattr(module, attribute)


def _import_file(file: Path) -> ModuleType:
    """Import a file as a module of a package that represents the current state of its folder.

    Files of the same name in different folders therefore become different modules, and all modules of a folder are
    imported again when one of them has changed.
    """
    stamps = [(path.name, path.stat().st_mtime_ns) for path in sorted(file.parent.glob("*.py"))]
    package = f"user_code_{hashlib.sha256(repr((file.parent, stamps)).encode()).hexdigest()[:16]}"
    if package not in sys.modules:
        sys.modules[package] = ModuleType(package)
        sys.modules[package].__path__ = [str(file.parent)]
        importlib.invalidate_caches()
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # bytecode files resolve changes to a second only
    try:
        return importlib.import_module(f"{package}.{file.stem}")
    finally:
        sys.dont_write_bytecode = before


@contextmanager
def calling(thing: object, expected: str) -> Iterator[None]:
    """Convert an exception raised by user code, including SystemExit, into a `UserCodeError` that names the line.

    Args:
        thing: Callee (a class, a function, or an object made by user code), or file that is imported.
        expected: Expected result of the call, for the error message.
    """
    try:
        yield
    except UserCodeError:
        raise
    except (Exception, SystemExit) as error:
        place, folder = place_of(thing), _source_of(thing)[0].parent
        for frame in traceback.extract_tb(error.__traceback__)[2:]:
            if folder.is_absolute() and Path(frame.filename).parent == folder:
                place = f"{_relative(Path(frame.filename))}:{frame.lineno}"
        text = " ".join(traceback.format_exception_only(error)[-1].split())
        if isinstance(error, SyntaxError):
            text, place = f"SyntaxError: {error.msg}", f"{_relative(Path(error.filename or place))}:{error.lineno}"
        if isinstance(error, ModuleNotFoundError) and (folder / f"{error.name}.py").is_file():
            text += f"; for a file of the same folder write `from . import {error.name}`"
        raise UserCodeError(f"{place}: {text[:240]}; expected {expected}") from error


def place_of(thing: object) -> str:
    """Return `file:line` of the definition of a class or function, or of the class of any other object."""
    file, line = _source_of(thing)
    return f"{_relative(file)}:{line}" if line else _relative(file)


def _source_of(thing: object) -> tuple[Path, int | None]:
    if isinstance(thing, str | Path):
        return Path(thing), None
    definition: Any = thing if inspect.isclass(thing) or inspect.isroutine(thing) else type(thing)
    definition = inspect.unwrap(definition)
    try:
        return Path(inspect.getfile(definition)), inspect.getsourcelines(definition)[1] or 1
    except (TypeError, OSError):
        return Path(definition.__qualname__), None


def _relative(file: Path) -> str:
    return str(file).removeprefix(f"{Path.cwd()}/")


EXPECTED_ESTIMATOR = "an estimator: MyEstimator() makes one, estimator(pulses, array) returns dirmusic.Bearings"


class UserEstimator:
    """User-supplied bearing estimator whose results are checked.

    The estimator is tried once on noise-free pulses, so that errors appear before a mission starts. Copying and
    unpickling load the user's code again, because an estimator must not have any state.

    Args:
        name: `my_file.py:MyEstimator` or `package.module:MyEstimator`; see `load_object`.
        array: Array for the trial.

    Raises:
        UserCodeError: If the estimator cannot be loaded, made or called, or does not return valid bearings.
    """

    def __init__(self, name: str, array: ArrayModel) -> None:
        self._arguments = name, array
        definition: Any = load_object(name, EXPECTED_ESTIMATOR)
        with calling(definition, EXPECTED_ESTIMATOR):
            self._estimator: BearingEstimator = definition()
        method_std(self, array)

    def __call__(self, pulses: PulseBatch, array: ArrayModel) -> Bearings:
        """Return the bearings of pulses; see `dirmusic.BearingEstimator`."""
        n = pulses.n_pulses
        expected = f"columns of shape ({n},), finite: azimuths, deviations above 0, misfits in [0, 1]"
        with calling(self._estimator, expected):
            found = Bearings(*(np.asarray(column, dtype=np.float64) for column in self._estimator(pulses, array)))
        if not found.elevation_rad.ndim:
            found = found._replace(elevation_rad=np.zeros(n))
        least_std = pulses.variance_v2.any(axis=-1) * np.finfo(np.float64).tiny  # 0 for pulses without noise
        lows, highs = (-np.inf, least_std, 0.0, -np.pi / 2), (np.inf, np.inf, 1.0, np.pi / 2)
        for name, column, low, high in zip(found._fields, found, lows, highs, strict=True):
            if column.shape != (n,) or not np.all(np.isfinite(column) & (column >= low) & (column <= high)):
                returned = f"{name} of shape {column.shape}, {column.ravel()[:3]} and so on"
                raise UserCodeError(f"{place_of(self._estimator)}: returned {returned}; expected {expected}")
        return found

    def __reduce__(self) -> tuple[type[UserEstimator], tuple[str, ArrayModel]]:
        return UserEstimator, self._arguments


def make_estimator(name: str, array: ArrayModel) -> BearingEstimator:
    """Make the estimator that a scenario names.

    Raises:
        UserCodeError: If the name is not that of a built-in estimator, and no valid estimator can be loaded from it.
    """
    return ESTIMATORS[name] if name in ESTIMATORS else UserEstimator(name, array)
