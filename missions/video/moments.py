"""What of a log is shown at one moment of a film."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpatrol.missions.record.events import Phase
from pdpatrol.missions.record.mission_log import MissionLog

FloatArray = NDArray[np.float64]

STAYS_S, MOST_RAYS = 1.5, 10
"""How long a pulse is drawn, simulated, and how many at once at most."""

FOLLOW_S = 1.2
"""Time constant of the camera behind the robot, in the clip."""


class Rays(NamedTuple):
    """Bearings of the last pulses: from where (n, 3), towards (n,), how fresh from 0 to 1 (n,)."""

    start_m: FloatArray
    bearing_rad: FloatArray
    freshness: FloatArray


class Shown(NamedTuple):
    """A candidate or finding as it stood."""

    id: int
    state: str
    position_m: FloatArray
    covariance_m2: FloatArray


class Moment(NamedTuple):
    """One moment: poses x m, y m, yaw rad; the way so far (n, 2) as the robot believes it."""

    time_s: float
    pose: FloatArray
    true_pose: FloatArray
    way_m: FloatArray
    phase: Phase
    rays: Rays
    findings: list[Shown]
    log_likelihood: FloatArray | None
    news: str


class Moments:
    """A log, to be looked at in the order of time.

    Args:
        log: Of a mission with at least one step.
        array_height_m: Of the array over the ground.
        stays_s: How long a pulse is drawn, simulated.
    """

    def __init__(self, log: MissionLog, array_height_m: float, stays_s: float) -> None:
        self._step, self._finding, self._event = (log.table(name) for name in ("step", "finding", "event"))
        self._likelihood = log.table("likelihood")
        pulse = log.column("bearing", "pulse")
        self._bearing_step = log.column("pulse", "step")[pulse]
        self._bearing_rad = log.column("bearing", "bearing_rad")
        self._height_m, self._stays_s = array_height_m, stays_s

    def at(self, step: int) -> Moment:
        """The mission after a control step."""
        time_s, pose = self._step["time_s"], self._step["pose"]
        now = float(time_s[step])
        oldest, high = np.searchsorted(time_s, now - self._stays_s), np.searchsorted(self._bearing_step, step + 1)
        low = max(np.searchsorted(self._bearing_step, oldest), high - MOST_RAYS)
        at = self._bearing_step[low:high]
        start = np.column_stack([pose[at, :2], np.full(at.size, self._height_m)])
        rays = Rays(start, self._bearing_rad[low:high], 1.0 - (now - time_s[at]) / self._stays_s)
        drawn = np.searchsorted(self._likelihood["step"], step, side="right")
        told = np.searchsorted(self._event["step"], step, side="right")
        return Moment(
            time_s=now,
            pose=pose[step],
            true_pose=self._step["true_pose"][step],
            way_m=pose[: step + 1 : 3, :2],
            phase=Phase(str(self._step["phase"][step]), int(self._step["phase_target"][step])),
            rays=rays,
            findings=self._findings(step),
            log_likelihood=self._likelihood["log_likelihood"][drawn - 1] if drawn else None,
            news=str(self._event["text"][told - 1]) if told else "",
        )

    def _findings(self, step: int) -> list[Shown]:
        latest: dict[int, int] = {}
        for row in range(int(np.searchsorted(self._finding["step"], step, side="right"))):
            latest[int(self._finding["id"][row])] = row
        table: dict[str, NDArray[Any]] = self._finding
        return [
            Shown(number, str(table["state"][row]), table["position_m"][row], table["covariance_m2"][row])
            for number, row in latest.items()
            if table["state"][row] not in ("dropped", "ghost")
        ]


def smooth_yaw(yaw_rad: FloatArray, frame_s: float) -> FloatArray:
    """Where the camera behind the robot looks at each frame (n,): as the robot does, without its quick turns."""
    unwrapped = np.unwrap(yaw_rad)
    share, smooth = 1.0 - np.exp(-frame_s / FOLLOW_S), np.empty_like(unwrapped)
    smooth[0] = unwrapped[0]
    for k in range(1, unwrapped.size):
        smooth[k] = smooth[k - 1] + share * (unwrapped[k] - smooth[k - 1])
    return smooth
