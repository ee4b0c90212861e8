"""Pictures of the equipment at each finding, rendered from the map of the yard."""

from __future__ import annotations

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from dirmusic.angles import azimuth_of
from pdpatrol.missions.record.finding_pulses import finding_pulses
from pdpatrol.missions.record.log_contents import known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.figures import STATES, STYLE, draw_label
from pdpatrol.missions.report.records import FindingRecord, Report
from pdpatrol.robot_models.rendering import View, pictures_of, pixels_per_metre
from pdpatrol.robot_models.world import build_yard
from pdpatrol.robot_models.yard.yard import Yard

MOST_PICTURES = 12
"""Largest number of findings that get a picture. Assumed; each takes 0.3 s without a graphics card."""

ELEVATION_RAD = np.radians(18.0)
"""Elevation of the camera, seen from the finding. Assumed, as the next two; they matter for the pictures only."""

NEAREST_M, SIZES_AWAY = 4.0, 1.7
"""Smallest distance of the camera, and its distance in lengths of the longest side of the equipment."""


def draw_finding_pictures(log: MissionLog, report: Report) -> dict[int, Figure]:
    """Draw the equipment at each confirmed finding, seen from where the robot was nearest if nothing hides it there.

    Returns:
        A figure for each of the first findings by number; none without a map.

    Raises:
        RuntimeError: If MuJoCo cannot use OpenGL.
    """
    yard, findings = known_yard(log), report.findings[:MOST_PICTURES]
    if yard is None or not findings:
        return {}
    model, views = build_yard(yard).compile(), [_view(log, yard, finding) for finding in findings]
    figures = dict[int, Figure]()
    for finding, view, picture in zip(findings, views, pictures_of(model, views), strict=True):
        height, width, _ = picture.shape
        with rc_context(STYLE):
            figure = Figure(figsize=(width / 160, height / 160), dpi=160)
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.imshow(picture)
        colour, middle = STATES[finding.state][0], (0.5 * width, 0.5 * height)
        radius = max(finding.ellipse95.semi_major_m * pixels_per_metre(view, model), 7.0)
        for edge, line in (("white", 3.6), (colour, 1.8)):
            axes.add_patch(Circle(middle, radius, fill=False, edgecolor=edge, linewidth=line))
        draw_label(axes, str(finding.id), (middle[0] + radius, middle[1] - radius), (10.0, 10.0), colour)
        figures[finding.id] = figure
    return figures


def _view(log: MissionLog, yard: Yard, finding: FindingRecord) -> View:
    """Return the view of a finding from the side of the nearest pose, or the closest side from which it is free."""
    place_m, pulses = np.array(finding.position_m), finding_pulses(log)[finding.id]
    nearest = log.column("pulse", "step")[pulses.pulse[pulses.range_m.argmin()]]
    towards_rad = float(azimuth_of(log.column("step", "pose")[nearest, :2] - place_m[:2]))
    piece = next((item for item in yard.equipment if finding.asset and item.name == finding.asset.name), None)
    size_m = 0.0 if piece is None else max(*np.ptp(piece.solids.extent_m, axis=0), piece.solids.top_m.max())
    distance_m = max(NEAREST_M, SIZES_AWAY * size_m)
    way_m = np.linspace(0.5, distance_m, 40)[:, np.newaxis]
    azimuths_rad = towards_rad + np.radians(sorted(range(-165, 181, 15), key=abs))
    for azimuth_rad in azimuths_rad:
        cos = np.cos(ELEVATION_RAD)
        along = np.array([cos * np.cos(azimuth_rad), cos * np.sin(azimuth_rad), np.sin(ELEVATION_RAD)])
        if yard.solids.distance(place_m + way_m * along).min(initial=np.inf) > 0.1:
            break
    else:
        azimuth_rad = towards_rad
    return View(finding.position_m, float(azimuth_rad), float(ELEVATION_RAD), float(distance_m))
