"""What to do about a finding: modest rules of thumb, each of them assumed."""

from __future__ import annotations

from typing import NamedTuple

from pdpatrol.missions.report.records import FindingRecord

SURE = 0.8
"""Confidence of a kind from which on its rule applies (assumed)."""

STRONG_DB = 0.0
"""Level from which on a finding is strong (assumed): one volt at 1 m in a channel of unit gain."""

WITHIN = ("at the next planned inspection", "within three months", "within one month", "within one week")
"""Steps of urgency (assumed)."""


class Rule(NamedTuple):
    """What a kind of discharge suggests.

    Attributes:
        meaning: What such a discharge usually is.
        action: What to do on site.
        urgency: Step of `WITHIN` for one that is not strong.
    """

    meaning: str
    action: str
    urgency: int


RULES = {
    "corona": Rule(
        "Corona in air starts at sharp edges and fittings without a shield; outdoors it is mostly harmless by itself.",
        "Look at the place with an ultraviolet camera, and for loose or missing shielding.",
        0,
    ),
    "surface": Rule(
        "Surface discharges come with pollution, moisture or cracks on an insulator, and grow in wet weather.",
        "Inspect the insulator surface, clean it if it is polluted, and repeat the measurement in dry and wet weather.",
        1,
    ),
    "void": Rule(
        "Discharges in voids lie inside solid or liquid insulation and can wear it out unseen.",
        "Confirm by a second method on the asset itself: IEC 60270, or dissolved gases where there is oil.",
        2,
    ),
    "floating": Rule(
        "Metal at floating potential is usually a loose or broken contact; its discharges are strong and regular.",
        "Check fasteners, shields and bonds at this place as soon as an outage allows, and measure again until then.",
        2,
    ),
}
"""Assumed; of the kinds of `dirmusic.pulses.phase_resolved`."""

UNSURE = Rule(
    "The kind of discharge is not certain enough to judge by.",
    "Repeat the measurement near this place, longer, and look at it with an ultraviolet camera.",
    1,
)

LIMITS = (
    "Levels are received field strengths, not apparent charge: no standard sets limits for them. The rules above are "
    "assumed and replace neither the maker's advice nor the judgement of an insulation engineer."
)


class Advice(NamedTuple):
    """What is suggested for one finding.

    Attributes:
        meaning: What such a discharge usually is.
        action: What to do.
        within: By when.
        reason: Which rule says so.
    """

    meaning: str
    action: str
    within: str
    reason: str


def advice_for(finding: FindingRecord) -> Advice:
    """What to do about a finding, by kind, confidence and level."""
    discharge, strength = finding.discharge, finding.strength
    is_sure = discharge is not None and discharge.kind in RULES and discharge.confidence >= SURE
    rule = RULES[discharge.kind] if discharge is not None and is_sure else UNSURE
    is_strong = strength is not None and strength.level_db >= STRONG_DB
    when = WITHIN[min(rule.urgency + is_strong, len(WITHIN) - 1)]
    kind = f"{discharge.kind} with a confidence of at least {100 * SURE:.0f} %" if discharge and is_sure else "unsure"
    level = "at or above" if is_strong else "below"
    reason = f"Rule (assumed): kind {kind}; level {level} {STRONG_DB:g} dBV at 1 m."
    return Advice(rule.meaning, rule.action, when, reason)
