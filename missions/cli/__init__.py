"""`pdpatrol`: one file a verb."""

from missions.cli.app import main

__all__ = ["main"]
