"""What callers hand to an environment, checked before anything is computed with it."""

from __future__ import annotations

import inspect
import math
import operator
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from pdpatrol.envs.scenario import Scenario, ScenarioError, load_scenario
from pdpatrol.envs.scenario.loader import restore_scenario

FloatArray = NDArray[np.float64]

OPTIONS = ("start_pose", "sources")
"""What `reset(options=...)` can fix; see `PatrolEnv`."""


DRAWING_FUNCTION = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_][\w.]*")
"""Name of a function that draws scenarios, as `package.module:function`."""

HIGHEST_M = 100.0
"""Up to which height a source can be put (assumed: no equipment of a substation is higher)."""


def checked_actions(actions: Any, shape: tuple[int, ...]) -> FloatArray:  # noqa: ANN401 - it may be anything
    """Actions as shares of the robot's limits in [-1, 1], of the shape that they must have; beyond it they are clipped.

    Raises:
        ValueError: If they have another shape, are no real numbers, or are not finite.
    """
    is_single = len(shape) == 1
    name, rows = ("`action`", "") if is_single else ("`actions`", ", a row for each robot")
    try:
        given = np.asarray(actions)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must have shape {shape}, got a nested sequence of uneven lengths") from None
    if given.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, speed and yaw rate{rows}, got {given.shape}")
    if given.dtype.kind not in "iuf":
        raise ValueError(f"{name} must hold real numbers, got dtype {given.dtype}")
    numbers = given.ravel().tolist()  # for one robot faster than NumPy
    if not all(map(math.isfinite, numbers)):
        row = None if is_single else int(np.flatnonzero(~np.isfinite(given).all(axis=-1))[0])
        broken, where = (given, "") if row is None else (given[row], f" in row {row}")
        raise ValueError(f"{name} must be finite, got {broken.tolist()}{where}")
    return np.array([min(max(float(each), -1.0), 1.0) for each in numbers]).reshape(shape)


def checked_seed(seed: Any) -> int | None:  # noqa: ANN401 - it may be anything
    """A seed as a Python integer, whichever type of whole number it is of; None stays None.

    Raises:
        ValueError: If it is neither, or negative.
    """
    if seed is None:
        return None
    try:
        whole = -1 if isinstance(seed, (bool, np.bool_)) else operator.index(seed)
    except TypeError:
        whole = -1
    if whole < 0:
        raise ValueError(f"`seed`: got {seed!r}; allowed is a whole number from 0 on, or None")
    return whole


def checked_count(name: str, count: Any, least: int) -> int:  # noqa: ANN401 - it may be anything
    """A whole number of something, `least` or more, as a Python integer.

    Raises:
        ValueError: If it is none.
    """
    try:
        whole = least - 1 if isinstance(count, (bool, np.bool_)) else operator.index(count)
    except TypeError:
        whole = least - 1
    if whole < least:
        raise ValueError(f"`{name}` must be {least} or more, a whole number, got {count!r}")
    return whole


def given_scenario(scenario: Any) -> Scenario | Callable[[np.random.Generator], Scenario]:  # noqa: ANN401 - anything
    """Resolve the `scenario` argument of an environment to a scenario, or to the function that draws one.

    Args:
        scenario: Name, path, plain data, `Scenario`, function, or the name of a function as `package.module:function`.

    Raises:
        ScenarioError: If the scenario does not exist or has errors.
        ValueError: If it is none of these.
    """
    if isinstance(scenario, str) and DRAWING_FUNCTION.fullmatch(scenario):
        try:
            return cast("Callable[[np.random.Generator], Scenario]", pkgutil.resolve_name(scenario))
        except (ImportError, AttributeError) as error:
            raise ScenarioError([f"`scenario`: {scenario}: {error}"]) from None
    if callable(scenario):
        return cast("Callable[[np.random.Generator], Scenario]", scenario)
    if isinstance(scenario, Mapping):
        return restore_scenario(scenario)
    if not isinstance(scenario, (str, Path, Scenario)):
        raise ValueError(f"`scenario`: got {scenario!r}; allowed is a name, a path, a Scenario, or its plain data")
    return load_scenario(scenario)


