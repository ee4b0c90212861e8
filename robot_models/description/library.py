"""Robots by name or file."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache
from pathlib import Path

from pdpatrol.robot_models.description.robot_description import RobotDescription, RobotFileError, Wheel

_FOLDER = Path(__file__).parents[1]
SHIPPED = ("crawler", "inspector")
"""Names of the robots that come with the package."""


def load_robot(model: str | Path) -> RobotDescription:
    """The description of a robot.

    Args:
        model: Name of a shipped robot, or path of an MJCF file, which is then read and measured.

    Raises:
        RobotFileError: If there is no such robot, or the file does not describe one; all faults are listed.
    """
    if is_path(model):
        from pdpatrol.robot_models.description.robot_file import read_robot  # here, for a shipped robot needs no MuJoCo

        return read_robot(Path(model))
    if str(model) not in SHIPPED:
        known = ", ".join(SHIPPED)
        raise RobotFileError([f"{model}: no such robot; known are {known}, or give a path of an MJCF file, in .xml"])
    return _shipped(str(model))


def is_path(model: str | Path) -> bool:
    """Whether a robot is meant by its file rather than its name."""
    return Path(model).suffix == ".xml" or len(Path(model).parts) > 1


def xml_path(name: str) -> Path:
    """The MJCF file of a shipped robot."""
    return _FOLDER / name / f"{name}.xml"


def write_record(robot: RobotDescription) -> None:
    """Keep what was measured of a robot beside its file, so that it can be had without MuJoCo."""
    record = {key: value for key, value in asdict(robot).items() if key not in ("name", "xml_path")}
    record["wheels"] = [wheel._asdict() for wheel in robot.wheels]
    text = json.dumps(record, indent=2) + "\n"
    robot.xml_path.with_suffix(".json").write_text(text, encoding="utf-8")


@cache
def _shipped(name: str) -> RobotDescription:
    path = xml_path(name)
    record = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    record["wheels"] = tuple(Wheel(**wheel) for wheel in record["wheels"])
    record["home_qpos"] = tuple(record["home_qpos"])
    return RobotDescription(name=name, xml_path=path, **record)
