"""The loop of both engines: number of missions under way, and number of attempts."""

import time
from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from pdpatrol.missions.sweep.dataset import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob, make_plan
from pdpatrol.missions.sweep.pool import ATTEMPTS, LostMission, run_missions

pytestmark = pytest.mark.whole

JOBS = make_plan(["one_source"], ["seek"], {}, range(40)).jobs


class FakeEngine:
    """Engine that takes a millisecond a mission and loses some missions.

    A mission is lost each time, or five times if its loss does not count as an attempt.
    """

    def __init__(self, lose: dict[int, LostMission]) -> None:
        self.lose = lose
        self.thread = ThreadPoolExecutor(1)
        self.futures: list[Future[MissionRow]] = []
        self.started: Counter[int] = Counter()
        self.most_under_way = 0

    def schedule(self, job: MissionJob) -> Future[MissionRow]:
        self.started[job.order] += 1
        self.futures.append(self.thread.submit(self.run, job))
        self.most_under_way = max(self.most_under_way, sum(not future.done() for future in self.futures))
        return self.futures[-1]

    def run(self, job: MissionJob) -> MissionRow:
        time.sleep(1e-3)
        if job.order in self.lose:
            raise LookupError(job.order)
        return MissionRow.of_failure(job, "finished", "")

    def explain(self, error: Exception) -> LostMission:
        number = error.args[0]
        loss = self.lose[number]
        if not loss.n_attempts and self.started[number] == 5:
            del self.lose[number]
        return loss


@pytest.mark.parametrize("n_scheduled", [1, 2, 7])
def test_engine_has_at_most_the_scheduled_missions(n_scheduled: int) -> None:
    engine, rows = FakeEngine({}), list[MissionRow]()
    run_missions(JOBS, n_scheduled, engine.schedule, engine.explain, rows.append)
    assert engine.most_under_way == n_scheduled
    assert sorted(row.order for row in rows) == list(range(40))


def test_lost_mission_is_started_again_as_its_loss_allows() -> None:
    lose = {
        3: LostMission("died", "its process ended"),
        5: LostMission("hung", "took too long", ATTEMPTS),
        8: LostMission("died", "", 0),
    }
    engine, rows = FakeEngine(lose), dict[int, MissionRow]()
    run_missions(JOBS, 2, engine.schedule, engine.explain, lambda row: rows.update({row.order: row}))
    assert len(rows) == 40
    assert (rows[3].status, rows[3].error, engine.started[3]) == ("died", "its process ended", ATTEMPTS)
    assert (rows[5].status, rows[5].error, engine.started[5]) == ("hung", "took too long", 1)
    assert (rows[8].status, engine.started[8]) == ("finished", 6)
    assert all(rows[n].status == "finished" and engine.started[n] == 1 for n in range(40) if n not in (3, 5, 8))


def test_unexplained_error_ends_the_sweep() -> None:
    engine = FakeEngine({4: LostMission("died", "")})

    def explain(error: Exception) -> LostMission:
        raise error

    with pytest.raises(LookupError, match="4"):
        run_missions(JOBS, 2, engine.schedule, explain, lambda row: None)
