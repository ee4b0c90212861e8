"""Compare sixty missions with the stored ones: refactoring must not change what they find."""

import json
from typing import Any

import numpy as np
import pytest

from tests.golden.golden import STORED, GoldenCase, cases, run

POSITION_TOLERANCE_M = 0.03
ELLIPSE_TOLERANCE = 0.1
TIME_TOLERANCE_S = 2.0
IN_CI = 6
"""Every tenth mission runs in CI; the others are slow."""


def by_position(findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return sorted(findings, key=lambda finding: tuple(finding["position_m"]))


@pytest.mark.parametrize(
    "stored",
    [
        pytest.param(
            row,
            id=f"{row['scenario']}-{row['seed']}-{row['policy']}",
            marks=pytest.mark.slow if number % (60 // IN_CI) else pytest.mark.whole,
        )
        for number, row in enumerate(json.loads(STORED.read_text(encoding="utf-8")))
    ],
)
def test_golden_mission_finds_the_same(stored: dict[str, Any]) -> None:
    now = run(GoldenCase(stored["scenario"], stored["seed"], stored["policy"]))
    assert now["end"] == stored["end"]
    np.testing.assert_allclose(now["sources_m"], stored["sources_m"], atol=1e-6)
    np.testing.assert_allclose(now["duration_s"], stored["duration_s"], atol=TIME_TOLERANCE_S)
    assert len(now["findings"]) == len(stored["findings"])
    for found, expected in zip(by_position(now["findings"]), by_position(stored["findings"]), strict=True):
        np.testing.assert_allclose(found["position_m"], expected["position_m"], atol=POSITION_TOLERANCE_M)
        np.testing.assert_allclose(found["semi_axes_m"], expected["semi_axes_m"], rtol=ELLIPSE_TOLERANCE)
        np.testing.assert_allclose(found["confirmed_s"], expected["confirmed_s"], atol=TIME_TOLERANCE_S)


def test_golden_missions_cover_all_levels() -> None:
    rows = json.loads(STORED.read_text(encoding="utf-8"))
    assert [(row["scenario"], row["seed"], row["policy"]) for row in rows] == list(cases())
