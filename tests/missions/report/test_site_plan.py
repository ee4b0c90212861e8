"""The plan of a report: what lies beyond it is marked at its edge, and no label covers another."""

from itertools import combinations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Annotation

from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.report.pictures.site_plan import draw_site_plan
from tests.missions.report.logs import empty_log

BEYOND_M = {3: (-40.0, 5.0), 4: (-60.0, 5.4), 7: (9.0, -30.0), 8: (12.0, -35.0), 9: (10.0, -99.0), 11: (50.0, -50.0)}
"""Places by the ids of findings; the plan ends at -1 and 21."""


def test_findings_beyond_the_plan_are_all_named_and_no_name_covers_another() -> None:
    log = empty_log()
    for number, place_m in {**BEYOND_M, 5: (10.0, 10.0)}.items():
        log.append(
            "finding", step=0, id=number, position_m=np.array([*place_m, 1.0]), covariance_m2=0.01 * np.eye(3),
            state="outside", n_bearings=30, first_detected_s=0.0, confirmed_s=np.nan, aperture_rad=0.3,
        )  # fmt: skip
    figure = draw_site_plan(log, make_report(log, 0.0), None)
    FigureCanvasAgg(figure).draw()
    axes = figure.axes[0]
    labels = [text for text in axes.texts if isinstance(text, Annotation) and text.get_text()[:1].isdigit()]
    named = sorted(int(number) for label in labels for number in label.get_text().split(", "))
    assert named == sorted([*BEYOND_M, 5])
    boxes = [label.get_window_extent() for label in labels]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    assert all(axes.bbox.containsx(x) for box in boxes for x in box.intervalx)
    assert all(axes.bbox.containsy(y) for box in boxes for y in box.intervaly)
