"""The campaign example does what its README states."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.whole

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "campaign"
README = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_commands_of_the_readme_give_its_table(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (script,) = re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)
    pdpatrol = f"{sys.executable} -c 'from pdpatrol.missions.cli import main; main()'"
    done = subprocess.run(
        ["sh", "-ec", script.replace("uv run pdpatrol", pdpatrol)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    trend = json.loads((tmp_path / "runs" / "trend" / "trend.json").read_text("utf-8"))
    assert [each["verdict"] for each in trend["discharges"]] == ["grown", "constant"]
    rows = re.findall(r"^\| `(\S+)` \| (\w+)", README, flags=re.MULTILINE)
    assert rows == [(each["site"].split()[0], each["verdict"]) for each in trend["discharges"]]
