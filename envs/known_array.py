"""What a robot knows of the array that its scenario gives it."""

from __future__ import annotations

from dirmusic import ArrayModel
from pdpatrol.envs.scenario.array_section import data_sheet
from pdpatrol.envs.scenario.scenario import Scenario


def known_array(scenario: Scenario) -> ArrayModel:
    """The array's data sheet and how far real arrays spread about it, or what a calibration has left of that."""
    array = data_sheet(scenario.array, scenario.receiver.band_edges_hz)
    calibration = scenario.locating.calibration
    return array if calibration is None else calibration.taken_up_by(array)
