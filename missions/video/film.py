"""Log to pictures: the robot is put where the log says it was, frame by frame."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.missions.planning import with_planned_route
from pdpatrol.missions.record.array_description import described_grid
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.recording.drawing.status import phase_words
from pdpatrol.missions.recording.identity import recording_name
from pdpatrol.missions.video.frame import CAMERA, PLAN, RAY, STATE_COLOURS, Frame
from pdpatrol.missions.video.moments import Moment, Moments, smooth_yaw
from pdpatrol.robot_models.antenna.elements import AntennaElements
from pdpatrol.robot_models.posed_yard import ABOVE_RAD, Ball, Line, PosedYard
from pdpatrol.robot_models.world import build_spec

FloatArray = NDArray[np.float64]

MARGIN_M = 1.0
"""Of the plan beyond the fence."""

NEAREST_RAY_M, RAY_M = 0.3, 40.0
"""Where rays begin and end in the picture of the camera, from the array."""


class Film:
    """The frames of a film, on a figure of matplotlib.

    Args:
        log: Of a simulated mission with at least one step.
        steps: Control step that each frame shows, shape (n_frames,).
        frame_s: How long a frame is shown.
        stays_s: How long a pulse is drawn, simulated.

    Raises:
        RuntimeError: If there is no OpenGL to draw with.
    """

    def __init__(self, log: MissionLog, steps: NDArray[np.intp], frame_s: float, stays_s: float) -> None:
        scenario = with_planned_route(restore_scenario(log.meta["scenario"]))
        nominal = scenario.array.nominal_elements()
        elements = AntennaElements.checked(
            nominal.positions_m, nominal.boresights_rad, nominal.boresight_elevations_rad
        )
        self._steps = steps
        self._moments = Moments(log, float(np.mean(np.asarray(nominal.positions_m)[:, 2])), stays_s)
        self._yard = PosedYard(build_spec(scenario.robot.description, scenario.yard, elements), *CAMERA)
        self._look_rad = smooth_yaw(log.column("step", "true_pose")[steps, 2], frame_s)
        self._ending = recording_name(log).rpartition(": ")[2]
        size = np.array(scenario.yard.size_m)
        half = 0.5 * size + MARGIN_M
        half[1] *= -np.sin(ABOVE_RAD)
        stops = np.array([scenario.route.dock_m, *scenario.route.stops_m])
        grid = described_grid(log.meta["grid"]) if "grid" in log.meta else None
        plan = self._yard.from_above(0.5 * size, half, PLAN)
        self._frame = Frame(recording_name(log).rpartition(": ")[0], plan, 0.5 * size, half, stops, grid)

    @property
    def figure(self) -> Figure:
        """On which the frames are drawn."""
        return self._frame.figure

    def draw(self, frame: int) -> None:
        """Draw one frame."""
        moment = self._moments.at(int(self._steps[frame]))
        self._yard.put(moment.true_pose)
        picture = self._yard.from_behind(float(self._look_rad[frame]), _lines(moment), _balls(moment))
        is_last = frame == self._steps.size - 1
        doing = f"{self._ending}" if is_last else phase_words(moment.phase)
        self._frame.draw(moment, picture, doing, moment.news)

    def close(self) -> None:
        """Give figure and renderer back."""
        plt.close(self.figure)
        self._yard.close()


def _lines(moment: Moment) -> list[Line]:
    """Bearings in the picture of the camera, from where the robot was when it heard them."""
    start, towards, freshness = moment.rays
    ahead = np.column_stack([np.cos(towards), np.sin(towards), np.zeros(towards.size)])
    return [
        Line(a + NEAREST_RAY_M * d, a + RAY_M * d, (*to_rgb(RAY), 0.1 + 0.6 * float(f)), 0.008)
        for a, d, f in zip(start, ahead, freshness, strict=True)
    ]


def _balls(moment: Moment) -> list[Ball]:
    return [Ball(finding.position_m, 0.22, (*to_rgb(STATE_COLOURS[finding.state]), 0.9)) for finding in moment.findings]
