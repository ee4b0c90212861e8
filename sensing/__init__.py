"""What nature and the receiver do: sources and a pose become strengths. It alone knows the truth of radio."""

from sensing.array import ArrayConfig, HelicalArray
from sensing.discharges import PulseTrain
from sensing.receiver import Heard, LineOfSight, Receiver, ReceiverConfig
from sensing.sources import DischargeSource

__all__ = [
    "ArrayConfig",
    "DischargeSource",
    "Heard",
    "HelicalArray",
    "LineOfSight",
    "PulseTrain",
    "Receiver",
    "ReceiverConfig",
]
