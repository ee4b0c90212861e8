"""Write report.schema.json and scenario.schema.json from the models in the code.

uv run python docs/schemas/make_schema.py
"""

from pathlib import Path

from pdpatrol.envs.scenario import loader
from pdpatrol.missions.report import records

FOLDER = Path(__file__).parent
TEXTS = {
    "report.schema.json": records.schema_text,
    "scenario.schema.json": loader.schema_text,
}

if __name__ == "__main__":
    for name, text in TEXTS.items():
        (FOLDER / name).write_text(text(), encoding="utf-8")
