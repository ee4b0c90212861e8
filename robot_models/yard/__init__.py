"""Yards as data: fence, equipment and their geometry."""
