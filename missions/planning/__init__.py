"""Where each site of a yard is heard from, few stops that hear all of them, and a short tour past these."""

from pdpatrol.missions.planning.planned_route import with_planned_route

__all__ = ["with_planned_route"]
