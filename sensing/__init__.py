"""Simulation of sources, radio waves and receivers: from the true state of the world to detected pulses."""

from pdpatrol.sensing.array.helical_array import ArrayConfig, ElementConfig, HelicalArray, TrueArrayConfig
from pdpatrol.sensing.nature.pulses import PulseTrain
from pdpatrol.sensing.nature.sources import Carrier, DischargeSource, Scene
from pdpatrol.sensing.radio.surroundings import Surroundings, level_transform, upright_solids
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detection import DetectedPulses
from pdpatrol.sensing.receiver.faults import TrueReceiverConfig

__all__ = [
    "ArrayConfig",
    "Carrier",
    "DetectedPulses",
    "DischargeSource",
    "ElementConfig",
    "HelicalArray",
    "PulseTrain",
    "ReceiverConfig",
    "Scene",
    "Surroundings",
    "TrueArrayConfig",
    "TrueReceiverConfig",
    "level_transform",
    "upright_solids",
]
