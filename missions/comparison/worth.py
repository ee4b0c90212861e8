"""All variants over the same seeds, in processes side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

from envs import Scenario
from missions.comparison.scores import MissionScore, Score, score_mission, summarise
from missions.comparison.variants import Variant
from missions.runner import run_mission


class Job(NamedTuple):
    """One mission."""

    scenario: Scenario
    seed: int


def compare(
    scenario: Scenario,
    variants: Sequence[Variant],
    seeds: Sequence[int],
    n_workers: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Mapping[str, Score]:
    """Score each variant over the same seeds; the result does not depend on the number of workers.

    Args:
        scenario: What the variants vary; with one source, the error of bearings is known.
        variants: To compare; those that come to the same scenario share their missions.
        seeds: Of the missions.
        n_workers: Processes.
        progress: Told how many missions are done, and how many there are.

    Returns:
        Scores by `Variant.key`.
    """
    varied = {variant.key: variant.of(scenario) for variant in variants}
    distinct = {each.model_dump_json(): each for each in varied.values()}
    jobs = [Job(each, seed) for each in distinct.values() for seed in seeds]
    missions: list[MissionScore] = []
    with ProcessPoolExecutor(n_workers) as pool:
        for score in pool.map(run_job, jobs):
            missions.append(score)
            progress(len(missions), len(jobs))
    n = len(seeds)
    scores = {text: summarise(missions[k * n : (k + 1) * n]) for k, text in enumerate(distinct)}
    return {key: scores[each.model_dump_json()] for key, each in varied.items()}


def run_job(job: Job) -> MissionScore:
    """Run one mission of the policy `seek` and score it."""
    return score_mission(run_mission(job.scenario, "seek", job.seed), job.scenario)
