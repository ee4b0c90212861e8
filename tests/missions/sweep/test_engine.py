"""The loop of both engines: number of missions under way, and number of attempts."""

from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from pdpatrol.missions.sweep.dataset import MissionRow
from pdpatrol.missions.sweep.plan import MissionJob, make_plan
from pdpatrol.missions.sweep.pool import ATTEMPTS, run_missions

LOST = {3: "died", 5: "hung"}


def run(job: MissionJob) -> MissionRow:
    if job.order in LOST:
        raise LookupError(job.order)
    return MissionRow.of_failure(job, "finished", "")


@pytest.mark.parametrize("n_scheduled", [1, 2, 7])
def test_lost_mission_is_started_again_if_it_died(n_scheduled: int) -> None:
    jobs = make_plan(["one_source"], ["seek"], {}, range(40)).jobs
    rows, started, futures = dict[int, MissionRow](), Counter[int](), list[Future[MissionRow]]()
    with ThreadPoolExecutor(1) as thread:

        def schedule(job: MissionJob) -> Future[MissionRow]:
            started[job.order] += 1
            futures.append(thread.submit(run, job))
            assert sum(not future.done() for future in futures) <= n_scheduled
            return futures[-1]

        def explain(error: Exception) -> tuple[str, str]:
            return LOST[error.args[0]], "lost"

        run_missions(jobs, n_scheduled, schedule, explain, lambda row: rows.update({row.order: row}))
    assert {order: row.status for order, row in rows.items()} == dict.fromkeys(range(40), "finished") | LOST
    assert started == Counter(range(40)) + Counter({3: ATTEMPTS - 1})


def test_unexplained_error_ends_the_sweep() -> None:
    def explain(error: Exception) -> tuple[str, str]:
        raise error

    jobs = make_plan(["one_source"], ["seek"], {}, range(5)).jobs
    with ThreadPoolExecutor(1) as thread, pytest.raises(LookupError, match="3"):
        run_missions(jobs, 2, lambda job: thread.submit(run, job), explain, lambda row: None)
