"""Robots for the tests of this folder."""

from pathlib import Path

import pytest

from pdpatrol.robot_models.description.robot_description import SHIPPED, xml_path
from tests.robot_models.one_robot import Edited, OneRobot


@pytest.fixture
def inspector() -> OneRobot:
    return OneRobot("inspector")


@pytest.fixture
def crawler() -> OneRobot:
    return OneRobot("crawler")


@pytest.fixture(params=SHIPPED)
def shipped(request: pytest.FixtureRequest) -> OneRobot:
    """Return each robot that comes with the package, in turn."""
    return OneRobot(request.param)


@pytest.fixture
def edited(tmp_path: Path) -> Edited:
    """Write a user's robot: the file of the crawler with some text replaced."""

    def write(*changes: tuple[str, str]) -> Path:
        text = xml_path("crawler").read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "robot.xml"
        path.write_text(text, encoding="utf-8")
        return path

    return write
