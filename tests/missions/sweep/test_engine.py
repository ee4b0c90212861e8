"""The loop of both engines: number of missions under way, and number of attempts."""

from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from pdpatrol.missions.sweep.dataset import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob, make_plan
from pdpatrol.missions.sweep.pool import ATTEMPTS, run_missions

pytestmark = pytest.mark.whole

JOBS = make_plan(["one_source"], ["seek"], {}, range(40)).jobs


class FakeEngine:
    """Engine that loses some missions with a given status, and counts those under way."""

    def __init__(self, lose: dict[int, str]) -> None:
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
        if job.order in self.lose:
            raise LookupError(job.order)
        return MissionRow.of_failure(job, "finished", "")

    def explain(self, error: Exception) -> tuple[str, str]:
        return self.lose[error.args[0]], "lost"


@pytest.mark.parametrize("n_scheduled", [1, 2, 7])
def test_lost_mission_is_started_again_if_it_died(n_scheduled: int) -> None:
    engine, rows = FakeEngine({3: "died", 5: "hung"}), dict[int, MissionRow]()
    run_missions(JOBS, n_scheduled, engine.schedule, engine.explain, lambda row: rows.update({row.order: row}))
    assert len(rows) == 40
    assert engine.most_under_way <= n_scheduled
    assert (rows[3].status, rows[3].error, engine.started[3]) == ("died", "lost", ATTEMPTS)
    assert (rows[5].status, engine.started[5]) == ("hung", 1)
    assert all(rows[n].status == "finished" and engine.started[n] == 1 for n in range(40) if n not in (3, 5))


def test_unexplained_error_ends_the_sweep() -> None:
    engine = FakeEngine({4: "died"})

    def explain(error: Exception) -> tuple[str, str]:
        raise error

    with pytest.raises(LookupError, match="4"):
        run_missions(JOBS, 2, engine.schedule, explain, lambda row: None)
