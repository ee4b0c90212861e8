"""One inspection: the log of a mission, or of data from the field, with its date."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic import InputFileError
from dirmusic.array.manifold import GainManifold
from pdpatrol.envs.scenario.base import is_day
from pdpatrol.missions.record.log_contents import described_manifold, known_yard
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.robot_models.yard.yard import Yard

FloatArray = NDArray[np.float64]


class Located(NamedTuple):
    """A finding as it stood at the end of an inspection.

    Attributes:
        id: As in log and report.
        is_confirmed: Whether it is more than a candidate.
        position_m: Shape (3,), world frame.
        covariance_m2: Shape (3, 3).
    """

    id: int
    is_confirmed: bool
    position_m: FloatArray
    covariance_m2: FloatArray


@dataclass(frozen=True)
class Inspection:
    """What a campaign needs of one inspection.

    Attributes:
        folder: That the log is in.
        day: When it took place, as 2026-03-02.
        log: Of the mission.
    """

    folder: Path
    day: str
    log: MissionLog

    @classmethod
    def read(cls, folder: Path) -> Inspection:
        """Read the log of a mission's folder.

        Raises:
            InputFileError: If there is none, it is damaged, it was cut short, or it has no date.
        """
        try:
            log = MissionLog.load(folder)
        except (ValueError, FileNotFoundError) as error:
            raise InputFileError([str(error)]) from None
        except OSError as error:
            raise InputFileError([f"{folder}: cannot be read ({error.strerror})"]) from None
        day = log.meta.get("date")
        if not isinstance(day, str) or not is_day(day):
            raise InputFileError(
                [f"{folder}: has no date of inspection; make it anew: `pdpatrol run` and `locate` have --date"]
            )
        if log.n_rows("step") == 0 or log.n_rows("bearing") != log.n_rows("association"):
            raise InputFileError([f"{folder}: the mission was cut short; give those that came to their end"])
        inspection = cls(folder, day, log)
        try:
            _ = inspection.manifold, inspection.array_height_m, inspection.yard, log.meta["name"], log.meta["bounds_m"]
        except (KeyError, TypeError, ValueError, AttributeError):
            raise InputFileError([f"{folder}: is not the log of a mission (its facts are damaged)"]) from None
        return inspection

    @property
    def is_of_the_field(self) -> bool:
        """Whether people took the data: it has no map, and a step for each pose alone."""
        return "field_data" in self.log.meta

    @cached_property
    def yard(self) -> Yard | None:
        """As the map has it; None where none is known."""
        return known_yard(self.log)

    @cached_property
    def manifold(self) -> GainManifold:
        """Of the array's data sheet."""
        return described_manifold(self.log.meta["array"])

    @cached_property
    def array_height_m(self) -> float:
        """Of the array above the ground."""
        return float(np.mean(np.array(self.log.meta["array"]["positions_m"])[:, 2]))

    @cached_property
    def findings(self) -> tuple[Located, ...]:
        """Confirmed findings and candidates as they stood at the end."""
        table = self.log.table("finding")
        if table["step"].size == 0:
            return ()
        last = (table["step"] == table["step"][-1]) & np.isin(table["state"], ("confirmed", "candidate"))
        return tuple(
            Located(
                int(table["id"][row]),
                str(table["state"][row]) == "confirmed",
                table["position_m"][row],
                table["covariance_m2"][row],
            )
            for row in np.flatnonzero(last)
        )


def read_inspections(folders: Sequence[Path]) -> tuple[Inspection, ...]:
    """The inspections of a campaign by their dates.

    Args:
        folders: Of the missions, in any order; two may be of one day.

    Raises:
        InputFileError: With a line for each folder that cannot be used, is given twice, or is of another yard.
    """
    inspections, faults = list[Inspection](), list[str]()
    seen = set[Path]()
    for folder in folders:
        if folder.resolve() in seen:
            faults.append(f"{folder}: given twice; allowed is once")
            continue
        seen.add(folder.resolve())
        try:
            inspections.append(Inspection.read(folder))
        except InputFileError as error:
            faults += error.faults
    for each in inspections[1:]:
        if _site_of(each) != _site_of(inspections[0]):
            faults.append(f"{each.folder}: is of another yard than {inspections[0].folder}; give those of one yard")
    if faults:
        raise InputFileError(faults)
    return tuple(sorted(inspections, key=lambda each: each.day))


def _site_of(inspection: Inspection) -> object:
    """What two inspections of one yard have in common."""
    return inspection.log.meta.get("scenario", {}).get("yard")
