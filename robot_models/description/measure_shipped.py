"""Measure the shipped robots anew, after a change of their files.

uv run python -m pdpatrol.robot_models.description.measure_shipped
"""

from pdpatrol.robot_models.description.library import SHIPPED, write_record, xml_path
from pdpatrol.robot_models.description.robot_file import read_robot

if __name__ == "__main__":
    for name in SHIPPED:
        write_record(read_robot(xml_path(name)))
