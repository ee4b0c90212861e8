"""Layout of the viewer."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from pdpatrol.missions.recording.findings import SPAN_DB, UNITS_PER_DB
from pdpatrol.missions.recording.palette import PALETTE

SO_FAR = rrb.VisibleTimeRanges(
    timeline="sim_time",
    start=rrb.TimeRangeBoundary.infinite(),
    end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
)
"""Show all data from the start up to the time cursor."""

WHOLE = rrb.TimeAxis(
    view_range=rrb.TimeRange(start=rrb.TimeRangeBoundary.absolute(seconds=0.0), end=rrb.TimeRangeBoundary.infinite())
)
"""Time axis over the full mission."""


def blueprint(meta: Mapping[str, Any], *, is_live: bool, lists_recordings: bool = False) -> rrb.Blueprint:
    """Return the layout: robot and plan, below them phases of the mission, plots and pattern; texts on the right.

    Args:
        meta: Metadata of the log.
        is_live: Whether the time cursor follows the mission instead of playing it from the start.
        lists_recordings: Whether the panel that lists all recordings is open.
    """
    low, high = np.array(meta["bounds_m"])
    centre, above_m = np.array([*(0.5 * (low + high)), 0.0]), 0.88 * float(np.max((high - low) * [1.0, 1.25]))
    behind = rrb.EyeControls3D(tracking_entity="world/camera")
    plan = rrb.EyeControls3D(position=centre + np.array([0.0, -0.01, above_m]), look_target=centre, eye_up=[0, 1, 0])
    truth, on_plan = "world/truth", ("world/robot/marker", "world/yard/names", "world/route/numbers")
    texts = rrb.Vertical(
        rrb.TextDocumentView(origin="mission/status", name="Story"),
        rrb.TextDocumentView(origin="mission/events", name="Events so far, the latest first"),
        rrb.TextDocumentView(origin="mission/legend", name="Colours"),
        row_shares=[11, 7, 5],
    )
    reach = UNITS_PER_DB * SPAN_DB
    pattern = rrb.Spatial2DView(
        origin="phase_pattern",
        name="Phase pattern [dBV at 1 m]",
        background=rrb.Background(color=PALETTE.paper),
        visual_bounds=rrb.VisualBounds2D(x_range=[-82.0, 380.0], y_range=[-reach - 86.0, reach + 58.0]),
        time_ranges=SO_FAR,
    )
    views = rrb.Vertical(
        rrb.Horizontal(
            _world_view("Robot", behind, truth, *on_plan),
            rrb.Tabs(
                _world_view("Plan", plan, truth, "world/camera"),
                _world_view("Plan and truth", plan, "world/camera"),
            ),
            column_shares=[4, 5],
        ),
        rrb.StateTimelineView(origin="mission/phase", name="Mission", time_view=WHOLE),
        rrb.Horizontal(
            _plot("directions", "Bearings and heading [°]", (-195.0, 195.0)),
            rrb.Tabs(
                _plot("uncertainty", "Half-axis of 95 % ellipses [m]", (-0.12, 3.0)),
                _plot("strengths", "Strengths of the elements [dBV]"),
            ),
            pattern,
        ),
        row_shares=[11, 2.5, 7],
    )
    return rrb.Blueprint(
        rrb.Horizontal(views, texts, column_shares=[10, 3.4]),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time",
            playback_speed=4.0,
            play_state="following" if is_live else "playing",
        ),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="expanded" if lists_recordings else "collapsed"),
    )


def _world_view(name: str, eye: rrb.EyeControls3D, *hidden: str) -> rrb.Spatial3DView:
    """Return a view of the world in which trajectories are shown from the start."""
    overrides: dict[Any, Any] = dict.fromkeys(hidden, rrb.EntityBehavior(visible=False))
    overrides |= dict.fromkeys(("world/trajectory", "world/truth/trajectory", "world/odometry"), SO_FAR)
    return rrb.Spatial3DView(
        origin="world",
        name=name,
        eye_controls=eye,
        background=rrb.Background(color=PALETTE.sky),
        line_grid=False,
        overrides=overrides,
    )


def _plot(plot: str, name: str, limits: tuple[float, float] | None = None) -> rrb.TimeSeriesView:
    """Return a plot over the full mission."""
    return rrb.TimeSeriesView(
        origin=f"plots/{plot}",
        name=name,
        axis_x=WHOLE,
        axis_y=limits and rrb.ScalarAxis(range=limits),
        plot_legend=rrb.Corner2D.RightTop,
    )
