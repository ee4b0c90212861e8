"""A mission with strong multipath."""

import numpy as np
import pytest

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
