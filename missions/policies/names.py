"""Names that the command line offers. Kept apart so that its help need not load the simulator."""

from __future__ import annotations

from typing import Literal

PolicyName = Literal["seek", "patrol", "random", "oracle"]
