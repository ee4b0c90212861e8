"""Kinds of events of a mission, and what its policy was doing."""

from typing import Literal, NamedTuple

ChargingStage = Literal["returns to charge", "charging", "continues"]
"""Stages of a charge. The policy drives in the last one, and from the start on."""

EventKind = (
    Literal[
        "waypoint",
        "unreachable",
        "contact",
        "clipped",
        "channel fault",
        "calibration",
        "array",
        "frame",
        "candidate",
        "confirmed",
        "outside",
        "dropped",
        "possibly two",
        "note",
        "rejected",
        "error",
        "end",
    ]
    | ChargingStage
)
"""Kinds of events. Those from `candidate` to `dropped` are new states of a finding; the next one is about a finding,
too."""


class Phase(NamedTuple):
    """Current activity of a policy.

    Attributes:
        name: One or two words; built-in policies use `patrol`, `seek`, `return to dock`, `listen`, `back off`,
            `give way` and `random`; while the battery is charged, it is `return to charge` and `charge`.
        target: Number of the waypoint, from 1, that it drives to, or id of the candidate that it views; 0 if neither.
    """

    name: str
    target: int = 0

    def __str__(self) -> str:
        """Return name and target, such as `patrol 2`."""
        return f"{self.name} {self.target}" if self.target else self.name
