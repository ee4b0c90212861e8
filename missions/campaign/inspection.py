"""Inspections of one yard, from logs of missions or field data, and which of their findings are the same discharge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from dirmusic import InputFileError
from dirmusic.array.manifold import GainManifold
from pdpatrol.envs.scenario.base import is_day
from pdpatrol.missions.record.log_contents import described_manifold, known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]

GATE = float(chi2.ppf(0.999, 3))
"""Squared Mahalanobis distance within which findings may be the same discharge: one in a thousand is split."""

REPEAT_STD_M = 0.1
"""Standard deviation of each coordinate from one inspection to the next, in addition to the covariances of the
findings. Assumed; it stands for errors of the map and for reflections that all pulses of a mission share."""

CANDIDATE_STD_M = 1.0
"""Largest standard deviation of a candidate along any axis for it to be joined to a discharge. Assumed; a candidate
with a larger one is compatible with any discharge nearby."""


class LocatedFinding(NamedTuple):
    """Finding at the end of an inspection.

    Attributes:
        id: Number of the finding in log and report.
        is_confirmed: Whether it is confirmed; otherwise it is a candidate.
        position_m: Position, world frame, shape (3,).
        covariance_m2: Covariance of the position, shape (3, 3).
    """

    id: int
    is_confirmed: bool
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
        log: Log of the mission.
    """

    folder: Path
    day: str
    log: MissionLog

    @classmethod
    def read(cls, folder: Path) -> InspectionLog:
        """Read the log of a mission's folder.

        Raises:
            InputFileError: If the log is missing, damaged or incomplete, or has no date.
        """
        try:
            log = MissionLog.load(folder)
        except (ValueError, FileNotFoundError) as error:
            raise InputFileError([str(error)]) from None
        except OSError as error:
            raise InputFileError([f"{folder}: cannot be read ({error.strerror})"]) from None
        day = log.meta.get("date")
        if not isinstance(day, str) or not is_day(day):
            raise InputFileError([f"{folder}: must have a date; `pdpatrol run` and `locate` take --date"])
        if log.n_rows("step") == 0 or log.n_rows("bearing") != log.n_rows("association"):
            raise InputFileError([f"{folder}: the mission is incomplete; give complete ones"])
        inspection = cls(folder, day, log)
        try:
            _ = inspection.manifold, inspection.array_height_m, inspection.yard, log.meta["name"], log.meta["bounds_m"]
        except (KeyError, TypeError, ValueError, AttributeError):
            raise InputFileError([f"{folder}: is not the log of a mission (its metadata are damaged)"]) from None
        return inspection

    @property
    def is_field_data(self) -> bool:
        """True for field data, which have no map and one step for each pose."""
        return "field_data" in self.log.meta

    @cached_property
    def yard(self) -> Yard | None:
        """Yard as the map has it; None without a map."""
        return known_yard(self.log)

    @cached_property
    def manifold(self) -> GainManifold:
        """Manifold of the array according to its data sheet."""
        return described_manifold(self.log.meta["array"])

    @cached_property
    def array_height_m(self) -> float:
        """Height of the array above the ground."""
        return float(np.mean(np.array(self.log.meta["array"]["positions_m"])[:, 2]))

    @cached_property
    def findings(self) -> tuple[LocatedFinding, ...]:
        """Confirmed findings and candidates at the end."""
        table = self.log.table("finding")
        if table["step"].size == 0:
            return ()
        last = (table["step"] == table["step"][-1]) & np.isin(table["state"], ("confirmed", "candidate"))
        columns = (table[name][last] for name in ("id", "state", "position_m", "covariance_m2"))
        return tuple(
            LocatedFinding(int(number), str(state) == "confirmed", position_m, covariance_m2)
            for number, state, position_m, covariance_m2 in zip(*columns, strict=True)
        )


def read_inspections(folders: Sequence[Path]) -> tuple[InspectionLog, ...]:
    """Read the inspections of a campaign and sort them by date.

    Args:
        folders: Folders of missions in any order; two may have the same date.

    Raises:
        InputFileError: With a line for each folder that cannot be used, is given twice, or is of another yard.
    """
    inspections, errors = list[InspectionLog](), list[str]()
    seen = set[Path]()
    for folder in folders:
        if folder.resolve() in seen:
            errors.append(f"{folder}: must be given once, got it twice")
            continue
        seen.add(folder.resolve())
        try:
            inspections.append(InspectionLog.read(folder))
        except InputFileError as error:
            errors += error.faults
    yards = [each.log.meta.get("scenario", {}).get("yard") for each in inspections]
    for each, yard in zip(inspections, yards, strict=True):
        if yard != yards[0]:
            errors.append(f"{each.folder}: must be of the yard of {inspections[0].folder}, but is of another")
    if errors:
        raise InputFileError(errors)
    return tuple(sorted(inspections, key=lambda each: each.day))


def mean_position(findings: Mapping[int, LocatedFinding]) -> tuple[FloatArray, FloatArray]:
    """Average positions, weighted by their covariances.

    Returns:
        Position, shape (3,), and its covariance, shape (3, 3).
    """
    weights = [np.linalg.inv(finding.repeat_covariance_m2) for finding in findings.values()]
    covariance_m2 = np.linalg.inv(np.sum(weights, axis=0))
    weighted = [weight @ finding.position_m for weight, finding in zip(weights, findings.values(), strict=True)]
    return covariance_m2 @ np.sum(weighted, axis=0), covariance_m2


def join_findings(inspections: Sequence[Sequence[LocatedFinding]]) -> list[dict[int, LocatedFinding]]:
    """Join findings of several inspections that are the same discharge.

    A discharge has at most one finding in each inspection, and each confirmed finding belongs to one discharge.
    Confirmed findings are joined first, inspection by inspection; a candidate is then joined to a discharge that has no
    finding in its inspection, and never makes a discharge.

    Args:
        inspections: Findings of each inspection, by date.

    Returns:
        For each discharge its findings by the number of the inspection.
    """
    joined = list[dict[int, LocatedFinding]]()
    for number, findings in enumerate(inspections):
        confirmed = [finding for finding in findings if finding.is_confirmed]
        matches = _match(joined, confirmed)
        for row, finding in enumerate(confirmed):
            if row in matches:
                matches[row][number] = finding
            else:
                joined.append({number: finding})
    for number, findings in enumerate(inspections):
        candidates = [
            finding
            for finding in findings
            if not finding.is_confirmed and np.linalg.eigvalsh(finding.covariance_m2)[-1] <= CANDIDATE_STD_M**2
        ]
        for row, found in _match([found for found in joined if number not in found], candidates).items():
            found[number] = candidates[row]
    return joined


def _match(
    joined: Sequence[dict[int, LocatedFinding]], findings: Sequence[LocatedFinding]
) -> dict[int, dict[int, LocatedFinding]]:
    """Assign findings to discharges, each at most once, with the least sum of squared distances within the gate."""
    squares = np.empty((len(findings), len(joined)))
    for column, found in enumerate(joined):
        place_m, covariance_m2 = mean_position(found)
        for row, finding in enumerate(findings):
            off_m = finding.position_m - place_m
            squares[row, column] = off_m @ np.linalg.solve(finding.repeat_covariance_m2 + covariance_m2, off_m)
    pairs = zip(*linear_sum_assignment(np.where(squares <= GATE, squares, 1e9)), strict=True)
    return {int(row): joined[int(column)] for row, column in pairs if squares[row, column] <= GATE}
