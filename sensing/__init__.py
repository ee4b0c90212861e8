"""What nature and the receiver do: sources and a pose become strengths. It alone knows the truth of radio."""

from pdpatrol.sensing.array.config import ArrayConfig, ElementConfig
from pdpatrol.sensing.array.helical_array import HelicalArray
from pdpatrol.sensing.nature.discharges import PulseTrain
from pdpatrol.sensing.nature.scene import Scene
from pdpatrol.sensing.nature.sources import Carrier, DischargeSource
from pdpatrol.sensing.radio.surroundings import Surroundings, level_transform
from pdpatrol.sensing.radio.tables import Faces, Obstacles, Solids
from pdpatrol.sensing.receiver.config import ReceiverConfig
from pdpatrol.sensing.receiver.detections import Detections

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
