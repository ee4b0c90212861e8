"""Packages import only lower ones and never in circles, and each heavy library is imported in one place."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

MAY_IMPORT = {
    "dirmusic": set(),
    "sensing": {"dirmusic"},
    "robot_models": {"dirmusic.arrays", "dirmusic.compiled", "dirmusic.input_file"},
    "envs": {"sensing", "dirmusic", "robot_models"},
    "missions": {"envs", "sensing", "dirmusic", "robot_models"},
}
ONLY_HOME = {
    "mujoco": "robot_models/",
    "rerun": "missions/recording/",
    "stable_baselines3": (),  # examples only
    "torch": (),
    "ray": "missions/sweep/ray_engine.py",
    "numba": "dirmusic/compiled.py",
}
DIRMUSIC_MAY_USE = {"numpy", "scipy", "numba"}


def imports(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            yield node.module or ""


def modules(root: Path) -> dict[str, Path]:
    """Return every module of the packages by its dotted name."""
    files = [file for package in MAY_IMPORT for file in sorted((root / package).rglob("*.py"))]
    return {module_name(file.relative_to(root)): file for file in files}


def module_name(file: Path) -> str:
    """Return the import name of a file: every folder except `dirmusic` is imported as part of `pdpatrol`."""
    name = ".".join(file.with_suffix("").parts).removesuffix(".__init__")
    return name if file.parts[0] == "dirmusic" else f"pdpatrol.{name}"


def imported_modules(file: Path, known: set[str]) -> set[str]:
    """Return the modules of this project that a file imports: at the top, inside functions, or only for types."""
    named: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            named |= {f"{node.module}.{alias.name}" for alias in node.names} & known or {node.module}
    return named & known


def faults(root: Path) -> list[str]:
    found: list[str] = []
    for package, allowed in MAY_IMPORT.items():
        for file in sorted((root / package).rglob("*.py")):
            place = file.relative_to(root).as_posix()
            for module in imports(file):
                top = module.removeprefix("pdpatrol.").partition(".")[0]
                if top in MAY_IMPORT and top != package and not {top, module} & allowed:
                    found.append(f"{place} imports {module}")
                if top in ONLY_HOME and not place.startswith(ONLY_HOME[top]):
                    found.append(f"{place} imports {module}")
                if package == "dirmusic" and top not in {"dirmusic", *DIRMUSIC_MAY_USE, *sys.stdlib_module_names}:
                    found.append(f"{place} imports {module}")
    return found


def test_imports_go_down_only() -> None:
    assert faults(ROOT) == []


def test_no_modules_import_each_other_in_a_circle() -> None:
    """No module imports itself through other modules; imports inside functions count."""
    files = modules(ROOT)
    graph = TopologicalSorter({name: imported_modules(file, set(files)) for name, file in files.items()})
    graph.prepare()  # raises a CycleError that names the modules


def test_top_level_holds_packages_and_tests() -> None:
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert packages == {*MAY_IMPORT, "pdpatrol"}
    links = {path.name for path in (ROOT / "pdpatrol").iterdir() if path.is_symlink()}
    assert links == set(MAY_IMPORT) - {"dirmusic"}
    assert (ROOT / "tests").is_dir()


@pytest.mark.whole
def test_pulse_passes_few_files() -> None:
    """From emission to finding a pulse executes functions in at most 45 files."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.pulse_path"],
        cwd=ROOT,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    files = done.stdout.split()[:-2]
    assert "sensing/nature/sources.py" in files
    assert "dirmusic/locating/locator.py" in files
    assert len(files) <= 45
