"""What nature and the receiver do: sources and a pose become strengths. It alone knows the truth of radio."""

from sensing.array.config import ArrayConfig, ElementConfig
from sensing.array.helical_array import HelicalArray
from sensing.nature.discharges import PulseTrain
from sensing.nature.scene import Scene
from sensing.nature.sources import Carrier, DischargeSource
from sensing.radio.surroundings import Surroundings, level_transform
from sensing.radio.tables import Faces, Obstacles, Solids
from sensing.receiver.config import ReceiverConfig
from sensing.receiver.detections import Detections

__all__ = [
    "ArrayConfig",
    "Carrier",
    "Detections",
    "DischargeSource",
    "ElementConfig",
    "Faces",
    "HelicalArray",
    "Obstacles",
    "PulseTrain",
    "ReceiverConfig",
    "Scene",
    "Solids",
    "Surroundings",
    "level_transform",
]
