"""The variants that are compared: each is one scenario with a few keys set otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from envs import Scenario


class Variant(NamedTuple):
    """A scenario with some keys set.

    Attributes:
        group: What is varied.
        name: How tables call it.
        keys: Tables of the scenario file with the keys that are set in them.
    """

    group: str
    name: str
    keys: Mapping[str, Mapping[str, Any]]

    @property
    def key(self) -> str:
        """Tells it apart from all others."""
        return f"{self.group}: {self.name}"

    def of(self, scenario: Scenario) -> Scenario:
        """The scenario with the keys set, checked as a file would be.

        Raises:
            ValidationError: If the scenario does not allow it.
        """
        data = scenario.model_dump()
        for table, keys in self.keys.items():
            data[table] |= keys
        return Scenario.model_validate(data)


VARIANTS = (
    *(Variant("elements", f"{n} elements", {"array": {"n_elements": n}}) for n in (4, 6, 8, 12)),
    *(
        Variant(f"estimator, {how}", method, {"estimator": {"method": method}, "locating": {"fix": fix}})
        for fix, how in (("bearings", "fix from its bearings alone"), ("joint", "joint fix"))
        for method in ("strongest", "music", "maximum_likelihood")
    ),
    *(Variant("robot", model, {"robot": {"model": model}}) for model in ("inspector", "crawler")),
)
"""Within a group what physics calls better comes later; six elements, maximum likelihood with the joint fix, and the
inspector are the same scenario."""
