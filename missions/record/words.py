"""Probabilities and counts in words."""


def percent(probability: float) -> str:
    """Format a probability, such as `82 %`, `> 99 %` or `< 1 %`."""
    if probability > 0.99:
        return "> 99 %"
    return "< 1 %" if probability < 0.01 else f"{100 * probability:.0f} %"


def counted(n: int, noun: str) -> str:
    """Return a number with its noun: `1 pulse`, `2 pulses`."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def name_of(state: str, number: int) -> str:
    """Return the displayed name of a finding, a candidate or a source beyond the fence."""
    name = {"confirmed": "finding", "outside": "source"}.get(state, state)
    return f"{name} {number}"
