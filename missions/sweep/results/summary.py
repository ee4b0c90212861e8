"""A dataset summed up: a line for each scenario or level of the suite, policy and setting, with 95 % intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from pdpatrol.missions.sweep.results.intervals import Interval, bootstrap_interval, root_mean_square, share_interval


class GroupSummary(NamedTuple):
    """Missions of one scenario that differ by their seed alone, or those of one level of the suite.

    Attributes:
        group: Name of the scenario or level, or `ALL`.
        policy: Who drove.
        settings: What the sweep set, as JSON.
        n_missions: How many there are.
        n_unfinished: Of those, the ones that failed, hung, ran out of memory or died; they count as missions in which
            nothing was found only in this number.
        bearing_rmse_rad: Root mean square error of the bearings, over the missions with a single source.
        found: Share of all sources that were found, with Wilson's interval.
        error_m: Median distance of findings from their sources.
        error95_m: 95 % of the distances are below this; NaN without any.
        in_ellipse: Share of the found sources that lie in the 95 % ellipse of their finding.
        right_site: Share of the found sources that have the right site.
        confirmed_s: Median time until a source was confirmed.
        detour: Median of the way driven until all sources were confirmed over the shortest way of one who knows them;
            of the missions that found all and began out of reach of them.
        ospa_m: Mean distance between findings and sources as sets.
        false_findings: Confirmed findings without a source, all together.
        contacts: How often anything was touched.
        waypoints_missed: Waypoints not visited, all together.
    """

    group: str
    policy: str
    settings: str
    n_missions: int
    n_unfinished: int
    bearing_rmse_rad: Interval
    found: Interval
    error_m: Interval
    error95_m: float
    in_ellipse: Interval
    right_site: Interval
    confirmed_s: Interval
    detour: Interval
    ospa_m: Interval
    false_findings: int
    contacts: int
    waypoints_missed: int


ALL = "all"
"""Group of all missions of a policy with a setting."""


def summarise_groups(rows: pa.Table) -> list[GroupSummary]:
    """Sum up a dataset: groups in the order of the plan, and below the levels of the suite a line for all of them.

    The intervals are for the same yards with other seeds.
    """
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for row in rows.to_pylist():
        groups.setdefault((group_of(row), row["policy"], row["settings"]), []).append(row)
    if len({group for group, _, _ in groups}) > 1 and all(rows["suite"].to_pylist()):
        for row in rows.to_pylist():
            groups.setdefault((ALL, row["policy"], row["settings"]), []).append(row)
    return [_summarise(name, members) for name, members in groups.items()]


def group_of(row: Mapping[str, Any]) -> str:
    """The level of the suite that a row belongs to, or its scenario."""
    return row["level"] or row["scenario"]


def _summarise(name: tuple[str, str, str], rows: Sequence[dict[str, Any]]) -> GroupSummary:
    finished = [row for row in rows if row["status"] == "finished"]
    total = {
        column: sum(row[column] for row in finished)
        for column in (
            "n_sources", "n_found", "n_in_ellipse", "n_right_site", "false_findings", "contacts", "waypoints_missed",
        )
    }  # fmt: skip
    detours = [
        row["found_all_m"] / row["shortest_m"]
        for row in finished
        if row["found_all_m"] is not None and row["shortest_m"]
    ]
    rmse_rad = np.array([row["bearing_rmse_rad"] for row in finished if row["bearing_rmse_rad"] is not None])
    errors_m = np.array([error for row in finished for error in row["errors_m"]])
    confirmed_s = np.array([time_s for row in finished for time_s in row["confirmed_s"]])
    return GroupSummary(
        *name,
        n_missions=len(rows),
        n_unfinished=len(rows) - len(finished),
        bearing_rmse_rad=bootstrap_interval(rmse_rad, root_mean_square),
        found=share_interval(total["n_found"], total["n_sources"]),
        error_m=bootstrap_interval(errors_m, np.median),
        error95_m=float(np.quantile(errors_m, 0.95)) if errors_m.size else float("nan"),
        in_ellipse=share_interval(total["n_in_ellipse"], total["n_found"]),
        right_site=share_interval(total["n_right_site"], total["n_found"]),
        confirmed_s=bootstrap_interval(confirmed_s, np.median),
        detour=bootstrap_interval(np.array(detours), np.median),
        ospa_m=bootstrap_interval(np.array([row["ospa_m"] for row in finished]), np.mean),
        false_findings=total["false_findings"],
        contacts=total["contacts"],
        waypoints_missed=total["waypoints_missed"],
    )
