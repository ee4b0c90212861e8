"""Missions with strong multipath."""

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission
from tests.envs.helpers import to_be_planned

SEED, N_PIECES = 110012, 6
"""A yard in which bearings of reflections cross within 0.1 m of one place, 18 m from the source."""


@pytest.mark.whole
def test_crossing_reflections_are_not_confirmed_repeatedly() -> None:
    log = run_mission(to_be_planned(random_yard(SEED, N_PIECES)), "active", seed=SEED)
    evaluation = make_report(log, 0.0).scores
    assert evaluation.false_findings == 0
    assert evaluation.sources[0].found
    finding = log.table("finding")
    for number in np.unique(finding["id"]):
        is_confirmed = finding["state"][finding["id"] == number] == "confirmed"
        assert (is_confirmed[:-1] & ~is_confirmed[1:]).sum() <= 1, number


@pytest.mark.whole
@pytest.mark.parametrize("seed", [98, 99, 113])
def test_waves_bent_around_an_edge_are_not_a_second_source(seed: int) -> None:
    """The source is on a face of a transformer, 1.2 or 1.5 m from its edge, and the robot drives round it."""
    report = make_report(run_mission(load_scenario("one_source"), "seek", seed=seed), 0.0)
    assert report.scores.sources[0].found
    assert not any(finding.possibly_two for finding in report.findings)


@pytest.mark.whole
@pytest.mark.parametrize("seed", [0, 1])
def test_source_beside_another_is_noticed_from_where_that_is_hidden(seed: int) -> None:
    """Two sources 1.1 m apart on both sides of a circuit breaker: nobody sees both from one place."""
    report = make_report(run_mission(load_scenario("suite/close_09"), "seek", seed=seed), 0.0)
    n_found = sum(source.found for source in report.scores.sources)
    assert n_found == 2 or any(finding.possibly_two for finding in report.findings)
