"""Missions: policies, the mission loop, logs, reports, recordings, exports, sweeps and the command line."""

__all__: list[str] = []
