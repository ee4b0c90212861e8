"""What became of the pulses of a mission: those of findings, and why others are of none."""

from __future__ import annotations

from dirmusic.locating.association import Unassociated
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import PulseCounts

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


def pulse_counts(log: MissionLog) -> PulseCounts:
    """How many pulses were detected, and what became of how many; only the first two of a mission that was killed."""
    owner = log.column("association", "finding")
    n_detected = log.n_rows("pulse")
    n_rejected = n_detected - int(log.column("pulse", "is_credible").sum())
    is_known = owner.size > 0 or n_rejected == n_detected
    of = {code.name.lower(): int((owner == code).sum()) if is_known else None for code in Unassociated}
    of_findings = int((owner > 0).sum()) if is_known else None
    return PulseCounts(detected=n_detected, not_credible=n_rejected, of_findings=of_findings, **of)


def in_words(counts: PulseCounts) -> str:
    """What became of the pulses though nothing was found, the most first: one line for a terminal."""
    if not counts.detected:
        return "No discharge found: no pulse was detected."
    if counts.not_credible == counts.detected:
        return f"No discharge found. {counts.detected} pulses: all rejected, as {WORDS['not_credible']}."
    fates = sorted(((getattr(counts, fate) or 0, words) for fate, words in WORDS.items()), reverse=True)
    told = ", ".join(f"{number} {words}" for number, words in fates if number)
    return f"No discharge found. {counts.detected} pulses: {told}."
