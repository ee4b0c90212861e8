"""Count the files that a pulse passes through, from its emission to a finding.

`NUMBA_DISABLE_JIT=1 uv run python -m tests.pulse_path` runs a short mission with kernels as Python and prints the
product files in which functions are executed during its control steps. Code that the policy, the physics and the motion
sensors of the robot execute does not count, nor do imports.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType

from pdpatrol.envs import load_scenario
from pdpatrol.missions.runner import Mission

ROOT = Path(__file__).parents[1]
ROOMS = ("dirmusic", "sensing", "robot_models", "envs", "missions", "pdpatrol")
NOT_COUNTED = ("missions/policies/", "missions/driving/registration.py", "robot_models/", "envs/motion.py")
"""Files of the policy, and of physics, motion sensors and poses of the robot; what they call does not count."""


class FileTracer:
    """Profiler that collects the product files in which functions are called.

    Attributes:
        files: Their paths, relative to the repository.
    """

    def __init__(self) -> None:
        self.files: set[str] = set()
        self._names: dict[str, str] = {}
        self._skipped: FrameType | None = None

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """Record the file of a called function, unless the policy or the physics has called it."""
        if self._skipped is not None:
            if event == "return" and frame is self._skipped:
                self._skipped = None
        elif event == "call" and frame.f_code.co_name != "<module>":
            name = self._name(frame.f_code.co_filename)
            if name.startswith(NOT_COUNTED):
                self._skipped = frame
            elif name.split("/")[0] in ROOMS:
                self.files.add(name)

    def _name(self, file: str) -> str:
        if file not in self._names:
            path = Path(file).resolve()
            self._names[file] = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else ""
        return self._names[file]


def trace_pulses(n_findings: int = 3, longest_s: float = 60.0) -> set[str]:
    """Run a mission until the locator has reported findings, and return the files that were executed."""
    mission = Mission(load_scenario("one_source"), "seek", seed=100)
    tracer = FileTracer()
    while mission.log.n_rows("finding") < n_findings and mission.time_s < longest_s:
        sys.setprofile(tracer)
        mission.step()
        sys.setprofile(None)
    return tracer.files


if __name__ == "__main__":
    files = trace_pulses()
    sys.stdout.write("\n".join([*sorted(files), f"{len(files)} files", ""]))
