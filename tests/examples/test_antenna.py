"""The script of the antenna example makes the tables that the project ships."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.docs.site import ROOT

pytestmark = pytest.mark.whole


@pytest.mark.slow
def test_command_of_the_readme_makes_the_shipped_tables(tmp_path: Path) -> None:
    links = os.environ.get("UV_FIND_LINKS", os.environ.get("PIP_FIND_LINKS", "")).replace(" ", ",")
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
    environment |= {"UV_FIND_LINKS": links} if links else {}
    words = ["uv", "run", str(ROOT / "examples" / "antenna" / "helix.py"), "--figure"]
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-3000:]
    assert {path.name for path in tmp_path.iterdir()} == {"helix.csv", "helix_in_ring.csv", "helix.png"}
    for name in ("helix.csv", "helix_in_ring.csv"):
        made, shipped = (
            np.loadtxt(folder / name, delimiter=",", skiprows=1)
            for folder in (tmp_path, ROOT / "sensing" / "array" / "patterns")
        )
        np.testing.assert_allclose(made, shipped, atol=1e-3)
