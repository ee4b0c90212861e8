"""A learned baseline: PPO finds its way to the source in an open yard, from bearings and lidar.

`uv run --extra rl python -m missions.learning` trains it, and puts it beside the hand-written policies.
"""

__all__: list[str] = []
