"""Yards as plain data: fence, equipment and their geometry."""
