"""Run every command and every snippet of the README."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.scenario.severity import DEFAULT

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BIN = Path(sys.executable).parent
INSTALL = "pip install uv && "
FOLLOWS = {"replay": "run two_sources --seed 7", "results": "sweep suite"}
SCENARIOS = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def commands() -> list[str]:
    """Return the commands of the README in order, without installation."""
    lines = [line.strip() for block in blocks("sh") for line in block.splitlines()]
    return [line.split("  #")[0].removeprefix(INSTALL).strip() for line in lines if "uv run" in line]


def test_first_two_commands_include_installation() -> None:
    lines = [line.split("  #")[0].strip() for line in blocks("sh")[0].splitlines()]
    assert lines == [INSTALL + "uv run pdpatrol run", INSTALL + "uv run pytest"]


def sequences() -> list[list[str]]:
    """Group the commands: each alone, except those that read the output of another."""
    found: dict[str, list[str]] = {}
    for command in commands():
        name = command.removeprefix("uv run pdpatrol ").split()[0]
        before = f"uv run pdpatrol {FOLLOWS[name]}" if name in FOLLOWS else command
        found.setdefault(next((first for first in found if first.startswith(before)), command), []).append(command)
    return list(found.values())


@pytest.mark.parametrize("sequence", sequences(), ids=lambda sequence: sequence[-1])
def test_readme_command_works(sequence: list[str], tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    environment = os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    for command in sequence:
        words = command.removeprefix("uv run ").split()
        if words[0] == "pytest":
            done = subprocess.run(
                [*words, "--collect-only", "-q"], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120
            )
        elif words[:2] == ["pdpatrol", "replay"]:
            served_on_loopback([*words, "--web"] if "--web" not in words else words, tmp_path, environment)
            continue
        else:
            done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=180)
        assert done.returncode == 0, f"{command}: {done.stderr}"


def test_documented_settings_are_accepted(tmp_path: Path) -> None:
    shipped = (ROOT / "envs" / "scenarios" / "one_source.toml").read_text(encoding="utf-8")
    assert "[nature" not in shipped
    (tmp_path / "yard.toml").write_text("\n".join([shipped, *blocks("toml", SCENARIOS)]), encoding="utf-8")
    (tmp_path / "my_severity.toml").write_text(DEFAULT.read_text(encoding="utf-8"), encoding="utf-8")
    scenario = load_scenario(tmp_path / "yard.toml")
    assert scenario.survey.severity is not None
    assert len(scenario.nature.receiver.faults) == 2
    assert len(scenario.carriers) == 1
    assert [interferer.speed_mps for interferer in scenario.interferers] == [8.0, None]
    assert scenario.campaign.number == 1
    assert scenario.georeference is not None
    assert "kiosk" in {item.name for item in scenario.known_yard.equipment}


def served_on_loopback(words: list[str], folder: Path, environment: dict[str, str]) -> None:
    """Check that a command prints the address of its server, and ends when it is asked to."""
    errors = folder / "errors.txt"
    with (
        errors.open("w") as stderr,
        subprocess.Popen(
            words,
            cwd=folder,
            env=environment | {"PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
        ) as process,
    ):
        assert process.stdout is not None
        line = process.stdout.readline()
        process.terminate()
        try:
            process.wait(timeout=120)
        except subprocess.TimeoutExpired:
            process.kill()
            pytest.fail(f"still serves two minutes after SIGTERM: {errors.read_text()}")
    assert "http://127.0.0.1:" in line, errors.read_text()


def run_snippet(snippet: str, folder: Path) -> None:
    """Run Python code in a folder."""
    done = subprocess.run([sys.executable, "-c", snippet], cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("snippet", blocks("python"))
def test_readme_snippet_runs(snippet: str, tmp_path: Path) -> None:
    run_snippet(snippet, tmp_path)


def test_files_linked_from_readme_exist() -> None:
    named = re.findall(r"\]\((?!http)([^)#]+)\)", README)
    assert named
    assert all((ROOT / name).exists() for name in named)
