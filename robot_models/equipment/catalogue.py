"""Every kind of equipment that a yard can place by its name."""

from __future__ import annotations

from robot_models.equipment.assembly import Kind
from robot_models.equipment.busbar import busbar
from robot_models.equipment.circuit_breaker import circuit_breaker
from robot_models.equipment.civil import control_building, fence, kerb
from robot_models.equipment.gis_bay import gis_bay
from robot_models.equipment.instrument_transformers import current_transformer, voltage_transformer
from robot_models.equipment.power_transformer import power_transformer

CATALOGUE: dict[str, Kind] = {
    "busbar": Kind(busbar, 12.0, stretches=True),
    "circuit_breaker": Kind(circuit_breaker, 3.6),
    "control_building": Kind(control_building, 6.0, stretches=True),
    "current_transformer": Kind(current_transformer, 0.5),
    "fence": Kind(fence, 6.0, stretches=True),
    "gis_bay": Kind(gis_bay, 6.0, stretches=True),
    "kerb": Kind(kerb, 6.0, stretches=True),
    "power_transformer": Kind(power_transformer, 5.0),
    "voltage_transformer": Kind(voltage_transformer, 0.5),
}
"""By name; `sensing/materials.py` knows what each is made of."""
