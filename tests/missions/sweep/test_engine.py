"""What both engines share: how many missions are under way, and how often one is started."""

import os
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from pdpatrol.missions.sweep.engines.engine import ATTEMPTS, Loss, run_missions
from pdpatrol.missions.sweep.mission_row import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob, make_plan

pytestmark = pytest.mark.whole

JOBS = make_plan(["one_source"], ["seek"], {}, range(40)).jobs


class Engine:
    """Takes a millisecond for each mission; loses some, each time or, if that does not count, five times."""

    def __init__(self, lose: dict[int, Loss]) -> None:
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

    def explain(self, error: Exception) -> Loss:
        number = error.args[0]
        loss = self.lose[number]
        if not loss.n_attempts and self.started[number] == 5:
            del self.lose[number]
        return loss


@pytest.mark.parametrize("n_scheduled", [1, 2, 7])
def test_an_engine_never_has_more_missions_than_it_was_said_to_take(n_scheduled: int) -> None:
    engine, rows = Engine({}), list[MissionRow]()
    run_missions(JOBS, n_scheduled, engine.schedule, engine.explain, rows.append)
    assert engine.most_under_way == n_scheduled
    assert sorted(row.order for row in rows) == list(range(40))


def test_a_mission_is_started_again_as_often_as_its_loss_allows() -> None:
    lose = {3: Loss("died", "its process ended"), 5: Loss("hung", "took too long", ATTEMPTS), 8: Loss("died", "", 0)}
    engine, rows = Engine(lose), dict[int, MissionRow]()
    run_missions(JOBS, 2, engine.schedule, engine.explain, lambda row: rows.update({row.order: row}))
    assert len(rows) == 40
    assert (rows[3].status, rows[3].error, engine.started[3]) == ("died", "its process ended", ATTEMPTS)
    assert (rows[5].status, rows[5].error, engine.started[5]) == ("hung", "took too long", 1)
    assert (rows[8].status, engine.started[8]) == ("finished", 6)
    assert all(rows[n].status == "finished" and engine.started[n] == 1 for n in range(40) if n not in (3, 5, 8))


def test_what_an_engine_cannot_explain_ends_the_sweep() -> None:
    engine = Engine({4: Loss("died", "")})

    def explain(error: Exception) -> Loss:
        raise error

    with pytest.raises(LookupError, match="4"):
        run_missions(JOBS, 2, engine.schedule, explain, lambda row: None)


FORSAKES = """
import os, sys, time
from pdpatrol.missions.sweep.engines.engine import Limits
from pdpatrol.missions.sweep.engines.process_pool import open_pool

pool = open_pool(2, Limits(60.0, 4 * 10**9))
pool.schedule(time.sleep, args=[60.0])
time.sleep(float(sys.argv[1]))
os._exit(1)
"""


@pytest.mark.parametrize("after_s", [0.1, 1.0])
def test_workers_say_nothing_when_who_asked_for_them_ends_while_they_start(after_s: float) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", FORSAKES, str(after_s)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ended.stderr == ""
