"""Where everything lies in a recording, and how a viewer shows it at first sight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun.blueprint as rrb

SIM_TIME, STEP = "sim_time", "step"
"""Timelines: simulated seconds, and control steps."""

WORLD = "world"
GROUND = f"{WORLD}/yard/ground"
LIKELIHOOD = f"{WORLD}/likelihood"
"""Over the ground: how likely a source is at each place by all pulses so far."""
EQUIPMENT = f"{WORLD}/yard/equipment"
FENCE = f"{WORLD}/yard/fence"
MAP = f"{WORLD}/yard/map"
"""Outlines of what the map shows and does not stand there."""
SITES = f"{WORLD}/yard/sites"
ROUTE = f"{WORLD}/route"
TRAJECTORY = f"{WORLD}/trajectory"
ODOMETRY = f"{WORLD}/odometry"
ROBOT = f"{WORLD}/robot"
BODY = f"{ROBOT}/body"
SPECTRUM = f"{ROBOT}/spectrum"
BEARINGS = f"{WORLD}/bearings"
FINDINGS = f"{WORLD}/findings"
TRUTH = f"{WORLD}/truth"
TRUE_SOURCES = f"{TRUTH}/sources"
TRUE_NAMES = f"{TRUTH}/names"
TRUE_WAYS = f"{TRUTH}/ways"
"""Lines along which interferers move; they are named where they start."""
TRUE_TRAJECTORY = f"{TRUTH}/trajectory"
STRENGTHS = "plots/strengths"
UNCERTAINTY = "plots/uncertainty"
COMMAND = "plots/command"
BATTERY = "plots/battery"
PHASES = "plots/pulse_phase"
PHASE = "mission/phase"
EVENTS = "mission/events"


def finding_path(finding: int) -> str:
    """Where the fix of one finding lies: its point; `/ellipse` below it is the 95 % ellipse."""
    return f"{FINDINGS}/{finding}"


def blueprint(meta: Mapping[str, Any], end_s: float | None = None) -> rrb.Blueprint:
    """The yard in space and as a plan; below them strengths, uncertainty of the fixes, mission phase and events.

    Args:
        meta: Of the mission's log.
        end_s: Simulated time at which the mission ended, to show the whole of it; None while it runs.
    """
    low, high = (np.array(corner) for corner in meta.get("bounds_m", ((0.0, 0.0), (40.0, 30.0))))
    centre = np.array([*(0.5 * (low + high)), 0.0])
    diagonal_m = float(np.hypot(*(high - low)))
    slant = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=centre + diagonal_m * np.array([-0.16, -0.52, 0.46]),
        look_target=centre - np.array([0.0, 0.08 * diagonal_m, 0.0]),
        eye_up=[0.0, 0.0, 1.0],
    )
    above = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=centre + np.array([0.0, -0.01, 0.95 * diagonal_m]),
        look_target=centre,
        eye_up=[0.0, 1.0, 0.0],
    )
    whole = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=0.0),
            end=rrb.TimeRangeBoundary.absolute(seconds=end_s) if end_s else rrb.TimeRangeBoundary.infinite(),
        )
    )
    sky = [24, 28, 34]
    yard = rrb.Spatial3DView(
        origin=WORLD, name="Yard", eye_controls=slant, background=sky, line_grid=False, spatial_information=None
    )
    plan = rrb.Spatial3DView(
        origin=WORLD,
        contents=["$origin/**", f"- {BODY}/**", f"- {TRUE_NAMES}"],
        name="Plan",
        eye_controls=above,
        background=sky,
        line_grid=False,
    )
    strengths = rrb.TimeSeriesView(origin=STRENGTHS, name="Strength per element (dBV)", axis_x=whole)
    uncertainty = rrb.TimeSeriesView(
        origin=UNCERTAINTY,
        name="95 % ellipse, longer half-axis (m)",
        axis_x=whole,
        axis_y=rrb.ScalarAxis(range=(0.0, 5.0)),
    )
    battery = rrb.TimeSeriesView(
        origin=BATTERY, name="Battery (%)", axis_x=whole, axis_y=rrb.ScalarAxis(range=(0.0, 100.0))
    )
    phases = rrb.Spatial2DView(
        origin=PHASES,
        name="Pulse phase",
        background=sky,
        visual_bounds=rrb.VisualBounds2D(x_range=[-20.0, 380.0], y_range=[-125.0, 125.0]),
    )
    play_state = "playing" if end_s else "following"
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(yard, plan, column_shares=[3, 2]),
            rrb.Horizontal(
                strengths,
                rrb.Tabs(uncertainty, phases, battery, active_tab=0),
                rrb.Vertical(
                    rrb.StateTimelineView(origin=PHASE, name="Phase"),
                    rrb.TextLogView(
                        origin=EVENTS,
                        name="Events",
                        columns=rrb.TextLogColumns(timeline_columns=[SIM_TIME], text_log_columns=["loglevel", "body"]),
                    ),
                    row_shares=[2, 3],
                ),
                column_shares=[3, 2, 2],
            ),
            row_shares=[5, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=SIM_TIME, playback_speed=4.0, play_state=play_state),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )
