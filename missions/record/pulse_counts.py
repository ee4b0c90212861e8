"""What became of the pulses of a mission: those of findings, and why others are of none."""

from __future__ import annotations

from dirmusic.locating.association.assignment import NoOwner
from missions.record.mission_log import MissionLog

WORDS = {
    "not_credible": "no plane wave, or too weak to tell a direction",
    "of_findings": "of what is not confirmed",
    "unassigned": "from nowhere in particular",
    "ambiguous": "from where several may be",
    "biased": "biased by reflections",
    "diffracted": "round an edge",
    "echo": "echoes",
}
"""Every fate of a pulse, and how it is told where nothing was found."""


def pulse_counts(log: MissionLog) -> dict[str, int]:
    """How many pulses were detected, and what became of how many; nothing but the first two in a mission cut short.

    Returns:
        `detected`, then the keys of `WORDS`, which add up to it.
    """
    owner = log.column("association", "finding")
    n_detected = log.n_rows("pulse")
    counts = {"detected": n_detected, "not_credible": n_detected - int(log.column("pulse", "is_credible").sum())}
    if owner.size == 0:
        return counts
    by_reason = {code.name.lower(): int((owner == code).sum()) for code in NoOwner}
    return {**counts, "of_findings": int((owner > 0).sum()), **by_reason}


def in_words(counts: dict[str, int]) -> str:
    """What became of the pulses though nothing was found, the most first: one line for a terminal."""
    if not counts["detected"]:
        return "No discharge found: no pulse was detected."
    if counts["not_credible"] == counts["detected"]:
        return f"No discharge found. {counts['detected']} pulses: all rejected, as {WORDS['not_credible']}."
    fates = sorted((number, WORDS[fate]) for fate, number in counts.items() if fate in WORDS and number)
    told = ", ".join(f"{number} {words}" for number, words in reversed(fates))
    return f"No discharge found. {counts['detected']} pulses: {told}."
