"""Learning libraries run on the environments without adapters."""

import os
import re
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "learning_libraries"
LIBRARIES = ("sb3", "skrl", "torchrl", "tianshou", "rllib")
OURS = r"^(from|import) (pdpatrol|dirmusic)\b"


def test_script_imports_no_adapter_of_ours() -> None:
    script = (FOLDER / "run.py").read_text(encoding="utf-8")
    assert not re.findall(OURS, script, flags=re.MULTILINE)
    assert set(re.findall(r"^def (\w+)\(steps", script, flags=re.MULTILINE)) == set(LIBRARIES)


@pytest.mark.slow
@pytest.mark.parametrize("library", LIBRARIES)
def test_library_takes_2000_steps(library: str, tmp_path: Path) -> None:
    """Dependencies are installed by uv, which also searches the wheel folders of pip."""
    links = os.environ.get("UV_FIND_LINKS", os.environ.get("PIP_FIND_LINKS", "")).replace(" ", ",")
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    environment |= {"UV_FIND_LINKS": links} if links else {}
    words = ["uv", "run", "--script", str(FOLDER / "run.py"), library, "--steps", "2000"]
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-3000:]
    steps = re.search(rf"^{library}: (\d+) steps$", done.stdout, flags=re.MULTILINE)
    assert steps
    assert int(steps.group(1)) >= 2000
