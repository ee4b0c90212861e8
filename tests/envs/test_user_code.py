"""User code is found by file or module, and its errors are one line with file and line number."""

import pickle
from pathlib import Path

import pytest

from pdpatrol.envs.user_code import UserCodeError, calling, load_object, place_of


def write(folder: Path, name: str, *lines: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(autouse=True)
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def load_error(name: str) -> str:
    """Return the error line of loading `name`."""
    with pytest.raises(UserCodeError) as refused:
        load_object(name, "a thing")
    return one_line(refused.value)


def one_line(error: UserCodeError) -> str:
    text = str(error)
    assert len(text.splitlines()) == 1
    return text


def call_error(name: str, *arguments: object) -> str:
    called = load_object(name, "a thing")
    with pytest.raises(UserCodeError) as refused, calling(called, "a number"):
        called(*arguments)
    return one_line(refused.value)


def test_object_is_loaded_from_file_and_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "my_package", "__init__.py")
    write(tmp_path / "my_package", "gains.py", "def double(x):", "    return 2 * x")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("my_package/gains.py:double", "my_package.gains:double", f"{tmp_path}/my_package/gains.py:double"):
        assert load_object(name, "a function")(4) == 8


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("none.py:Thing", "none.py: no such file; expected a thing"),
        ("no_such_module.at_all:Thing", "no_such_module.at_all: ModuleNotFoundError: No module named 'no_such_module'"),
        ("numpy.no_such_module:Thing", "numpy.no_such_module: ModuleNotFoundError"),
        ("thing", "thing: must be my_file.py:Name or package.module:Name; expected a thing"),
        (":Thing", ":Thing: must be"),
        ("my.py:", "my.py:: must be"),
        ("my.py:Thing()", "my.py:Thing(): must be"),
    ],
)
def test_missing_file_and_name_are_refused(name: str, line: str) -> None:
    assert load_error(name).startswith(line)


def test_wrong_name_lists_known_names(tmp_path: Path) -> None:
    write(
        tmp_path, "my.py", "from pathlib import Path", "class Gain: pass", "def level(): pass", "def _private(): pass"
    )
    assert load_error("my.py:Gains") == "my.py: must define `Gains`, defines Gain, level; expected a thing"
    write(tmp_path, "empty.py", "x = 3")
    assert "must define `Gains`, defines no class or function" in load_error("empty.py:Gains")


def test_import_error_names_the_line(tmp_path: Path) -> None:
    write(tmp_path, "syntax.py", "x = 1", "def f(:", "    pass")
    assert load_error("syntax.py:f") == "syntax.py:2: SyntaxError: invalid syntax; expected a thing"
    write(tmp_path, "uses_it.py", "x = 1", "", "from .syntax import f")
    assert load_error("uses_it.py:f").startswith("syntax.py:2: SyntaxError")
    write(tmp_path, "zero.py", "def f(x):", "    return 1 / x", "", "y = f(0)")
    assert load_error("zero.py:f") == "zero.py:2: ZeroDivisionError: division by zero; expected a thing"
    write(tmp_path, "needs.py", "import no_such_module")
    assert load_error("needs.py:f").startswith("needs.py:1: ModuleNotFoundError: No module named 'no_such_module'")
    write(tmp_path, "leaves.py", "import sys", "sys.exit('enough')")
    assert load_error("leaves.py:f").startswith("leaves.py:2: SystemExit: enough")
    (tmp_path / "bytes.py").write_bytes(b"x = '\xff'\n")
    assert load_error("bytes.py:f").startswith("bytes.py")


def test_import_error_of_a_module_names_the_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, "zero_module.py", "", "x = 1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    assert load_error("zero_module:f").startswith("zero_module.py:2: ZeroDivisionError")


def test_call_error_names_the_innermost_line_of_the_folder(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "from .helper import half", "", "def f(x):", "    return half(x)")
    write(tmp_path, "helper.py", "import json", "def half(x):", "    if x is None:",
          "        raise ValueError('a\\nb')", "    return json.loads(x)")  # fmt: skip
    assert call_error("my.py:f", None) == "helper.py:4: ValueError: a b; expected a number"
    assert call_error("my.py:f", "[").startswith("helper.py:5: json.decoder.JSONDecodeError: Expecting")


def test_wrong_arguments_name_the_definition(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "", "class Thing:", "    def __init__(self, one, two):", "        pass")
    line = call_error("my.py:Thing", 1)
    assert line.startswith("my.py:2: TypeError: Thing.__init__() missing 1 required positional argument: 'two'")


def test_system_exit_is_an_error_and_ctrl_c_is_not(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "def f(error):", "    raise error")
    assert call_error("my.py:f", SystemExit(0)) == "my.py:2: SystemExit: 0; expected a number"
    called = load_object("my.py:f", "a thing")
    with pytest.raises(KeyboardInterrupt), calling(called, "a number"):
        called(KeyboardInterrupt())


def test_place_is_that_of_the_definition(tmp_path: Path) -> None:
    write(
        tmp_path,
        "my.py",
        "import functools",
        "class Thing:",
        "    pass",
        "",
        "@functools.cache",
        "def f():",
        "    pass",
    )
    thing, function = (load_object(f"my.py:{name}", "") for name in ("Thing", "f"))
    assert place_of(thing) == place_of(thing()) == "my.py:2"
    assert place_of(function) == "my.py:5"
    assert place_of(3) == "int"


def test_equal_file_names_in_two_folders_differ(tmp_path: Path) -> None:
    for folder, value in (("a", 1), ("b", 2)):
        write(tmp_path / folder, "helper.py", f"VALUE = {value}")
        write(tmp_path / folder, "my.py", "def now():", "    from .helper import VALUE", "    return VALUE")
    first, second = (load_object(f"{folder}/my.py:now", "") for folder in "ab")
    assert (first(), second(), first()) == (1, 2, 1)


def test_absolute_import_of_a_sibling_gets_a_hint(tmp_path: Path) -> None:
    write(tmp_path, "my_helper.py", "VALUE = 1")
    write(tmp_path, "my.py", "import my_helper", "def f():", "    pass")
    assert "No module named 'my_helper'; for a file of the same folder write `from . import my_helper`" in load_error(
        "my.py:f"
    )


def test_changed_file_is_loaded_anew(tmp_path: Path) -> None:
    write(tmp_path, "helper.py", "VALUE = 1")
    write(tmp_path, "my.py", "from .helper import VALUE", "class Thing:", "    gain = 2, VALUE")
    first = load_object("my.py:Thing", "")
    assert load_object(f"../{tmp_path.name}/my.py:Thing", "") is first
    write(tmp_path, "helper.py", "VALUE = 5")  # same size and modification second as before
    assert (first.gain, load_object("my.py:Thing", "").gain) == ((2, 1), (2, 5))


def test_dataclass_of_a_file_can_be_pickled(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "from __future__ import annotations", "from dataclasses import dataclass, field",
          "@dataclass", "class Thing:", "    gain: list[float] = field(default_factory=list)")  # fmt: skip
    thing = load_object("my.py:Thing", "")([1.0])
    assert pickle.loads(pickle.dumps(thing)) == thing
