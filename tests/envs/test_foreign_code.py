"""Code that users bring along: found by file or module, and blamed in one line."""

import pickle
import sys
from pathlib import Path

import pytest

from pdpatrol.envs.foreign_code import ForeignCodeError, calling, load_object, place_of


def write(folder: Path, name: str, *lines: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def fault(name: str, folder: Path) -> str:
    """The line that refuses to load `name`, without its folder."""
    with pytest.raises(ForeignCodeError) as refused:
        load_object(name, folder, "a thing")
    return one_line(refused.value, folder)


def one_line(error: ForeignCodeError, folder: Path) -> str:
    text = str(error)
    assert len(text.splitlines()) == 1
    return text.replace(f"{folder}/", "")


def fault_of_call(name: str, folder: Path, *arguments: object) -> str:
    called = load_object(name, folder, "a thing")
    with pytest.raises(ForeignCodeError) as refused, calling(called, "a number"):
        called(*arguments)
    return one_line(refused.value, folder)


def test_an_object_is_loaded_from_a_file_of_the_given_folder_and_from_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "my_package", "__init__.py")
    write(tmp_path / "my_package", "gains.py", "def double(x):", "    return 2 * x")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("my_package/gains.py:double", "my_package.gains:double", f"{tmp_path}/my_package/gains.py:double"):
        assert load_object(name, tmp_path, "a function")(4) == 8


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("none.py:Thing", "none.py: no such file; expected a thing"),
        ("no_such_module.at_all:Thing", "no_such_module.at_all: ModuleNotFoundError: No module named 'no_such_module'"),
        ("numpy.no_such_module:Thing", "numpy.no_such_module: ModuleNotFoundError"),
        ("thing", "thing: names no code; expected my_file.py:Name or package.module:Name, a thing"),
        (":Thing", ":Thing: names no code"),
        ("my.py:", "my.py:: names no code"),
        ("my.py:Thing()", "my.py:Thing(): names no code"),
    ],
)
def test_a_name_of_nothing_is_refused(name: str, told: str, tmp_path: Path) -> None:
    assert fault(name, tmp_path).startswith(told)


def test_a_wrong_name_lists_the_names_that_the_file_defines(tmp_path: Path) -> None:
    write(
        tmp_path, "my.py", "from pathlib import Path", "class Gain: pass", "def level(): pass", "def _private(): pass"
    )
    assert fault("my.py:Gains", tmp_path) == "my.py: no `Gains` in it; it has Gain, level; expected a thing"
    write(tmp_path, "empty.py", "x = 3")
    assert "no `Gains` in it; it has no class and no function" in fault("empty.py:Gains", tmp_path)


def test_an_error_on_import_names_the_line_that_failed(tmp_path: Path) -> None:
    write(tmp_path, "syntax.py", "x = 1", "def f(:", "    pass")
    assert fault("syntax.py:f", tmp_path) == "syntax.py:2: SyntaxError: invalid syntax; expected a thing"
    write(tmp_path, "uses_it.py", "x = 1", "", "from .syntax import f")
    assert fault("uses_it.py:f", tmp_path).startswith("syntax.py:2: SyntaxError")
    write(tmp_path, "zero.py", "def f(x):", "    return 1 / x", "", "y = f(0)")
    assert fault("zero.py:f", tmp_path) == "zero.py:2: ZeroDivisionError: division by zero; expected a thing"
    write(tmp_path, "needs.py", "import no_such_module")
    assert fault("needs.py:f", tmp_path).startswith("needs.py:1: ModuleNotFoundError: No module named 'no_such_module'")
    write(tmp_path, "leaves.py", "import sys", "sys.exit('enough')")
    assert fault("leaves.py:f", tmp_path).startswith("leaves.py:2: SystemExit: enough")
    (tmp_path / "bytes.py").write_bytes(b"x = '\xff'\n")
    assert fault("bytes.py:f", tmp_path).startswith("bytes.py")


def test_an_error_on_import_of_a_module_names_its_line_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, "zero_module.py", "", "x = 1 / 0")
    monkeypatch.syspath_prepend(tmp_path)
    assert fault("zero_module:f", tmp_path).startswith("zero_module.py:2: ZeroDivisionError")


def test_an_exception_in_a_call_is_one_line_with_the_innermost_line_of_the_folder(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "from .helper import half", "", "def f(x):", "    return half(x)")
    write(tmp_path, "helper.py", "import json", "def half(x):", "    if x is None:",
          "        raise ValueError('a\\nb')", "    return json.loads(x)")  # fmt: skip
    assert fault_of_call("my.py:f", tmp_path, None) == "helper.py:4: ValueError: a b; expected a number"
    assert fault_of_call("my.py:f", tmp_path, "[").startswith("helper.py:5: json.decoder.JSONDecodeError: Expecting")


