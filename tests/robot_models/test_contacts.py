"""Contacts of robots, and their report."""

import math

import pytest

from tests.robot_models.one_robot import OneRobot


def test_contact_is_reported_by_name_until_the_next_interval(shipped: OneRobot) -> None:
    front_m = {"inspector": 0.2, "crawler": 0.325}[shipped.robot.name]
    shipped.reset(18.3, 10.0, 0.0)
    shipped.drive_on(0.3, 0.0, 0.3)
    assert shipped.touched() == ()
    shipped.drive_on(0.8, 0.0, 1.5)
    assert shipped.touched() == ("equipment/tank",)
    assert shipped.pose()[0] == pytest.approx(19.0 - front_m, abs=0.01)
    shipped.drive_on(-0.8, 0.0, 1.0)
    assert shipped.touched() == ()


def test_flank_of_a_long_robot_touches(crawler: OneRobot) -> None:
    crawler.reset(18.75, 10.0, math.pi / 2)
    assert crawler.touched() == ()
    crawler.drive_on(0.0, 1.0, 1.0)
    assert crawler.touched() == ("equipment/tank",)


def test_simultaneous_contacts_are_sorted(shipped: OneRobot) -> None:
    shipped.reset(0.6, 0.6, 1.25 * math.pi)
    shipped.drive_on(0.8, 0.0, 2.0)
    assert shipped.touched() == ("fence/south", "fence/west")


def test_contact_within_an_interval_is_reported(inspector: OneRobot) -> None:
    inspector.reset(18.72, 10.0, 0.0)
    inspector.drive(0.8, 0.0, 0.2)
    assert inspector.touched() == ()  # still driving, 8 cm from the tank and too fast to stop
    speed = inspector.velocity()[0]
    inspector.drive(-0.8, 0.0, 1.0)
    assert speed > 0.5
    assert inspector.pose()[0] < 18.7
    assert inspector.touched() == ("equipment/tank",)


def test_reset_into_equipment_is_a_contact(shipped: OneRobot) -> None:
    shipped.reset(19.0, 10.0, 0.0)
    assert shipped.touched() == ("equipment/tank",)
