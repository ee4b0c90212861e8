"""Colours of a recording, red, green and blue up to 255, on a dark ground in both of Rerun's themes."""

Colour = tuple[int, int, int]

STATES: dict[str, Colour] = {
    "candidate": (255, 178, 40),
    "confirmed": (60, 220, 110),
    "outside": (150, 150, 160),
    "ghost": (170, 120, 120),
}
"""Of findings."""

SKY: Colour = (24, 28, 34)
GROUND: Colour = (64, 70, 72)
LIKELY: Colour = (235, 140, 60)
NEW_BEARING: Colour = (255, 232, 110)
PAST_BEARING: Colour = (120, 110, 58)
REJECTED: Colour = (125, 128, 135)
SPECTRUM: Colour = (90, 220, 255)
TRAJECTORY: Colour = (120, 190, 255)
ODOMETRY: Colour = (110, 130, 115)
TRUTH: Colour = (255, 70, 200)
ROUTE: Colour = (150, 158, 168)
STOP: Colour = (255, 255, 255)
ROBOT: Colour = (235, 235, 240)
MARKER: Colour = (40, 150, 255)
SITE: Colour = (200, 150, 90)
NAME: Colour = (255, 255, 255)
"""Of all words: a viewer writes them on grey, lighter in its light theme."""

HEADING: Colour = (40, 150, 255)

ELEMENTS: tuple[Colour, ...] = (
    (230, 90, 80),
    (240, 170, 60),
    (225, 225, 90),
    (90, 200, 110),
    (90, 160, 240),
    (190, 110, 230),
)

FINDINGS: tuple[Colour, ...] = ((255, 178, 40), (90, 200, 255), (60, 220, 110), (230, 110, 220), (240, 230, 110))
"""Of findings beside each other, in order of their ids, where the colour does not tell the state."""

PHASES: dict[str, Colour] = {
    "patrol": (70, 110, 160),
    "listen": (170, 150, 60),
    "seek": (200, 110, 30),
    "back off": (190, 60, 60),
    "return to dock": (80, 90, 100),
}
"""Colours of what the policy does, by the name of its phase."""

OTHER_PHASE: Colour = (110, 80, 150)

HEAT: tuple[Colour, ...] = (SKY, (88, 38, 92), (200, 70, 60), (250, 170, 60), (255, 250, 190))
"""Of pseudo-spectra over time, from nothing to the peak, in even steps."""
