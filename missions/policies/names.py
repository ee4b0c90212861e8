"""Names of policies, apart from the policies: the command line checks a name without loading the simulator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pdpatrol.envs.user_code import UserCodeError, load_object

BUILT_IN = ("seek", "active", "patrol", "random", "oracle")

MAKER = "a class or function that makes a policy of a random generator: MyPolicy(rng)"


def load_maker(name: str) -> Callable[[np.random.Generator], Any]:
    """The class or function that makes a policy of one's own.

    Args:
        name: `my_file.py:MyPolicy`, relative to the current folder, or `package.module:MyPolicy`.

    Raises:
        UserCodeError: If there is none of that name, or loading it raises an exception.
    """
    if ":" not in name:
        known = ", ".join(BUILT_IN)
        raise UserCodeError(f"{name}: no such policy; expected {known}, or my_file.py:MyPolicy for your own")
    maker = load_object(name, Path(), MAKER)
    if not callable(maker):
        raise UserCodeError(f"{name}: is of type {type(maker).__name__}; expected {MAKER}")
    return maker
