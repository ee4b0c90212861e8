"""Imports go down only, and each heavy library has one home."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

MAY_IMPORT = {
    "dirmusic": set(),
    "sensing": {"dirmusic"},
    "robot_models": set(),
    "envs": {"sensing", "dirmusic", "robot_models"},
    "missions": {"envs", "sensing", "dirmusic", "robot_models"},
}
LEARNING = ("missions/learning/learner_envs.py", "missions/learning/training.py")
ONLY_HOME = {
    "mujoco": "robot_models/",
    "rerun": "missions/recording/",
    "stable_baselines3": LEARNING,
    "torch": LEARNING,
    "numba": ("dirmusic/compiled.py", "robot_models/readings.py"),
}
DIRMUSIC_MAY_USE = {"numpy", "scipy", "numba"}


def imports(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            yield node.module or ""


def faults(root: Path) -> list[str]:
    found: list[str] = []
    for package, allowed in MAY_IMPORT.items():
        for file in sorted((root / package).rglob("*.py")):
            place = file.relative_to(root).as_posix()
            for module in imports(file):
                top = module.partition(".")[0]
                if top in MAY_IMPORT and top != package and top not in allowed:
                    found.append(f"{place} imports {module}")
                if top in ONLY_HOME and not place.startswith(ONLY_HOME[top]):
                    found.append(f"{place} imports {module}")
                if package == "dirmusic" and top not in {"dirmusic", *DIRMUSIC_MAY_USE, *sys.stdlib_module_names}:
                    found.append(f"{place} imports {module}")
    return found


def test_imports_go_down_only() -> None:
    assert faults(ROOT) == []


@pytest.mark.parametrize(
    ("package", "line"),
    [
        ("dirmusic", "import sensing"),
        ("dirmusic", "import pydantic"),
        ("sensing", "from envs.scenario import Scenario"),
        ("sensing", "import mujoco"),
        ("robot_models", "from dirmusic.angles import wrap"),
        ("envs", "import mujoco"),
        ("envs", "from missions.log import MissionLog"),
        ("missions", "import rerun as rr"),
        ("missions", "from stable_baselines3 import PPO"),
        ("envs", "import torch"),
    ],
)
def test_a_forbidden_import_is_noticed(package: str, line: str, tmp_path: Path) -> None:
    (tmp_path / package).mkdir()
    (tmp_path / package / "module.py").write_text(f"def later() -> None:\n    {line}\n", encoding="utf-8")
    assert faults(tmp_path)


def test_the_top_holds_exactly_the_five_packages_and_the_tests() -> None:
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert packages == set(MAY_IMPORT)
    assert (ROOT / "tests").is_dir()
