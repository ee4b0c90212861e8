"""Layout of the viewer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pdpatrol.missions.recording.phase_pattern import SPAN_DB, UNITS_PER_DB
from pdpatrol.missions.recording.spectra import HEIGHT, WIDTH

BACKGROUND = (24, 28, 34)


def blueprint(meta: Mapping[str, Any], bin_s: float, *, is_live: bool, lists_recordings: bool = False) -> rrb.Blueprint:
    """Return the layout: robot, plan and status text above; phases, spectra, plots and phase-resolved pattern below.

    Args:
        meta: Metadata of the log.
        bin_s: Duration of a bin of the recording.
        is_live: Whether the time cursor follows the mission instead of playing it from the start.
        lists_recordings: Whether the panel that lists all recordings is open.
    """
    whole = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=0.0), end=rrb.TimeRangeBoundary.infinite()
        )
    )
    status = rrb.Vertical(
        rrb.TextDocumentView(origin="mission/status", name="Status"),
        rrb.TextLogView(
            origin="mission/events",
            name="Events",
            columns=rrb.TextLogColumns(timeline_columns=["sim_time"], text_log_columns=["body"]),
        ),
        row_shares=[3, 2],
    )
    views = _world_views(meta, bin_s)
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(rrb.Tabs(*views[:2]), rrb.Tabs(*views[2:]), status, column_shares=[5, 5, 4]),
            rrb.StateTimelineView(origin="mission/phase", name="Mission", time_view=whole),
            rrb.Horizontal(_spectra(), _plots(whole), _phase_pattern(), column_shares=[5, 5, 4]),
            row_shares=[10, 2.5, 7],
        ),
        rrb.TimePanel(
            state="collapsed",
            timeline="sim_time",
            playback_speed=4.0,
            play_state="following" if is_live else "playing",
        ),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="expanded" if lists_recordings else "collapsed"),
    )


def _world_views(meta: Mapping[str, Any], bin_s: float) -> list[rrb.Spatial3DView]:
    """Return views of the robot from behind, the yard from the side, and plans without and with the truth."""
    low, high = (np.array(corner) for corner in meta.get("bounds_m", ((0.0, 0.0), (40.0, 30.0))))
    centre, diagonal_m = np.array([*(0.5 * (low + high)), 0.0]), float(np.hypot(*(high - low)))
    above_m = 0.88 * float(np.max((high - low) * [1.0, 1.25]))
    behind = rrb.EyeControls3D(
        position=[-3.6, -2.6, 4.6], look_target=[0, 0, 0.5], eye_up=[0, 0, 1], tracking_entity="world/robot"
    )
    side = rrb.EyeControls3D(
        position=centre + diagonal_m * np.array([-0.1, -0.7, 0.5]), look_target=centre, eye_up=[0, 0, 1]
    )
    plan = rrb.EyeControls3D(position=centre + np.array([0.0, -0.01, above_m]), look_target=centre, eye_up=[0, 1, 0])
    truth, labels = "world/truth", ("world/robot/marker", "world/yard/names")
    return [
        _world_view("Robot", behind, bin_s, hidden=(truth, *labels), see_through=True),  # it may be behind equipment
        _world_view("Yard", side, bin_s, hidden=(truth,)),
        _world_view("Plan", plan, bin_s, hidden=(truth,), see_through=True),
        _world_view("Plan and truth", plan, bin_s, see_through=True),
    ]


def _world_view(
    name: str, eye: rrb.EyeControls3D, bin_s: float, *, hidden: tuple[str, ...] = (), see_through: bool = False
) -> rrb.Spatial3DView:
    """Return a view of the world in which trajectories are shown from the start and pulses for a few bins."""
    overrides: dict[Any, Any] = {path: rrb.EntityBehavior(visible=False) for path in hidden}
    overrides |= {path: _last(None) for path in ("world/trajectory", "world/truth/trajectory", "world/odometry")}
    shown_bins = {
        "world/spectrum": 0.9,
        "world/bearings/new": 0.9,
        "world/bearings/past": 8,
        "world/bearings/rejected": 3,
    }
    overrides |= {path: _last(bins * bin_s) for path, bins in shown_bins.items()}
    if see_through:
        for shape, archetype in (("box", rr.Boxes3D), ("cylinder", rr.Cylinders3D)):
            glass = archetype.from_fields(fill_mode="transparentfillmajorwireframe")
            overrides[f"world/yard/equipment/{shape}"] = glass.visualizer()
    return rrb.Spatial3DView(
        origin="world",
        name=name,
        eye_controls=eye,
        background=BACKGROUND,
        line_grid=False,
        spatial_information=None,
        overrides=overrides,
    )


def _last(seconds: float | None) -> rrb.VisibleTimeRanges:
    """Show the data of the last seconds; all data since the start with None."""
    start = rrb.TimeRangeBoundary.infinite()
    if seconds is not None:
        start = rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds)
    return rrb.VisibleTimeRanges(
        timeline="sim_time", start=start, end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    )


def _spectra() -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin="spectra",
        name="Pseudo-spectrum over time, bearing in the world frame; heading in blue",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-45.0, WIDTH + 8.0], y_range=[-8.0, HEIGHT + 20.0]),
        overrides={"spectra/heading": _last(None)},
    )


def _plots(whole: rrb.TimeAxis) -> rrb.Tabs:
    plots = {
        "uncertainty": ("95 % ellipses, 10^y m", (-2.0, 1.5)),
        "strengths": ("Strengths (dBV)", None),
        "directions": ("Bearings (°)", (-180.0, 180.0)),
        "battery": ("Battery (%)", (0.0, 100.0)),
        "command": ("Commands", None),
    }
    views = [
        rrb.TimeSeriesView(
            origin=f"plots/{plot}",
            name=name,
            axis_x=whole,
            axis_y=axis and rrb.ScalarAxis(range=axis),
            plot_legend=rrb.Corner2D.RightTop,
        )
        for plot, (name, axis) in plots.items()
    ]
    return rrb.Tabs(*views, active_tab=0)


def _phase_pattern() -> rrb.Spatial2DView:
    reach = UNITS_PER_DB * SPAN_DB
    return rrb.Spatial2DView(
        origin="phase_pattern",
        name="Phase-resolved pattern, level over 1 V at 1 m",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-45.0, 370.0], y_range=[-reach - 54.0, reach + 28.0]),
        time_ranges=_last(None),
    )
