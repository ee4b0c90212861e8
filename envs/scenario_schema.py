"""The JSON Schema of scenario files, by which editors complete and check them."""

from __future__ import annotations

import json
from typing import Any

from pdpatrol.envs.scenario import Scenario


def scenario_schema() -> dict[str, Any]:
    """JSON Schema of a scenario file, draft 2020-12.

    It knows every table, key, type and bound. What only several keys together can get wrong, or another file, the
    loader says: `pdpatrol scenarios FILE`.
    """
    schema = Scenario.model_json_schema()
    schema["required"].remove("name")  # that of the file, where it is left out
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text() -> str:
    """The text of docs/schemas/scenario.schema.json."""
    return json.dumps(scenario_schema(), indent=2) + "\n"
