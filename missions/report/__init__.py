"""What a mission is reported as: typed records, report.json, and report.html for the operator's files."""
