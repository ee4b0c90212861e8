"""The package works next to other packages: clashing import names, PYTHONPATH, and a wheel in an empty folder."""

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.processes import PDPATROL

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[1]
STEP = """
import gymnasium, dirmusic, pdpatrol, pdpatrol.missions.runner
env = gymnasium.make("pdpatrol:PDPatrol-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
print(pdpatrol.__file__)
"""
LARGEST_CORE_MB = 450
FOREIGN = ("envs", "sensing", "robot_models", "missions")


def run(*command: str | Path, cwd: Path, pythonpath: Path | str | None = None) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if pythonpath is not None:
        environment["PYTHONPATH"] = str(pythonpath)
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def add_foreign_packages(folder: Path) -> None:
    for name in FOREIGN:
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("raise ImportError('a package of somebody else')\n")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from the sdist, as a release does."""
    folder = tmp_path_factory.mktemp("dist")
    run("uv", "build", "--quiet", "--out-dir", folder, cwd=ROOT)
    return next(folder.glob("*.whl"))


def install(package: Path, folder: Path) -> Path:
    run("uv", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", folder, package, cwd=ROOT)
    return folder


def test_environment_works_next_to_own_envs_folder(tmp_path: Path) -> None:
    add_foreign_packages(tmp_path)
    run(sys.executable, "-c", STEP, cwd=tmp_path)


@pytest.mark.parametrize("envs_first", [True, False])
def test_environment_survives_package_named_envs(wheel: Path, tmp_path: Path, envs_first: bool) -> None:
    """`pip install envs` and this package do not share a file, whichever comes first."""
    other = tmp_path / "other"
    add_foreign_packages(other)
    (other / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        '[project]\nname = "envs"\nversion = "1.0"\n'
        f"[tool.hatch.build.targets.wheel]\npackages = {list(FOREIGN)}\n"
    )
    run("uv", "build", "--quiet", "--wheel", "--out-dir", tmp_path, other, cwd=tmp_path)
    (foreign,) = tmp_path.glob("envs-*.whl")
    for package in (foreign, wheel) if envs_first else (wheel, foreign):
        install(package, tmp_path / "site")
    assert str(tmp_path) in run(sys.executable, "-c", STEP, cwd=tmp_path, pythonpath=tmp_path / "site")
    for name in FOREIGN:
        assert (tmp_path / "site" / name / "__init__.py").read_text().startswith("raise")


def test_cli_works_with_pythonpath_dot(tmp_path: Path) -> None:
    add_foreign_packages(tmp_path)
    assert "one_source" in run(PDPATROL, "scenarios", cwd=tmp_path, pythonpath=".")
    assert "one_source" in run(PDPATROL, "scenarios", cwd=ROOT, pythonpath=".")


def core_distributions() -> set[str]:
    """Collect the names of the distributions that are installed without extras."""
    found: set[str] = set()
    waiting = [Requirement("pdpatrol")]
    while waiting:
        wanted = waiting.pop()
        if wanted.name not in found:
            found.add(wanted.name)
            for requirement in map(Requirement, metadata.requires(wanted.name) or ()):
                extras = wanted.extras or {""}
                if requirement.marker is None or any(requirement.marker.evaluate({"extra": extra}) for extra in extras):
                    waiting.append(requirement)
    return found


def test_core_installation_is_small() -> None:
    """Count the files packed in the wheels of the dependencies, without the bytecode that pip adds."""
    names = core_distributions()
    assert names.isdisjoint({"matplotlib", "pyarrow", "rerun-sdk", "tyro"})
    files = [file for name in names for file in metadata.files(name) or () if file.suffix != ".pyc"]
    assert sum(file.size or 0 for file in files) < LARGEST_CORE_MB * 1e6
