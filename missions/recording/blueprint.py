"""How a viewer shows a recording at first sight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pdpatrol.missions.recording import paths
from pdpatrol.missions.recording.drawing import palette
from pdpatrol.missions.recording.drawing.canvas import BIN_S
from pdpatrol.missions.recording.drawing.phase_pattern import NAME_HEIGHT, SPAN_DB, UNITS_PER_DB
from pdpatrol.missions.recording.drawing.spectra import HEIGHT, WIDTH

PAST_BINS, REJECTED_BINS = 8, 3
"""For so many bins rays are shown after their pulse: of credible pulses, darker, and of rejected ones."""

PLAYBACK = 4.0
"""Simulated seconds a second."""

ELLIPSE_DECADES = (-2.0, 1.5)
"""Of the plot of uncertainty: from a centimetre to the size of a yard."""


def blueprint(meta: Mapping[str, Any], end_s: float | None = None, bin_s: float = BIN_S) -> rrb.Blueprint:
    """The robot from behind and the plan, what goes on in words; below them phases, spectra, plots, phase pattern.

    Args:
        meta: Of the mission's log.
        end_s: Simulated time at which the mission ended, to show the whole of it; None while it runs.
        bin_s: How long a bin of the recording lasts.
    """
    whole = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=0.0),
            end=rrb.TimeRangeBoundary.infinite(),
        )
    )
    behind = _orbit([-3.6, -2.6, 4.6], [0.0, 0.0, 0.5], tracks=paths.ROBOT)
    hidden = (paths.TRUTH, paths.MARKER, paths.EQUIPMENT_NAMES)
    yard = _yard("Robot", behind, bin_s, hidden=hidden, see_through=True)  # the robot may stand behind a transformer
    low, high = (np.array(corner) for corner in meta.get("bounds_m", ((0.0, 0.0), (40.0, 30.0))))
    centre = np.array([*(0.5 * (low + high)), 0.0])
    size_m = float(np.max((high - low) * [1.0, 1.25]))
    above = _orbit(centre + np.array([0.0, -0.01, 0.88 * size_m]), centre, up=(0.0, 1.0, 0.0))
    slant_eye = centre + np.hypot(*(high - low)) * np.array([-0.1, -0.66, 0.5])
    slant = _orbit(slant_eye, centre - np.array([0.0, 0.04 * np.hypot(*(high - low)), 0.0]))
    plan = _yard("Plan", above, bin_s, hidden=(paths.TRUTH,), see_through=True)
    truth = _yard("Plan and truth", above, bin_s, hidden=(), see_through=True)
    around = _yard("Yard", slant, bin_s, hidden=(paths.TRUTH,))
    status = rrb.Vertical(
        rrb.TextDocumentView(origin=paths.STATUS, name="What goes on"),
        rrb.TextLogView(
            origin=paths.EVENTS,
            name="Events",
            columns=rrb.TextLogColumns(timeline_columns=[paths.SIM_TIME], text_log_columns=["body"]),
        ),
        row_shares=[3, 2],
    )
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Tabs(yard, around, active_tab=0),
                rrb.Tabs(plan, truth, active_tab=0),
                status,
                column_shares=[5, 5, 4],
            ),
            rrb.StateTimelineView(origin=paths.PHASE, name="Mission", time_view=whole),
            rrb.Horizontal(_spectra(), _plots(whole), _phase_pattern(), column_shares=[5, 5, 4]),
            row_shares=[10, 2.5, 7],
        ),
        rrb.TimePanel(
            state="collapsed",
            timeline=paths.SIM_TIME,
            playback_speed=PLAYBACK,
            play_state="playing" if end_s else "following",
        ),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _orbit(position: Any, target: Any, up: Any = (0.0, 0.0, 1.0), tracks: str | None = None) -> rrb.EyeControls3D:  # noqa: ANN401
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=position, look_target=target, eye_up=up, tracking_entity=tracks
    )


def _yard(
    name: str, eye: rrb.EyeControls3D, bin_s: float, *, hidden: tuple[str, ...], see_through: bool = False
) -> rrb.Spatial3DView:
    """The world from one side; what lies on a trail is shown as long as it is told by it."""
    now = 0.9 * bin_s  # rings are a bin apart: one at a time
    overrides: dict[Any, Any] = {  # of paths; Rerun's own type is invariant in its keys
        paths.TRAJECTORY: _last(None),
        paths.TRUE_TRAJECTORY: _last(None),
        paths.ODOMETRY: _last(None),
        paths.SPECTRUM: _last(now),
        paths.NEW_BEARINGS: _last(now),
        paths.PAST_BEARINGS: _last(PAST_BINS * bin_s),
        paths.REJECTED: _last(REJECTED_BINS * bin_s),
    }
    if see_through:
        for shape, archetype in (("box", rr.Boxes3D), ("cylinder", rr.Cylinders3D)):
            glass = archetype.from_fields(fill_mode="transparentfillmajorwireframe")
            overrides[f"{paths.EQUIPMENT}/{shape}"] = glass.visualizer()
    overrides |= {path: rrb.EntityBehavior(visible=False) for path in hidden}
    return rrb.Spatial3DView(
        origin=paths.WORLD,
        name=name,
        eye_controls=eye,
        background=palette.SKY,
        line_grid=False,
        spatial_information=None,
        overrides=overrides,
    )


def _last(seconds: float | None) -> rrb.VisibleTimeRanges:
    """What came in the last seconds; everything up to now with None."""
    first = rrb.TimeRangeBoundary.infinite()
    if seconds is not None:
        first = rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds)
    now = rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    return rrb.VisibleTimeRanges(timeline=paths.SIM_TIME, start=first, end=now)


def _spectra() -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=paths.SPECTRA,
        name="Pseudo-spectrum over time, bearing in the world; heading in blue",
        background=palette.SKY,
        visual_bounds=rrb.VisualBounds2D(x_range=[-45.0, WIDTH + 8.0], y_range=[-8.0, HEIGHT + 20.0]),
        overrides={paths.SPECTRA_HEADING: _last(None)},
    )


def _plots(whole: rrb.TimeAxis) -> rrb.Tabs:
    uncertainty = rrb.TimeSeriesView(
        origin=paths.UNCERTAINTY,
        name="95 % ellipses, 10^y m",
        axis_x=whole,
        axis_y=rrb.ScalarAxis(range=ELLIPSE_DECADES),
        plot_legend=rrb.Corner2D.RightTop,
    )
    strengths = rrb.TimeSeriesView(origin=paths.STRENGTHS, name="Strengths (dBV)", axis_x=whole)
    directions = rrb.TimeSeriesView(
        origin=paths.DIRECTIONS, name="Bearings (°)", axis_x=whole, axis_y=rrb.ScalarAxis(range=(-180.0, 180.0))
    )
    battery = rrb.TimeSeriesView(
        origin=paths.BATTERY, name="Battery (%)", axis_x=whole, axis_y=rrb.ScalarAxis(range=(0.0, 100.0))
    )
    command = rrb.TimeSeriesView(origin=paths.COMMAND, name="Commands", axis_x=whole)
    return rrb.Tabs(uncertainty, strengths, directions, battery, command, active_tab=0)


def _phase_pattern() -> rrb.Spatial2DView:
    reach = UNITS_PER_DB * SPAN_DB
    return rrb.Spatial2DView(
        origin=paths.PHASE_PATTERN,
        name="Phase-resolved pattern, level over 1 V at 1 m",
        background=palette.SKY,
        visual_bounds=rrb.VisualBounds2D(x_range=[-45.0, 370.0], y_range=[-reach - 3.0 * NAME_HEIGHT, reach + 28.0]),
        time_ranges=_last(None),
    )
