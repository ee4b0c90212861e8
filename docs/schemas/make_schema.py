"""Make report.schema.json from the records that report.json is made of.

uv run python docs/schemas/make_schema.py
"""

from pathlib import Path

from missions.report.report_file import schema_text

SCHEMA_FILE = Path(__file__).parent / "report.schema.json"

if __name__ == "__main__":
    SCHEMA_FILE.write_text(schema_text(), encoding="utf-8")
