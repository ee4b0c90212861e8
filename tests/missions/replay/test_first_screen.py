"""Order of the data in a recording: what a browser draws before the rest of the file has arrived."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from pdpatrol.envs import load_scenario
from pdpatrol.missions.recording import write_recording
from pdpatrol.missions.runner import run_mission

SHARE = 0.2
"""Share of the bytes of a recording after which the first screen is complete."""


@pytest.mark.whole
def test_static_data_and_phases_come_first(tmp_path: Path) -> None:
    """Yard, robot, colours, layout, axes and the named phases of the default mission are in its first bytes."""
    path, cut = tmp_path / "mission.rrd", tmp_path / "cut.rrd"
    write_recording(run_mission(load_scenario("one_source"), "seek", 0), path)
    data = path.read_bytes()
    cut.write_bytes(data[: int(SHARE * len(data))])
    printed = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", str(cut)], capture_output=True, text=True, check=False
    ).stdout
    arrived = set(re.findall(r"Chunk\((chunk_\w+)\)", printed))
    reader = RrdReader(path)
    chunks = reader.stream().to_chunks()
    (layout,) = reader.blueprints()
    needed = [chunk for chunk in chunks if chunk.is_static] + reader.stream(store=layout).to_chunks()
    needed += [chunk for chunk in chunks if str(chunk.entity_path) in ("/mission/phase", "/world/robot")]
    names = {str(chunk.entity_path) for chunk in needed}
    for name in ("yard/equipment/box", "robot/body/cylinder", "yard/names", "route"):
        assert f"/world/{name}" in names
    assert {"/mission/phase", "/phase_pattern/axes", "/plots/uncertainty/limit", "/viewport"} <= names
    assert not sorted(str(chunk.entity_path) for chunk in needed if chunk.id not in arrived)
    assert len(arrived) < len(chunks)
