"""Asset, severity, action and due date of a finding."""

from collections.abc import Mapping
from datetime import date, timedelta

from pdpatrol.envs.scenario.severity import SeverityTable
from pdpatrol.missions.report.records import Assessment, Asset, DischargeKind, Strength
from pdpatrol.robot_models.yard.yard import Yard


def asset_at(yard: Yard, places: Mapping[str, float]) -> Asset | None:
    """Return the piece of equipment of the most probable place.

    Args:
        yard: Yard as the map shows it.
        places: Probability of each place by name, as from `site_probabilities`; may be empty.

    Returns:
        The piece; None if no place is known or the most probable one is on no piece.
    """
    name = max(places, key=lambda place: places[place], default="").partition("/")[0]
    item = next((item for item in yard.equipment if item.name == name), None)
    return item and Asset(name=item.name, kind=item.kind, asset_id=item.asset_id, kv=item.kv, phase=item.phase)


def assess(
    table: SeverityTable, day: str | None, discharge: DischargeKind | None, strength: Strength | None
) -> Assessment:
    """Return severity and action of a finding by the table of the survey.

    Args:
        table: The rule.
        day: Date of the survey; None if it has no date.
        discharge: Kind of the finding; None if the phase of the mains is not known.
        strength: Its strength; None if it is not known.
    """
    kind = discharge.kind if discharge and discharge.confidence >= table.least_confidence else "unknown"
    row = getattr(table.kinds, kind)
    is_strong = strength is not None and strength.level_db is not None and strength.level_db >= table.strong_dbv
    severity = row.class_strong if is_strong else row.class_weak
    days = table.classes[severity]
    known = f"{kind}, of a confidence of at least {100 * table.least_confidence:.0f} %"
    level = f"{'at or above' if is_strong else 'below'} {table.strong_dbv:g} dBV at 1 m"
    return Assessment(
        severity=severity,
        within_days=days,
        due=None if day is None else str(date.fromisoformat(day) + timedelta(days=days)),
        meaning=row.meaning,
        action=row.action,
        rule=f"{table.title}: kind {'uncertain' if kind == 'unknown' else known}; level {level}",
    )
