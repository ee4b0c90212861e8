"""Table of the kinds of equipment that names of blocks and layers of a drawing stand for."""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from pydantic import Field, ValidationError, field_validator

from dirmusic import InputFileError
from pdpatrol.envs.scenario.base import error_lines, read_toml
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE
from pdpatrol.robot_models.equipment.voltages import Kv
from pdpatrol.robot_models.yard.quantities import Height, Name, Yaw
from pdpatrol.sensing.quantities import Config

GROUND = "ground"
"""Kind of what is no obstacle, such as roads and auxiliary lines; it is left out without a note."""

DEFAULT = Path(__file__).with_name("names.toml")
"""Names in English that are known without a table."""


class NamedKind(Config):
    """Equipment that a name stands for."""

    kind: Name
    """Kind of the catalogue, `building`, `wall`, `ground`, or any other for boxes with a height."""
    kv: Kv | None = None
    """Nominal voltage, for kinds whose size depends on it."""
    height_m: Height | None = None
    yaw_deg: Yaw = 0.0
    """Direction of the x axis of the kind, relative to the x axis of the block."""


class NameMapping(Config):
    """Kinds by names, in lower case, in which `*` stands for any letters; the first match counts."""

    kv: Kv | None = None
    """Nominal voltage of all rows that have none."""
    names: Mapping[str, NamedKind] = Field(default_factory=dict)

    @field_validator("names")
    @classmethod
    def _kinds_are_known(cls, names: Mapping[str, NamedKind]) -> Mapping[str, NamedKind]:
        known = (*CATALOGUE, "wall", GROUND)
        errors = [
            f"{name}.kind: must be one of {', '.join(known)}, or have height_m; got `{row.kind}`"
            for name, row in names.items()
            if row.kind not in known and row.height_m is None
        ]
        if errors:
            raise ValueError("\n".join(errors))
        return names

    def row(self, name: str) -> NamedKind | None:
        """Return the row of a block or layer with its voltage, or None if its name is not known."""
        row = next((row for pattern, row in self.names.items() if fnmatchcase(name.lower(), pattern.lower())), None)
        shape = CATALOGUE.get(row.kind) if row is not None else None
        if row is None or row.kv is not None or shape is None or shape.build_for is None:
            return row
        return row.model_copy(update={"kv": self.kv})


def read_mapping(path: Path | None) -> NameMapping:
    """Read a table of names; those of `DEFAULT` follow its own.

    Raises:
        InputFileError: If the file cannot be read or has errors; all of them are listed.
    """
    default = NameMapping.model_validate(read_toml(DEFAULT))
    if path is None:
        return default
    try:
        given = NameMapping.model_validate(read_toml(path))
    except ValidationError as error:
        raise InputFileError([f"{path}: {line}" for line in error_lines(error, NameMapping)]) from None
    rest = {name: row for name, row in default.names.items() if name not in given.names}
    return NameMapping(kv=given.kv, names={**given.names, **rest})
