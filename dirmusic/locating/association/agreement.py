"""Agreement: whether bearings from many places point to one, as well as they should."""

from __future__ import annotations

import numpy as np

from dirmusic.angles import difference
from dirmusic.array.element_errors import ElementErrors
from dirmusic.locating.association.gating import expect_bearings
from dirmusic.locating.association.pulse_record import PulseRecord, Rows, evenly
from dirmusic.locating.finding import Finding

VISIT_S = 5.0
"""Pulses of one place and so long a time are one visit (assumed): the errors of the pose stay the same."""


MOST_PULSES = 200
"""More do not tell better (assumed): those of one visit share their errors."""


def disagreement(record: PulseRecord, rows: Rows, finding: Finding, errors: ElementErrors) -> float:
    r"""How far bearings point past a finding, in deviations that they should have; 1 for a source, on average.

    .. math:: \sqrt{\frac{1}{m} \sum_{g=1}^{m} \frac{\bar o_g^2}{1 / \sum_i \sigma_i^{-2} + \sigma_c^2}}

    over visits of places: :math:`\bar o` is the mean offset of their pulses, weighted by what
    noise :math:`\sigma_i` leaves it worth, and :math:`\sigma_c` what they have in common, by array, pose and range.
    What wanders, as echoes of something that moves and diffracted waves from many edges, points past any one place by
    more, each pulse within its own deviation.

    Args:
        record: All pulses.
        rows: Rows of the finding's own, shape (n,), n >= 1.
        finding: The finding.
        errors: Errors of the array's elements as known by now.
    """
    rows = evenly(rows, MOST_PULSES)
    bearing_rad, std_rad = record.bearings(rows, errors)
    expected, noise_rad2 = expect_bearings(record, rows, finding), np.square(record.pulses.std_rad[rows])
    offset_rad = difference(bearing_rad, expected.bearing_rad)
    common_rad2 = np.square(std_rad) - noise_rad2 + expected.position_rad2 + expected.elevation_rad2
    visit = (record.elapsed_s[rows] // VISIT_S).astype(np.intp) * len(record.places_m) + record.place[rows]
    _, group = np.unique(visit, return_inverse=True)
    of_group = np.bincount(group, 1.0 / noise_rad2)
    mean_rad = np.bincount(group, offset_rad / noise_rad2) / of_group
    expected_rad2 = 1.0 / of_group + np.bincount(group, common_rad2) / np.bincount(group)
    return float(np.sqrt(np.mean(np.square(mean_rad) / expected_rad2)))
