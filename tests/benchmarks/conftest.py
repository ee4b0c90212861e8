"""Conditions of all benchmarks."""

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread."""
    with threadpool_limits(limits=1):
        yield
