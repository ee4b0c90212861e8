"""Steps and pulses of a mission as Parquet: one row each, units in the names of columns, frames in their metadata."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from dirmusic.locating.association.assignment import NoOwner
from pdpatrol.missions.record.mission_log import MissionLog

WORLD = "world frame: x east, y north, origin at the south-west corner of the yard, yaw counter-clockwise from east"
ARRAY = "frame of the array: counter-clockwise from ahead"


def write_steps(log: MissionLog, path: Path) -> None:
    """One row for each control step."""
    step = log.table("step")
    columns: dict[str, tuple[NDArray[Any], str]] = {"time_s": (step["time_s"], "since the start of the mission")}
    poses = (
        ("pose", "", "as the robot believes"),
        ("true_pose", "true_", "truth"),
        ("odometry", "odometry_", "wheels and gyro"),
    )
    for name, prefix, what in poses:
        for k, unit in enumerate(("x_m", "y_m", "yaw_rad")):
            columns[f"{prefix}{unit}"] = (step[name][:, k], f"{what}; {WORLD}")
    columns["battery"] = (step["battery"], "share that is left")
    for k, name in enumerate(("speed_mps", "yaw_rate_radps")):
        columns[f"commanded_{name}"] = (step["command"][:, k], "asked for during the step")
    columns["phase"] = (step["phase"], "what the policy did")
    columns["phase_target"] = (step["phase_target"], "waypoint or finding that it drove to; 0 for neither")
    _write(columns, path)


def write_pulses(log: MissionLog, path: Path) -> None:
    """One row for each pulse; bearing and finding are null where it has none."""
    pulse, bearing, association = log.table("pulse"), log.table("bearing"), log.table("association")
    n, row = log.n_rows("pulse"), bearing["pulse"]
    step = pulse["step"]
    columns: dict[str, tuple[NDArray[Any], str]] = {
        "step": (step, "row in the table of steps"),
        "time_s": (log.column("step", "time_s")[step], "end of its step"),
        **{f"strength_{k + 1}_v": (volts, f"in element {k + 1}") for k, volts in enumerate(pulse["strengths_v"].T)},
        "mains_phase_rad": (pulse["mains_phase_rad"], "of the receiver's mains"),
        "is_clipped": (pulse["is_clipped"], "met the end of the converter's scale"),
        "is_credible": (pulse["is_credible"], "looks like one plane wave from one direction"),
    }
    for name, what in (("azimuth_rad", ARRAY), ("bearing_rad", WORLD), ("std_rad", "of the bearing, by noise alone")):
        columns[name] = (_scattered(bearing[name], row, n), what)
    owner = np.full(n, np.nan)
    owner[association["pulse"]] = association["finding"]
    fate = np.full(n, "", dtype="U32")
    for code in NoOwner:
        fate[owner == code] = code.name.lower()
    columns["finding"] = (np.where(owner > 0, owner, np.nan), "id of the finding that it belongs to")
    columns["fate"] = (fate, "why it belongs to none")
    _write(columns, path)


def _scattered(values: NDArray[Any], rows: NDArray[Any], n: int) -> NDArray[np.float64]:
    """Values in some rows of n, NaN in the others."""
    whole = np.full(n, np.nan)
    whole[rows] = values
    return whole


def _write(columns: dict[str, tuple[NDArray[Any], str]], path: Path) -> None:
    """NaN and empty text become null."""
    arrays: list[pa.Array] = []
    fields: list[pa.Field] = []
    for name, (values, description) in columns.items():
        is_text = values.dtype.kind == "U"
        mask = values == "" if is_text else ~np.isfinite(values) if values.dtype.kind == "f" else None
        array = pa.array(values.tolist() if is_text else values, mask=mask)
        if name == "finding":
            array = array.cast(pa.int64())
        arrays.append(array)
        fields.append(pa.field(name, array.type, metadata={"description": description}))
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path)
