"""What a recording is drawn on, and the slices of a log that are drawn one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pdpatrol.envs.patrol_env import STEP_S
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording import paths

Table = dict[str, NDArray[Any]]

BIN_S = 0.5
BIN_STEPS = round(BIN_S / STEP_S)
"""Steps of a mission that are drawn as one where every step would be too many."""

MOST_BINS = 2000
"""Data from the field have as many bins at most, of as many steps as that takes."""

MOST_BINS_AT_ONCE = 100
"""Of a slice, to bound the memory that drawing takes."""


class Canvas:
    """A stream of Rerun's, in the time of a log.

    Args:
        stream: Where to.
        log: Whose steps rows belong to.
    """

    def __init__(self, stream: rr.RecordingStream, log: MissionLog) -> None:
        self._stream = stream
        self._log = log
        self._time_s = np.empty(0)

    def still(self, path: str, archetype: Any) -> None:  # noqa: ANN401 - any archetype
        """Draw what does not change."""
        self._stream.log(path, archetype, static=True)

    def columns(self, path: str, steps: NDArray[Any], columns: Any) -> None:  # noqa: ANN401 - rerun's column lists
        """Draw a row for each of some steps."""
        if not len(steps):
            return
        if self._time_s.size < self._log.n_rows("step"):
            self._time_s = np.append(self._time_s, self._log.column("step", "time_s", self._time_s.size))
        last = self._time_s.size - 1
        at = self._time_s[np.minimum(steps, last)] if last >= 0 else np.zeros(len(steps))
        times = [rr.TimeColumn(paths.SIM_TIME, duration=at), rr.TimeColumn(paths.STEP, sequence=np.asarray(steps))]
        rr.send_columns(path, indexes=times, columns=columns, recording=self._stream)


@dataclass(frozen=True, kw_only=True)
class Slice:
    """The rows of a log that belong to some of its steps, whole bins of them.

    Attributes:
        first_step: Number of the first step.
        bin_steps: Steps of a bin; the last bin of a log may have fewer.
        step: The steps.
        pulse: Their pulses.
        first_pulse: Number of the first pulse.
        bearing: Bearings of the credible pulses.
        finding: Findings.
        likelihood: Likelihoods over the yard.
        event: Events.
    """

    first_step: int
    bin_steps: int
    step: Table
    pulse: Table
    first_pulse: int
    bearing: Table
    finding: Table
    likelihood: Table
    event: Table

    @property
    def steps(self) -> NDArray[np.intp]:
        """Numbers of the steps, shape (n_steps,)."""
        return np.arange(self.first_step, self.first_step + self.step["time_s"].size)

    @property
    def bin_ends(self) -> NDArray[np.intp]:
        """Number of the last step of each bin, shape (n_bins,)."""
        steps = self.steps
        ends = steps[(steps + 1) % self.bin_steps == 0]
        return ends if not steps.size or (ends.size and ends[-1] == steps[-1]) else np.append(ends, steps[-1])

    def bin_end(self, steps: NDArray[np.intp]) -> NDArray[np.intp]:
        """The last step of the bin of each of some steps, which are in the slice, shape of `steps`."""
        ends = self.bin_ends
        return ends[np.searchsorted(ends, steps)]

    def at(self, column: str, steps: NDArray[np.intp]) -> NDArray[Any]:
        """A column of the table of steps at some steps, which are in the slice."""
        return self.step[column][steps - self.first_step]


class Slices:
    """Cuts a log that may grow into slices.

    Args:
        log: The log; without a scenario it is of data from the field, and whole.
    """

    def __init__(self, log: MissionLog) -> None:
        self._log = log
        self.bin_steps = bin_steps(log)
        self._start = dict.fromkeys(("step", "pulse", "bearing", "finding", "likelihood", "event"), 0)

    def take(self, *, is_whole: bool) -> Slice | None:
        """The next slice; None where no bin is complete.

        Where nothing but events or findings was added to the last step, it has no steps.

        Args:
            is_whole: Nothing will be added to the log: its last bin may be a shorter one.
        """
        first, n_steps = self._start["step"], self._log.n_rows("step")
        whole = n_steps if is_whole else n_steps - n_steps % self.bin_steps
        end = min(whole, first + MOST_BINS_AT_ONCE * self.bin_steps)
        last = max(end, 1) if is_whole else end  # a log without steps may have events
        stop = {name: self._log.rows_before(name, last) for name in self._start}
        if stop == self._start:
            return None
        tables = {name: self._log.table(name, start, stop[name]) for name, start in self._start.items()}
        first_pulse, self._start = self._start["pulse"], stop
        return Slice(first_step=first, bin_steps=self.bin_steps, first_pulse=first_pulse, **tables)


def bin_steps(log: MissionLog) -> int:
    """How many steps of a log are drawn as one where every step would be too many."""
    return BIN_STEPS if "scenario" in log.meta else max(-(-log.n_rows("step") // MOST_BINS), 1)
