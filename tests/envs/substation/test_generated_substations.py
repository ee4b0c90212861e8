"""Drawn substations: they load, keep the clearances they name, and have roads on which the robot drives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.base import as_tuples, tomllib
from pdpatrol.envs.scenario.loader import restore_scenario
from pdpatrol.envs.substation.drawing import ROAD_M
from pdpatrol.envs.substation.schemes import LEAST_BAYS, MOST_BAYS, SCHEMES
from pdpatrol.envs.substation.substation import Substation, SubstationParameters, draw_substation
from pdpatrol.envs.substation.substation_file import substation_text
from pdpatrol.robot_models.equipment.voltages import VOLTAGES
from pdpatrol.robot_models.yard.clearances import clearance_errors
from pdpatrol.robot_models.yard.yard import ROBOT_HEIGHT_M, Yard

EXTREMES = [
    SubstationParameters(kv, scheme, bays[scheme], seed)
    for scheme in SCHEMES
    for seed, kv in enumerate(VOLTAGES)
    for bays in (LEAST_BAYS, MOST_BAYS)
]


def random_parameters(number: int) -> SubstationParameters:
    """Draw a voltage, a scheme and a number of bays."""
    rng = np.random.default_rng([43, number])
    scheme = list(SCHEMES)[int(rng.integers(len(SCHEMES)))]
    kv = list(VOLTAGES)[int(rng.integers(3))]
    n_bays = int(rng.integers(LEAST_BAYS[scheme], MOST_BAYS[scheme] + 1))
    return SubstationParameters(kv, scheme, n_bays, int(rng.integers(2**31)))


def scenario_of(substation: Substation, n_sources: int) -> Scenario:
    return restore_scenario({"name": "site", **as_tuples(tomllib.loads(substation_text(substation, n_sources)))})


def check(parameters: SubstationParameters) -> None:
    """Check that a substation loads as drawn, keeps its clearances, and leaves its roads free."""
    substation = draw_substation(parameters)
    scenario = scenario_of(substation, 5)
    assert scenario.yard == substation.yard
    assert clearance_errors(scenario.yard, parameters.kv) == []
    assert len({source.sites for source in scenario.sources}) == 5
    for start_m, end_m in substation.roads_m:
        middle_m = np.linspace(start_m, end_m, 400)
        assert scenario.yard.clearance(middle_m).min() >= 0.5 * ROAD_M
    stops_m = np.array([substation.dock_m, *substation.waypoints_m])
    along = [
        (np.abs(stops_m - start_m) @ (np.array(end_m) == start_m) < 0.01)
        & ((stops_m >= np.subtract(start_m, 0.01)) & (stops_m <= np.add(end_m, 0.01))).all(axis=1)
        for start_m, end_m in substation.roads_m
    ]
    assert np.any(along, axis=0).all()


@pytest.mark.parametrize("parameters", EXTREMES, ids=lambda drawn: f"{drawn.kv}-{drawn.scheme}-{drawn.n_bays}")
def test_smallest_and_largest_sites_keep_their_clearances(parameters: SubstationParameters) -> None:
    check(parameters)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(200))
def test_random_sites_keep_their_clearances(number: int) -> None:
    check(random_parameters(number))


def test_same_seed_draws_the_same_site() -> None:
    first, again = (
        substation_text(draw_substation(SubstationParameters(220, "double_busbar", 8, 3)), 2) for _ in range(2)
    )
    other = substation_text(draw_substation(SubstationParameters(220, "double_busbar", 8, 4)), 2)
    assert first == again != other


@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_bay_has_its_breakers(scheme: str) -> None:
    """One breaker per bay at busbars, one per corner of a ring, three per two bays with a breaker and a half."""
    substation = draw_substation(SubstationParameters(110, scheme, 8, 5))  # pyright: ignore[reportArgumentType]
    breakers = [piece for piece in substation.yard.equipment if piece.kind == "circuit_breaker"]
    assert len(breakers) == (12 if scheme == "breaker_and_a_half" else 8)


def test_robot_passes_below_gantries_and_busbars() -> None:
    yard = draw_substation(SubstationParameters(220, "double_busbar", 8, 3)).yard
    for item in yard.equipment:
        if item.kind in ("gantry", "busbar"):
            raised = item.solids.take(item.solids.bottom_m >= ROBOT_HEIGHT_M)
            length_m = 2.0 * raised.half_size_m[-1, 0]
            below_m = raised.centre_m[-1] + np.linspace(-0.5, 0.5, 200)[:, np.newaxis] * (length_m, 0.0)
            assert (yard.clearance(below_m) > 0.5).mean() > 0.6, item.name


@settings(max_examples=30, deadline=None)
@given(move=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), number=st.integers(0, 200))
def test_piece_moved_too_near_is_reported(move: tuple[float, float], number: int) -> None:
    """A moved piece is named if and only if it is nearer to another one than the clearance allows."""
    yard = draw_substation(SubstationParameters(110, "single_busbar", 3, 1)).yard
    arresters = [k for k, item in enumerate(yard.equipment) if item.kind == "surge_arrester"]
    chosen = arresters[number % len(arresters)]
    pieces = list(yard.equipment)
    place_m = tuple(np.add(pieces[chosen].position_m, move).tolist())
    pieces[chosen] = type(pieces[chosen]).model_validate({**pieces[chosen].model_dump(), "position_m": place_m})
    moved = Yard(size_m=yard.size_m, equipment=tuple(pieces))
    ring = pieces[chosen].solids.take(np.array([False, False, True]))
    others = moved.solids.take((moved.owner != chosen) & ~_is_insulator(moved))
    around_rad = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    rim_m = ring.centre_m + ring.radius_m * np.column_stack([np.cos(around_rad), np.sin(around_rad)])
    heights_m = np.linspace(ring.bottom_m[0], ring.top_m[0], 5)
    surface_m = np.array([(x, y, z) for x, y in rim_m for z in heights_m])
    nearest_m = others.distance(surface_m).min()
    fence_m = np.minimum(rim_m, moved.size_m - rim_m).min()
    errors = [line for line in clearance_errors(moved, 110) if pieces[chosen].name in line]
    if nearest_m < 0.02:
        return  # parts that touch are one conductor
    if nearest_m < 1.1 - 0.01 or fence_m < 2.6 - 0.01:
        assert errors
    elif nearest_m > 1.1 + 0.01 and fence_m > 2.6 + 0.01:
        assert not [line for line in errors if "ring" in line]


def _is_insulator(yard: Yard) -> np.ndarray:
    built = [item.assembly for item in yard.equipment]
    return np.array([part in each.insulators for each in built for part in each.parts])


def test_number_of_bays_is_checked() -> None:
    with pytest.raises(ValueError, match="bays: must be from 3 to 12 for ring, got 2"):
        draw_substation(SubstationParameters(110, "ring", 2, 0))
