"""Inspections of one yard, read from logs of missions or field data, and grouping of their findings by discharge."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from dirmusic import InputFileError
from dirmusic.array.manifold import GainManifold
from dirmusic.arrays import FloatArray
from dirmusic.locating.finding import square_within
from pdpatrol.missions.record.log_contents import array_height_of, described_manifold, known_yard, map_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.make_report import findings_at
from pdpatrol.robot_models.yard.yard import Yard

REPEAT_STD_M = 0.1
"""Standard deviation of each coordinate from one inspection to the next, in addition to the covariances of the
findings. Assumed; it covers errors of the map and reflections that affect all pulses of a mission alike."""


CANDIDATE_STD_M = 1.0
"""Largest standard deviation of a candidate along any axis for it to be joined to a discharge. Assumed; a less certain
candidate would match any discharge nearby."""


class LocatedFinding(NamedTuple):
    """Finding at the end of an inspection.

    Attributes:
        id: Number of the finding in log and report.
        state: "confirmed" or "candidate".
        position_m: Position, world frame, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3).
    """

    id: int
    state: str
    position_m: FloatArray
    covariance_m2: FloatArray

    @property
    def repeat_covariance_m2(self) -> FloatArray:
        """Covariance of the position including changes between inspections, shape (3, 3)."""
        return self.covariance_m2 + REPEAT_STD_M**2 * np.eye(3)


@dataclass(frozen=True)
class InspectionLog:
    """Log of one inspection.

    Attributes:
        folder: Folder of the log.
        day: Date of the inspection, such as 2026-03-02.
        name: Name of the scenario.
        bounds_m: South-west and north-east corner of the ground, shape (2, 2).
        yard: Yard as shown on the map; None without a map.
        map_accuracy_m: Believed accuracy of the map, see `MapConfig`.
        is_field_data: True for field data, which have one step for each pose.
        manifold: Manifold of the array according to its data sheet.
        array_height_m: Height of the array above the ground.
        pose: Pose at each step: x m, y m, yaw rad, world frame, shape (n, 3).
        time_s: End of each step, shape (n,).
        pulses: All pulses, with columns `step`, `is_clipped` and `strength_v`, and for pulses with a bearing also
            `std_rad` and `finding`, the id of the finding.
        findings: Confirmed findings and candidates at the end.
    """

    folder: Path
    day: str
    name: str
    bounds_m: FloatArray
    yard: Yard | None
    map_accuracy_m: float
    is_field_data: bool
    manifold: GainManifold
    array_height_m: float
    pose: FloatArray
    time_s: FloatArray
    pulses: pd.DataFrame
    findings: list[LocatedFinding]

    @classmethod
    def of(cls, folder: Path, log: MissionLog) -> InspectionLog:
        """Extract the data that a trend needs from a log.

        Raises:
            ValueError: If the log is incomplete, has no date, or has damaged metadata.
        """
        day = log.meta.get("date")
        if day is None:
            raise ValueError(f"{folder}: must have a date; `pdpatrol run` and `locate` take --date")
        if log.n_rows("step") == 0 or log.n_rows("bearing") != log.n_rows("association"):
            raise ValueError(f"{folder}: the mission is incomplete; give complete ones")
        pulse, bearing = log.table("pulse"), log.table("bearing")
        pulses = pd.DataFrame({name: pulse[name] for name in ("step", "is_clipped")})
        pulses["strength_v"] = np.linalg.norm(pulse["strengths_v"], axis=-1)
        of_bearing = {"std_rad": bearing["std_rad"], "finding": log.column("association", "finding")}
        pulses = pulses.join(pd.DataFrame(of_bearing, index=bearing["pulse"]))
        finding = findings_at(log, log.n_rows("step"), "confirmed", "candidate")
        columns = (finding[name] for name in ("id", "state", "position_m", "covariance_m2"))
        try:
            return cls(
                folder=folder,
                day=str(date.fromisoformat(day)),
                name=str(log.meta["name"]),
                bounds_m=np.array(log.meta["bounds_m"]),
                yard=known_yard(log),
                map_accuracy_m=map_of(log).accuracy_m,
                is_field_data="field_data" in log.meta,
                manifold=described_manifold(log.meta["array"]),
                array_height_m=array_height_of(log),
                pose=log.column("step", "pose"),
                time_s=log.column("step", "time_s"),
                pulses=pulses,
                findings=[LocatedFinding(*row) for row in zip(*columns, strict=True)],
            )
        except (KeyError, TypeError, ValueError, AttributeError, IndexError):
            raise ValueError(f"{folder}: is not the log of a mission (its metadata are damaged)") from None


def read_inspections(folders: Sequence[Path]) -> list[InspectionLog]:
    """Read the inspections of a campaign and sort them by date.

    Args:
        folders: Folders of missions in any order.

    Raises:
        InputFileError: If a folder cannot be used, is given twice, or belongs to another yard (the message has a line
            for each such folder); or if there are fewer than two dates.
    """
    inspections, errors, yard = dict[Path, InspectionLog](), list[str](), None
    for folder in folders:
        if folder.resolve() in inspections:
            errors.append(f"{folder}: must be given once, got it twice")
            continue
        try:
            log = MissionLog.load(folder)
            inspections[folder.resolve()] = InspectionLog.of(folder, log)
        except (ValueError, OSError) as error:
            errors.append(str(error))
            continue
        settings = log.meta.get("scenario", {}).get("yard")
        if len(inspections) == 1:
            yard = settings
        elif settings != yard:
            errors.append(f"{folder}: must be of the yard of the first folder, but is of another")
    by_date = sorted(inspections.values(), key=lambda each: each.day)
    if not errors and len({each.day for each in by_date}) < 2:
        days = ", ".join(each.day for each in by_date) or "none"
        errors.append(f"RUN: inspections of at least two dates must be given, got {days}")
    if errors:
        raise InputFileError(errors)
    return by_date


def mean_position(findings: Iterable[LocatedFinding]) -> tuple[FloatArray, FloatArray]:
    """Average positions, weighted by the inverses of their covariances.

    Returns:
        Position, shape (3,), and its covariance, shape (3, 3).
    """
    positions_m, covariances_m2 = zip(*((each.position_m, each.repeat_covariance_m2) for each in findings), strict=True)
    weights = np.linalg.inv(covariances_m2)
    covariance_m2 = np.linalg.inv(weights.sum(axis=0))
    return covariance_m2 @ np.einsum("nij,nj->i", weights, positions_m), covariance_m2


def join_findings(inspections: Sequence[Sequence[LocatedFinding]]) -> list[dict[int, LocatedFinding]]:
    """Group the findings of several inspections by discharge.

    A discharge has at most one finding in each inspection, and each confirmed finding belongs to one discharge.
    Confirmed findings are grouped first, one inspection after the other. A candidate is then added to a discharge that
    has no finding in the same inspection; it never starts a new discharge.

    Args:
        inspections: Findings of each inspection, in order of date.

    Returns:
        For each discharge, its findings by the index of their inspection.
    """
    joined = list[dict[int, LocatedFinding]]()
    for state, max_std_m in (("confirmed", np.inf), ("candidate", CANDIDATE_STD_M)):
        for number, findings in enumerate(inspections):
            chosen = [
                each
                for each in findings
                if each.state == state and np.linalg.eigvalsh(each.covariance_m2)[-1] <= max_std_m**2
            ]
            matches = _match([found for found in joined if number not in found], chosen)
            for row, finding in enumerate(chosen):
                if row in matches:
                    matches[row][number] = finding
                elif state == "confirmed":
                    joined.append({number: finding})
    return joined


def _match(
    joined: Sequence[dict[int, LocatedFinding]], findings: Sequence[LocatedFinding]
) -> dict[int, dict[int, LocatedFinding]]:
    """Assign findings to discharges one to one, with the smallest sum of squared distances within the gate."""
    squares = np.empty((len(findings), len(joined)))
    for column, found in enumerate(joined):
        place_m, covariance_m2 = mean_position(found.values())
        for row, finding in enumerate(findings):
            off_m = finding.position_m - place_m
            squares[row, column] = off_m @ np.linalg.solve(finding.repeat_covariance_m2 + covariance_m2, off_m)
    gate = square_within(0.99, 3)  # excludes one in a hundred findings of the same discharge
    rows, columns = linear_sum_assignment(np.where(squares <= gate, squares, 1e9))
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {row: joined[column] for row, column in pairs if squares[row, column] <= gate}
