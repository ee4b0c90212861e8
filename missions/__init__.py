"""Who drives, and what is left afterwards: policies, runner, log, report, recording, command line."""

__all__: list[str] = []
