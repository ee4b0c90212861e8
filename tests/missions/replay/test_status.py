"""What a recording says in words: why the robot drives where it does, and what was found."""

from pathlib import Path

import numpy as np

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording import paths, write_recording
from pdpatrol.missions.recording.drawing.status import phase_words
from pdpatrol.missions.runner import Mission
from tests.missions.replay.read_back import cells, still, values


def log_of(*phases: Phase) -> MissionLog:
    """A log of one second in each phase, in the yard of a shipped scenario."""
    log = MissionLog(Mission(load_scenario("one_source"), "seek", 0).log.meta)
    for number, phase in enumerate(phases):
        for k in range(10):
            log.append(
                "step",
                time_s=number + 0.1 * (k + 1),
                pose=np.array([10.0, 5.0, 0.0]),
                true_pose=np.array([10.0, 5.0, 0.0]),
                odometry=np.zeros(3),
                battery=1.0,
                command=np.zeros(2),
                phase=phase.name,
                phase_target=phase.target,
            )
    return log


def add_finding(log: MissionLog, step: int, **given: object) -> None:
    row: dict[str, object] = {
        "id": 3,
        "position_m": np.array([18.0, 5.0, 1.5]),
        "covariance_m2": np.diag([0.8, 0.04, 0.09]),
        "state": "candidate",
        "n_bearings": 40,
        "first_detected_s": 0.1,
        "confirmed_s": np.nan,
        "aperture_rad": np.radians(20.0),
    }
    log.append("finding", step=step, **row | given)


def texts(log: MissionLog, folder: Path) -> dict[int, str]:
    """What the status says, by the step from which it does."""
    write_recording(log, folder / "mission.rrd")
    return {step: text for step, (text,) in cells(values(folder / "mission.rrd")[f"/{paths.STATUS}"], "text").items()}


def test_it_says_what_a_candidate_needs_to_be_confirmed_and_how_far_it_is(tmp_path: Path) -> None:
    log = log_of(Phase("seek", 3))
    add_finding(log, 4)
    rules = load_scenario("one_source").locating.rules()
    told = texts(log, tmp_path)[4]
    missing = int(np.ceil(np.degrees(rules.confirm_aperture_rad) - 20.0))
    assert "### Goes for candidate 3" in told
    assert f"It is 8 m away. To be confirmed it needs {missing}° more aperture and" in told
    assert f"an ellipse of {rules.confirm_semi_major_m:g} m, now 2.2 m." in told
    assert "| candidate 3 | 18.0, 5.0 | 1.5 m | 2.2 m | 20° |" in told


def test_ghosts_and_what_was_dropped_are_not_listed(tmp_path: Path) -> None:
    log = log_of(Phase("patrol", 1))
    add_finding(log, 1)
    add_finding(log, 1, id=4, state="confirmed")
    add_finding(log, 5, state="ghost")
    told = texts(log, tmp_path)
    assert "candidate 3" in told[4]
    assert "candidate 3" not in told[9]
    assert "**finding 4**" in told[9]


def test_at_the_end_it_says_what_was_found_on_which_site_and_of_which_kind(tmp_path: Path) -> None:
    log = log_of(Phase("return to dock"))
    site, place = next(iter(log.meta["sites"].items()))
    add_finding(log, 8, state="confirmed", position_m=np.array(place), covariance_m2=1e-4 * np.eye(3), confirmed_s=0.5)
    log.append("event", step=9, kind="end", number=0, subject="docked", text="mission over: docked")
    write_recording(log, tmp_path / "mission.rrd")
    found = values(tmp_path / "mission.rrd")
    (told,) = cells(found[f"/{paths.STATUS}"], "text")[9]
    assert "### Mission over after 1 s: docked" in told
    assert site.replace("_", "\\_") in told
    (label,) = cells(found[f"/{paths.finding_path(3)}/label"], "labels")[9]
    assert label.startswith(f"finding 3: {site}")


def test_each_phase_has_its_words_and_its_colour_whenever_it_comes(tmp_path: Path) -> None:
    write_recording(
        log_of(Phase("patrol", 1), Phase("seek", 3), Phase("patrol", 1), Phase("my own")), tmp_path / "mission.rrd"
    )
    entity = values(tmp_path / "mission.rrd")[f"/{paths.PHASE}"]
    states = cells(entity, "state")
    assert {step: state for step, (state,) in states.items()} == {
        0: "patrol 1",
        10: "seek 3",
        20: "patrol 1",
        30: "my own",
    }
    assert still(entity, "labels") == ["drives to waypoint 1", "goes for candidate 3", "my own"]
    assert len(set(still(entity, "colors"))) == 3


def test_foreign_words_are_shown_as_they_are() -> None:
    assert phase_words(Phase("patrol")) == "drives the route"
    assert phase_words(Phase("my_policy | <b>")) == "my_policy | <b>"
