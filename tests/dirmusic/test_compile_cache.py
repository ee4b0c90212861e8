"""What is kept of compiled functions is used for the very same code alone, whichever file it is in."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest

CALLER = """
import callee
from callee import FACTORS, Pair, scale
from dirmusic.compiled import compiled

@compiled
def work(x):
    pair = callee.make_pair(x)
    return scale(pair.first) + 10.0 * pair.second + 100.0 * callee.OFFSET + 1000.0 * FACTORS[1]

@compiled
def first_of(pair):
    return pair.first
"""
CALLEE = """
from typing import NamedTuple
import numpy as np
from dirmusic.compiled import compiled

OFFSET = 1.0
FACTORS = np.array([2.0, 3.0])

class Pair(NamedTuple):
    first: float
    second: float

@compiled
def twice(x):
    return 2.0 * x

@compiled
def scale(x):
    return twice(x) + 1.0

@compiled
def make_pair(x):
    return Pair(x, 7.0)
"""
CHANGES = {
    "a callee": ("return twice(x) + 1.0", "return twice(x) + 4.0"),
    "a callee of a callee": ("return 2.0 * x", "return 5.0 * x"),
    "a function of a module": ("Pair(x, 7.0)", "Pair(x, 8.0)"),
    "a constant of a module": ("OFFSET = 1.0", "OFFSET = 6.0"),
    "an array": ("[2.0, 3.0]", "[2.0, 9.0]"),
    "the order of fields": ("first: float\n    second: float", "second: float\n    first: float"),
}


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401
    """Writes the module that is called, and loads both anew as another process would."""
    monkeypatch.syspath_prepend(str(tmp_path))  # pyright: ignore[reportUnknownMemberType]
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "caller.py").write_text(CALLER)

    def load_with(callee: str) -> Any:  # noqa: ANN401 - a module
        (tmp_path / "callee.py").write_text(callee)
        for name in ("caller", "callee"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("caller")

    yield load_with
    for name in ("caller", "callee"):
        sys.modules.pop(name, None)


def in_python(module: Any, name: str, *values: Any) -> float:  # noqa: ANN401
    """What the function gives if nothing of it is compiled."""
    known = vars(sys.modules["callee"])
    plain = {of: getattr(value, "__wrapped__", value) for of, value in known.items()}
    for function in ("twice", "scale", "make_pair"):
        plain[function].__globals__.update(plain)
    vars(module).update({of: plain[of] for of in ("scale", "Pair", "FACTORS")})
    return getattr(module, name).__wrapped__(*values)


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_what_another_file_changes_is_compiled_anew(change: tuple[str, str], load: Any) -> None:  # noqa: ANN401
    def results(callee: str) -> tuple[tuple[float, float], tuple[float, float]]:
        module = load(callee)
        pair = module.Pair(1.0, 2.0)
        compiled = module.work(3.0), module.first_of(pair)
        return compiled, (in_python(module, "work", 3.0), in_python(module, "first_of", pair))

    before, expected_before = results(CALLEE)
    after, expected_after = results(CALLEE.replace(*change))
    assert before == expected_before
    assert after == expected_after
    assert after != before


def test_what_has_not_changed_is_found_again(load: Any) -> None:  # noqa: ANN401
    load(CALLEE).work(3.0)
    work = load(CALLEE + "\n# changed in words alone\n").work
    work(3.0)
    assert not work._for_python.stats.cache_misses
    assert work._for_python.stats.cache_hits
