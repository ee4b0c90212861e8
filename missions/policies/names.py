"""Names of the built-in policies. Kept apart so that the command line need not load the simulator to check one."""

from __future__ import annotations

BUILT_IN = ("seek", "patrol", "random", "oracle")
