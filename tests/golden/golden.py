"""Run the sixty golden missions and summarise what each found.

`uv run python -m tests.golden.golden` runs them again and rewrites `missions.json`. Do so only for a change that is
meant to move results, and say so in its commit.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pdpatrol.envs import load_scenario
from pdpatrol.envs.random_yard import random_yard
from pdpatrol.missions.report.make_report import make_report
from pdpatrol.missions.runner import run_mission

STORED = Path(__file__).with_name("missions.json")
SHIPPED = (
    "bench", "gis_hall", "one_source", "paper_field", "quiet_yard", "switchyard", "transformer_bay",
    "twin_transformers", "two_sources",
)  # fmt: skip
LEVELS = (
    "open", "cluttered", "weak", "reflective", "several", "high", "faulty", "interference", "wrong_map", "poor_pose",
    "quiet",
)  # fmt: skip


class GoldenCase(NamedTuple):
    """One mission: a shipped scenario, `random` or a yard of the suite, with its seed and policy."""

    scenario: str
    seed: int
    policy: str


def cases() -> Iterator[GoldenCase]:
    """Yield the sixty missions in a fixed order."""
    for number, name in enumerate(SHIPPED):
        yield GoldenCase(name, 100 + number, "seek")
        yield GoldenCase(name, 200 + number, "seek" if number % 3 else "active")
    for number, policy in enumerate(("patrol", "oracle", "random", "active")):
        yield GoldenCase("transformer_bay", 300 + number, policy)
    for seed in range(16):
        yield GoldenCase("random", 500 + seed, "active" if seed % 4 == 3 else "seek")
    for number, level in enumerate(LEVELS):
        yield GoldenCase(f"suite/{level}_02", 700 + number, "seek")
        yield GoldenCase(f"suite/{level}_05", 800 + number, "seek")


def run(case: GoldenCase) -> dict[str, Any]:
    """Run one mission and summarise it: confirmed findings with 95 % ellipses, times, and how it ended."""
    scenario = random_yard(case.seed, case.seed % 8) if case.scenario == "random" else load_scenario(case.scenario)
    log = run_mission(scenario, case.policy, case.seed)
    report = make_report(log, 0.0)
    return {
        **case._asdict(),
        "n_pulses": report.pulses.detected,
        "duration_s": round(report.sim_time_s, 1),
        "end": report.ending,
        "sources_m": [source["position_m"] for source in log.meta["truth"]["sources"]],
        "findings": [
            {
                "position_m": np.round(finding.position_m, 4).tolist(),
                "semi_axes_m": [round(finding.ellipse95.semi_major_m, 4), round(finding.ellipse95.semi_minor_m, 4)],
                "height_std_m": round(finding.position_std_m[2], 4),
                "confirmed_s": round(finding.confirmed_s or 0.0, 1),
            }
            for finding in report.findings
        ],
    }


def main() -> None:
    """Run all missions and store them."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(run, cases()))
    lines = ",\n".join(json.dumps(result) for result in results)
    STORED.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