def test_a_call_that_does_not_get_inside_names_the_definition(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "", "class Thing:", "    def __init__(self, one, two):", "        pass")
    told = fault_of_call("my.py:Thing", tmp_path, 1)
    assert told.startswith("my.py:2: TypeError: Thing.__init__() missing 1 required positional argument: 'two'")


def takes_two(one: int, two: int) -> None:
    """Stands in the file of its caller."""


def test_the_line_of_the_caller_is_not_blamed() -> None:
    with pytest.raises(ForeignCodeError) as refused, calling(takes_two, "nothing"):
        takes_two(1)  # pyright: ignore[reportCallIssue]
    assert str(refused.value).startswith(f"{place_of(takes_two)}: TypeError")


def test_a_long_text_is_cut(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "def f():", "    raise ValueError('word ' * 1000)")
    assert 100 < len(fault_of_call("my.py:f", tmp_path)) < 400


def test_leaving_the_program_is_an_error_and_ctrl_c_is_none(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "def f(error):", "    raise error")
    assert fault_of_call("my.py:f", tmp_path, SystemExit(0)) == "my.py:2: SystemExit: 0; expected a number"
    called = load_object("my.py:f", tmp_path, "a thing")
    with pytest.raises(KeyboardInterrupt), calling(called, "a number"):
        called(KeyboardInterrupt())


def test_a_fault_that_is_one_line_already_stays_as_it_is(tmp_path: Path) -> None:
    first = ForeignCodeError("my.py:1: wrong")
    with pytest.raises(ForeignCodeError) as refused, calling(tmp_path, "a number"):
        raise first
    assert refused.value is first


def test_the_place_of_a_thing_is_where_it_or_its_class_is_defined(tmp_path: Path) -> None:
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
    thing, function = (load_object(f"my.py:{name}", tmp_path, "") for name in ("Thing", "f"))
    assert place_of(thing) == place_of(thing()) == f"{tmp_path}/my.py:2"
    assert place_of(function) == f"{tmp_path}/my.py:5"
    assert place_of(3) == "int"


def test_files_of_one_name_in_two_folders_stay_apart_with_their_siblings(tmp_path: Path) -> None:
    for folder, value in (("a", 1), ("b", 2)):
        write(tmp_path / folder, "helper.py", f"VALUE = {value}")
        write(tmp_path / folder, "my.py", "def now():", "    from .helper import VALUE", "    return VALUE")
    first, second = (load_object(f"{folder}/my.py:now", tmp_path, "") for folder in "ab")
    assert (first(), second(), first()) == (1, 2, 1)


def test_a_sibling_imported_as_if_it_were_installed_is_told_how(tmp_path: Path) -> None:
    write(tmp_path, "my_helper.py", "VALUE = 1")
    write(tmp_path, "my.py", "import my_helper", "def f():", "    pass")
    assert "No module named 'my_helper'; a file of the same folder: `from . import my_helper`" in fault(
        "my.py:f", tmp_path
    )


def test_a_file_is_loaded_once_until_it_or_a_sibling_changes(tmp_path: Path) -> None:
    write(tmp_path, "helper.py", "VALUE = 1")
    write(tmp_path, "my.py", "from .helper import VALUE", "class Thing:", "    gain = 2, VALUE")
    first = load_object("my.py:Thing", tmp_path, "")
    assert load_object("../" + tmp_path.name + "/my.py:Thing", tmp_path, "") is first
    write(tmp_path, "helper.py", "VALUE = 5")  # as long as before, in the same second
    second = load_object("my.py:Thing", tmp_path, "")
    write(tmp_path, "my.py", "from .helper import VALUE", "class Thing:", "    gain = 3, VALUE")
    third = load_object("my.py:Thing", tmp_path, "")
    assert (first.gain, second.gain, third.gain) == ((2, 1), (2, 5), (3, 5))


def test_a_file_that_was_mended_loads(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "x = 1 / 0", "def f():", "    return 1")
    assert fault("my.py:f", tmp_path).startswith("my.py:1: ZeroDivisionError")
    write(tmp_path, "my.py", "x = 1 / 1", "def f():", "    return 1")
    assert load_object("my.py:f", tmp_path, "")() == 1


def test_loading_leaves_no_trace_in_the_folder_and_none_on_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    before = list(sys.path)
    write(tmp_path, "helper.py")
    write(tmp_path, "my.py", "from . import helper", "class Thing: pass")
    load_object("my.py:Thing", tmp_path, "")
    assert {path.name for path in tmp_path.iterdir()} == {"my.py", "helper.py"}
    assert sys.path == before
    assert not sys.dont_write_bytecode


def test_a_class_of_a_file_can_be_a_dataclass_and_be_copied(tmp_path: Path) -> None:
    write(tmp_path, "my.py", "from __future__ import annotations", "from dataclasses import dataclass, field",
          "@dataclass", "class Thing:", "    gain: list[float] = field(default_factory=list)")  # fmt: skip
    thing = load_object("my.py:Thing", tmp_path, "")([1.0])
    assert pickle.loads(pickle.dumps(thing)) == thing
