"""Positions from bearings, compared with Stone Soup's filters: `uv run --group peers pytest -m benchmark -n 0 -s`."""

import numpy as np
import pytest

from dirmusic.array.element_errors import ElementErrors
from dirmusic.locating.bearing_fit import triangulate
from dirmusic.locating.pulse_record import PulseRecord, PulsesAtPose
from dirmusic.locating.rules import LocatingRules
from pdpatrol.envs.simulation import STEP_S
from tests.benchmarks.free_field.cases import FENCE_M, Case, draw_case
from tests.benchmarks.free_field.figures import credible, fixes, locate
from tests.benchmarks.free_field.peer_filters import SightLines, crossing, peer_fixes

BEARINGS = LocatingRules(solver="bearings")
N_CASES = 40


def sight_lines(case: Case) -> SightLines:
    """Return the credible bearings of a case, with the deviations of the Locator."""
    rows = np.flatnonzero(credible(case, BEARINGS))
    record = PulseRecord(case.array, case.pose_error, None, BEARINGS.assignment)
    for step in np.unique(case.step[rows]):
        pulses = case.pulses.take(rows[case.step[rows] == step])
        record.extend([PulsesAtPose(STEP_S * float(step), case.pose[step], pulses)])
    no_errors = record.error_table(ElementErrors.none(case.array.manifold.n_elements))
    bearing_rad, std_rad = record.bearings(np.arange(rows.size), no_errors)
    return SightLines(record.pulses.time_s, record.pose[:, :2], bearing_rad, std_rad)


def miss_m(case: Case, place_m: np.ndarray) -> float:
    return float(np.linalg.norm(place_m - case.sources_m[0, :2]))


def test_first_line_of_sight_crosses_at_the_source() -> None:
    source_m, from_m = np.array([7.0, 5.0]), np.array([[0.0, 0.0], [3.0, 0.0], [9.0, 1.0]])
    sight_m = source_m - from_m
    lines = SightLines(np.arange(3.0), from_m, np.arctan2(sight_m[:, 1], sight_m[:, 0]), np.full(3, 0.1))
    np.testing.assert_allclose(crossing(lines), source_m)


@pytest.mark.benchmark
def test_positions_are_no_worse_than_the_best_peer_filter() -> None:
    theirs: dict[str, list[float]] = {}
    ours: dict[str, list[float]] = {"Locator, joint fix": [], "Locator, bearings alone": [], "triangulate": []}
    for seed in range(N_CASES):
        case = draw_case(seed)
        lines = sight_lines(case)
        for name, place_m in peer_fixes(lines, FENCE_M).items():
            theirs.setdefault(name, []).append(miss_m(case, place_m))
        for name, rules in (("Locator, joint fix", LocatingRules()), ("Locator, bearings alone", BEARINGS)):
            ours[name].append(float(fixes([(case, locate(case, rules))]).miss_m[0]))
        crossed = triangulate(lines.from_m, lines.bearing_rad, lines.std_rad)
        ours["triangulate"].append(miss_m(case, crossed.position_m))
    medians = {name: float(np.median(of_cases)) for name, of_cases in (ours | theirs).items()}
    best = min(theirs, key=lambda name: medians[name])
    print(f"\n{N_CASES} cases, the same bearings; median error, and over that of Stone Soup's best, {best}")
    for name, median_m in medians.items():
        print(f"{name:28} {median_m:.3f} m  {median_m / medians[best]:.2f}")
    assert medians["Locator, joint fix"] <= medians[best]
    assert medians["Locator, bearings alone"] <= 1.1 * medians[best]  # equal within the statistics of so few cases
