"""Colours of a recording.

The yard is bright in both themes of the viewer, because the theme sets the boxes of labels, half transparent, but not
the text in them: dark text reads on both. All other colours have a medium lightness, and read on black and white plots.
"""

from typing import NamedTuple


class Palette(NamedTuple):
    """Colours as 0xRRGGBBAA.

    Attributes:
        sky: Background of the views of the yard.
        ground: Ground, where a source is unlikely.
        likely: Ground where a source is likely.
        paper: Background of the phase-resolved pattern.
        label: Text of labels.
        line: Axes and the sine of the mains.
        route: Planned route and its waypoints.
        site: Places where a discharge can occur.
        bearing: Bearings of pulses.
        spectrum: Pseudo-spectrum of the strongest pulse.
        robot: Path, arrow and heading of the robot.
        odometry: Path that the wheels alone would give.
        zone: Zones with a speed limit.
        truth: Sources, interferers and moving bodies, which the robot does not know.
        findings: Colours of candidates and findings, in turn by number.
    """

    sky: int = 0xD6E2ECFF
    ground: int = 0xC4C8C2FF
    likely: int = 0xF08A24FF
    paper: int = 0xE9ECEEFF
    label: int = 0x0B1117FF
    line: int = 0x8A949EFF
    route: int = 0x5E6873FF
    site: int = 0x7A5A36FF
    bearing: int = 0xC28A00FF
    spectrum: int = 0x0093A8FF
    robot: int = 0x2478D0FF
    odometry: int = 0x6E8273FF
    zone: int = 0xB07400FF
    truth: int = 0xD81BA8FF
    findings: tuple[int, ...] = (0x1E9A50FF, 0xD6453AFF, 0x8A5CD6FF, 0x9A6A34FF, 0xD0508FFF, 0x00737FFF)

    def of_finding(self, number: int) -> int:
        """Return the colour of a candidate or finding, the same in every view."""
        return self.findings[(number - 1) % len(self.findings)]


PALETTE = Palette()

PHASES = {
    "patrol": ("route", 0x4A6FA5FF),
    "seek": ("candidate", 0xB5651DFF),
    "listen": ("stands", 0x7A5195FF),
    "return to dock": ("to dock", 0x55616BFF),
    "return to charge": ("to charge", 0x3E7D5AFF),
    "charge": ("charges", 0x2E6A48FF),
    "back off": ("backs off", 0xA33B3BFF),
    "give way": ("gives way", 0xA8487AFF),
    "random": ("random", 0x6A6A8AFF),
    "field": ("survey", 0x4A6FA5FF),
}
"""Short label, for bars of a few seconds, and colour of each phase of the built-in policies. The labels are white."""
