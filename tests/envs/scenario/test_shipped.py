"""The shipped scenarios: imperfect arrays, reachable routes, and sites that are visible over a wide angle."""

import numpy as np
import pytest

from pdpatrol.envs import Scenario, load_scenario, shipped_scenarios
from pdpatrol.missions.driving.site_map import CELL_M, SiteMap
from tests.sensing.radio.crossing import cross, solids_of


def map_and_paths(scenario: Scenario) -> tuple[SiteMap, np.ndarray]:
    """Return the map, and the length of the path from the dock to each cell."""
    site_map = SiteMap(scenario)
    return site_map, site_map.reach(np.asarray(scenario.route.dock_m)).length_m


@pytest.mark.parametrize("name", shipped_scenarios())
def test_site_is_in_sight_over_sixty_degrees(name: str) -> None:
    """The views are from reachable ground less than 3.5 m away."""
    scenario = load_scenario(name)
    solids, n_pieces = solids_of(scenario.yard), len(scenario.yard.equipment)
    site_map, length_m = map_and_paths(scenario)
    for site in scenario.yard.site_names():
        source = scenario.yard.site_position(site)
        away = site_map.centres_m - source[:2]
        near = np.isfinite(length_m) & (np.linalg.norm(away, axis=-1) < 3.5)
        antennas = np.column_stack([site_map.centres_m[near], np.full(near.sum(), 0.6)])
        seen = ~cross(np.tile(source, (len(antennas), 1)), antennas, solids, n_pieces).any(axis=-1)
        aspects = np.degrees(np.arctan2(away[near][seen][:, 1], away[near][seen][:, 0]))
        assert np.unique(aspects // 10).size >= 7, f"{site}: seen over {np.unique(aspects // 10).size * 10} degrees"


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_stop_can_be_reached(name: str) -> None:
    scenario = load_scenario(name)
    site_map, length_m = map_and_paths(scenario)
    stops = np.array([scenario.route.dock_m, *scenario.route.waypoints_m])
    cells = [site_map.cell(stop) for stop in stops]
    assert np.isfinite(length_m[cells]).all()
    assert (np.linalg.norm(site_map.centres_m[cells] - stops, axis=-1) < CELL_M).all()


def test_paper_field_scenario_is_table_3_of_the_paper() -> None:
    # Dir-MUSIC, Table 3: range and angle from the array, 20 shots at each position
    scenario = load_scenario("paper_field")
    table = [(7.5, a) for a in (-96, -66, -19, -10, 10, 17, 28, 93)] + [(14.0, -90.0), (18.9, 17.5)]
    assert [element.azimuth_deg for element in scenario.array.elements] == [90.0, 30.0, -30.0, -90.0]
    assert [source.n_shots for source in scenario.sources] == [20] * 10
    x, y = (np.array([s.position_m for s in scenario.sources])[:, :2] - scenario.route.dock_m).T
    np.testing.assert_allclose(np.hypot(x, y), [r for r, _ in table], atol=1e-3)
    np.testing.assert_allclose(np.degrees(np.arctan2(y, x)), [a for _, a in table], atol=0.01)
    assert {s.position_m[2] for s in scenario.sources if s.position_m} == {scenario.array.height_m}
