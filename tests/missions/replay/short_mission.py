"""Missions that end after a few seconds, and copies of their logs."""

from pdpatrol.envs import load_scenario
from pdpatrol.missions.record.mission_log import TABLES, MissionLog
from pdpatrol.missions.runner import Mission


def short_mission(
    end_s: float = 8.0, seed: int = 0, date: str | None = None, scenario: str = "one_source"
) -> MissionLog:
    """Run a mission that is ended early."""
    settings = {} if date is None else {"campaign.date": date}

    def end_early(mission: Mission) -> None:
        if mission.time_s > end_s:
            mission.end("interrupted")

    return Mission(load_scenario(scenario, settings), "seek", seed).run(end_early)


def copy_of(log: MissionLog, *tables: str, n_steps: int | None = None, **meta: object) -> MissionLog:
    """Return a copy of the tables of a log up to a step, with some metadata replaced."""
    copy = MissionLog({**log.meta, **meta})
    for table in tables or TABLES:
        columns = log.table(table, 0, None if n_steps is None else log.rows_before(table, n_steps))
        for row in zip(*columns.values(), strict=True):
            copy.append(table, **dict(zip(columns, row, strict=True)))
    return copy
