"""What a recording is called: read back from its file."""

from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.identity import recording_name, recording_stream
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import Mission, run_mission


@pytest.fixture(scope="module")
def log() -> MissionLog:
    def end_early(mission: Mission) -> None:
        if mission.time_s > 45.0:
            mission.end("interrupted")

    return run_mission(load_scenario("one_source"), seed=0, after_step=end_early)


def written(log: MissionLog, path: Path) -> RrdReader:
    stream = recording_stream(log)
    content = stream.binary_stream()
    path.write_bytes(content.read(flush=True) or b"")
    stream.disconnect()
    return RrdReader(path)


def properties(reader: RrdReader) -> dict[str, object]:
    """All of a recording, without what identifies rows."""
    (row,) = [
        row
        for chunk in reader.stream().to_chunks()
        if str(chunk.entity_path) == "/__properties/mission"
        for row in chunk.to_record_batch().to_pylist()
    ]
    return {name: value[0] for name, value in row.items() if "RowId" not in name}


def test_a_recording_says_what_was_run_and_what_the_report_says_was_found(log: MissionLog, tmp_path: Path) -> None:
    report = make_report(log, 0.0)
    n_found = sum(source.found for source in report.scores.sources)
    assert n_found == len(report.findings) == 1
    reader = written(log, tmp_path / "a.rrd")
    told = properties(reader)
    assert (told["scenario"], told["seed"], told["policy"]) == ("one_source", 0, "seek")
    assert (told["findings"], told["sources_found"], told["sources"]) == (1, n_found, 1)
    assert told["simulated_s"] == round(report.sim_time_s, 1)
    assert recording_name(log) == "one_source, seed 0, seek: found 1 of 1"
    (entry,) = reader.recordings()
    assert entry.application_id == "pdpatrol one_source"


def test_one_log_is_one_recording_and_another_mission_of_its_scenario_shares_the_blueprint_alone(
    log: MissionLog, tmp_path: Path
) -> None:
    other = MissionLog({**log.meta, "seed": 2})
    (first,), (again,), (second,) = (
        written(each, tmp_path / f"{k}.rrd").recordings() for k, each in enumerate((log, log, other))
    )
    assert first == again
    assert first.recording_id != second.recording_id
    assert first.application_id == second.application_id


def test_a_mission_without_truth_or_end_is_named_by_what_is_known(log: MissionLog) -> None:
    field = MissionLog({"name": "survey", "seed": None, "policy": None, "n_elements": 6})
    assert recording_name(field) == "survey: 0 findings"
    row = {name: column[-1] for name, column in log.table("finding").items()}
    field.append("finding", **row | {"state": "confirmed", "position_m": np.zeros(3)})
    assert recording_name(field) == "survey: 1 finding"
    assert recording_name(MissionLog({"n_elements": 4})) == "mission: 0 findings"
