"""The antenna elements on a robot."""
