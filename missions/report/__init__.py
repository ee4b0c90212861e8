"""Reports of missions: records, report.json, report.html and tables for the terminal."""
