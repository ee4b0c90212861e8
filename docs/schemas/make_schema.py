"""Make report.schema.json of the records of report.json, and scenario.schema.json of the models of scenario files.

uv run python docs/schemas/make_schema.py
"""

from pathlib import Path

from pdpatrol.envs import scenario_schema
from pdpatrol.missions.report import report_file

FOLDER = Path(__file__).parent
TEXTS = {
    "report.schema.json": report_file.schema_text,
    "scenario.schema.json": scenario_schema.schema_text,
}

if __name__ == "__main__":
    for name, text in TEXTS.items():
        (FOLDER / name).write_text(text(), encoding="utf-8")
