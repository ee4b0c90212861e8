"""What nature and the receiver do: sources and a pose become strengths. It alone knows the truth of radio."""

from sensing.array import ArrayConfig, HelicalArray
from sensing.discharges import PulseTrain
from sensing.propagation import Faces, Obstacles, Surroundings, level_transform
from sensing.receiver import Heard, Receiver, ReceiverConfig
from sensing.scene import Scene
from sensing.sources import Carrier, DischargeSource

__all__ = [
    "ArrayConfig",
    "Carrier",
    "DischargeSource",
    "Faces",
    "Heard",
    "HelicalArray",
    "Obstacles",
    "PulseTrain",
    "Receiver",
    "ReceiverConfig",
    "Scene",
    "Surroundings",
    "level_transform",
]
