"""Policies by name."""

from __future__ import annotations

import numpy as np

from pdpatrol.missions.policies.collision_guard import CollisionGuard
from pdpatrol.missions.policies.own_policy import OwnPolicy, load_maker
from pdpatrol.missions.policies.patrol import Patrol
from pdpatrol.missions.policies.protocol import ReportingPolicy
from pdpatrol.missions.policies.references import Oracle, Random
from pdpatrol.missions.policies.seek import Active, Seek


def make_policy(name: str, rng: np.random.Generator) -> ReportingPolicy:
    """Make a new policy.

    Args:
        name: Name of a built-in policy, or `my_file.py:MyPolicy`, relative to the current folder, or
            `package.module:MyPolicy`.
        rng: Generator for policies that draw.

    Raises:
        UserCodeError: If it is not built in and cannot be loaded or made.
    """
    match name:
        case "seek":
            return CollisionGuard(Seek())
        case "active":
            return CollisionGuard(Active())
        case "patrol":
            return CollisionGuard(Patrol())
        case "random":
            return Random(rng)
        case "oracle":
            return Oracle()
        case _:
            return OwnPolicy(load_maker(name), rng)
