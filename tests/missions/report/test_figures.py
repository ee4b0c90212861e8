"""Site plan."""

from itertools import combinations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Annotation

from pdpatrol.missions.report.figures import draw_site_plan
from pdpatrol.missions.report.make_report import make_report
from tests.missions.report.logs import add_finding, empty_log

BEYOND_M = {3: (-40.0, 5.0), 4: (-60.0, 5.4), 7: (9.0, -30.0), 8: (12.0, -35.0), 9: (10.0, -99.0), 11: (50.0, -50.0)}
"""Positions by id of findings; the plan ends at -1 and 21."""


def test_site_plan_labels_every_finding_without_overlap() -> None:
    """Findings beyond the plan are labelled at its edge; labels do not cover each other."""
    log = empty_log()
    for number, (x, y) in {**BEYOND_M, 5: (10.0, 10.0)}.items():
        add_finding(log, 0, number, "outside", (x, y, 1.0))
    figure = draw_site_plan(log, make_report(log, 0.0))
    FigureCanvasAgg(figure).draw()
    axes = figure.axes[0]
    labels = [text for text in axes.texts if isinstance(text, Annotation) and text.get_text()[:1].isdigit()]
    numbers = sorted(int(number) for label in labels for number in label.get_text().split(", "))
    assert numbers == sorted([*BEYOND_M, 5])
    boxes = [label.get_window_extent() for label in labels]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    assert all(axes.bbox.containsx(x) for box in boxes for x in box.intervalx)
    assert all(axes.bbox.containsy(y) for box in boxes for y in box.intervaly)
