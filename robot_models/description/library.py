"""Robots by name or file."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from robot_models.description.robot_description import RobotDescription, RobotFileError

_FOLDER = Path(__file__).parents[1]
SHIPPED = ("crawler", "inspector")
"""Names of the robots that come with the package."""


def load_robot(model: str | Path) -> RobotDescription:
    """The description of a robot.

    Args:
        model: Name of a shipped robot, which is read but once, or path of an MJCF file.

    Raises:
        RobotFileError: If there is no such robot, or the file does not describe one; all faults are listed.
    """
    if is_path(model):
        return _read(Path(model))
    if str(model) not in SHIPPED:
        known = ", ".join(SHIPPED)
        raise RobotFileError([f"{model}: no such robot; known are {known}, or give a path of an MJCF file, in .xml"])
    return _read_shipped(str(model))


def is_path(model: str | Path) -> bool:
    """Whether a robot is meant by its file rather than its name."""
    return Path(model).suffix == ".xml" or len(Path(model).parts) > 1


@cache
def _read_shipped(name: str) -> RobotDescription:
    return _read(_FOLDER / name / f"{name}.xml")


def _read(path: Path) -> RobotDescription:
    from robot_models.description.robot_file import read_robot  # here, for MuJoCo is not needed before a robot is

    return read_robot(path)
