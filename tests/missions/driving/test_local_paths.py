"""Shortest paths between places of a map."""

import numpy as np
import pytest

from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.driving.local_paths import LocalPaths
from pdpatrol.missions.driving.site_map import SiteMap, distances_along
from tests.missions.planning.one_plan import walled_in


@pytest.mark.parametrize("seed", [1, 2])
def test_paths_between_cells_are_the_shortest(seed: int) -> None:
    """Paths found cell by cell cost as much as those found by a search of the whole map."""
    site_map, rng = SiteMap(random_yard(seed, 12)), np.random.default_rng(seed)
    paths, reachable = LocalPaths(site_map), np.flatnonzero(np.isfinite(site_map.reach(site_map.route.dock_m).length_m))
    for first in rng.choice(reachable, 5).tolist():
        whole = site_map.reach(site_map.centres_m[first])
        for last in rng.choice(reachable, 20).tolist():
            assert paths.cost_m(first, last) == pytest.approx(whole.length_m[last], rel=2e-6)
            cells = paths.path(first, last)
            assert (cells[0], cells[-1]) == (first, last)
            assert paths.length_m(first, last) == pytest.approx(distances_along(site_map.centres_m[cells])[-1])
            assert paths.length_m(first, last) <= paths.cost_m(first, last) + 1e-9


def test_there_is_no_path_into_walls() -> None:
    site_map = SiteMap(walled_in())
    inside, dock = site_map.cell((35.0, 3.2)), site_map.cell(site_map.route.dock_m)
    assert not np.isfinite(site_map.reach(site_map.route.dock_m).length_m[inside])
    paths = LocalPaths(site_map)
    assert paths.cost_m(dock, inside) == np.inf
    with pytest.raises(ValueError, match="not connected"):
        paths.path(dock, inside)