def told_spec(spec: EnvSpec | None, max_episode_steps: int) -> EnvSpec | None:
    """A spec with the length of an episode, and arguments as plain data where they can be, as JSON needs them."""
    if spec is None:
        return None
    kwargs = {key: _plain(value) for key, value in spec.kwargs.items()}
    return replace(spec, kwargs=kwargs, max_episode_steps=max_episode_steps)


def _plain(value: Any) -> Any:  # noqa: ANN401 - arguments are of many types
    if isinstance(value, Scenario):
        return value.model_dump(mode="json")
    if isinstance(value, Path):
        return str(value)
    if inspect.isfunction(value) and "<" not in value.__qualname__:
        return f"{value.__module__}:{value.__qualname__}"
    return value.value if isinstance(value, Enum) else value


class Fixed(NamedTuple):
    """What is not drawn in an episode.

    Attributes:
        start_pose: x m, y m, yaw rad, shape (3,); None where the dock is the start.
        sources_m: Places of sources by their names, each of shape (3,).
    """

    start_pose: FloatArray | None
    sources_m: Mapping[str, FloatArray]

    @classmethod
    def checked(cls, options: Any, scenario: Scenario) -> Fixed:  # noqa: ANN401 - it may be anything
        """From the options of a reset; None are no options.

        Raises:
            ValueError: If an option is unknown or makes no sense in the scenario.
        """
        if options is None:
            return NOTHING_FIXED
        if not isinstance(options, Mapping):
            raise ValueError(f"`options`: got {options!r}; allowed is a dict with {', '.join(OPTIONS)}")
        unknown = [key for key in options if key not in OPTIONS]
        if unknown:
            raise ValueError(f"`options`: no option `{unknown[0]}`; allowed are {', '.join(OPTIONS)}")
        start, sources = options.get("start_pose"), options.get("sources")
        pose = None if start is None else _three_numbers(start)
        if start is not None and (pose is None or not _is_on_free_ground(pose, scenario)):
            raise ValueError(
                f"`options`: start_pose {start} is no x m, y m, yaw rad on free ground inside the fence; "
                "allowed is a yaw of one turn either way"
            )
        if not isinstance(sources, Mapping | None):
            raise ValueError(f"`options`: sources: got {sources!r}; allowed is a dict from a source's name to a place")
        return cls(pose, {name: _place(name, place, scenario) for name, place in (sources or {}).items()})


NOTHING_FIXED = Fixed(None, {})


def _is_on_free_ground(pose: FloatArray, scenario: Scenario) -> bool:
    is_inside = scenario.yard.contains(pose) and abs(pose[2]) <= 2.0 * np.pi
    return bool(is_inside and scenario.yard.clearance(pose) >= 0.0)


def _place(name: str, place: Any, scenario: Scenario) -> FloatArray:  # noqa: ANN401 - it may be anything
    names, known = [source.name for source in scenario.sources], scenario.yard.site_names()
    if name not in names:
        raise ValueError(f"`options`: no source `{name}`; allowed are {', '.join(names) or 'none'}")
    if isinstance(place, str):
        if place not in known:
            raise ValueError(f"`options`: no site `{place}` for source `{name}`; allowed are {', '.join(known)}")
        return scenario.yard.site_position(place)
    at = _three_numbers(place)
    if at is None or not 0.0 < at[2] <= HIGHEST_M or not scenario.yard.contains(at):
        raise ValueError(
            f"`options`: source `{name}` at {place}: allowed is x, y, z above ground in the yard, up to {HIGHEST_M:g} m"
        )
    enclosing = scenario.yard.enclosing_equipment(at)
    if enclosing is not None:
        raise ValueError(f"`options`: source `{name}` at {place}: allowed is no place within equipment `{enclosing}`")
    return at


def _three_numbers(value: Any) -> FloatArray | None:  # noqa: ANN401 - it may be anything
    """Three finite real numbers, shape (3,); None if these are none."""
    try:
        given = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if given.shape != (3,) or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
        return None
    return given.astype(np.float64)
