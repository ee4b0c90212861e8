"""A call costs the same at any depth: no piece of the call stack is taken for it and given back."""

import resource

from pdpatrol.missions.deep_calls import call_with_room

N_CALLS, DEEPEST = 500, 300


def _large() -> None:
    """Its frame is larger than that of `_faults`, so that no border is stepped over."""


_large.__code__ = _large.__code__.replace(co_stacksize=100)


def _faults(depth: int) -> int:
    """Pages that the system hands out for calls at a depth."""
    if depth > 0:
        return _faults(depth - 1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(N_CALLS):
        _large()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


def test_calls_cost_no_pages_at_any_depth() -> None:
    most: list[int] = []

    def look() -> None:
        most.append(max(_faults(depth) for depth in range(DEEPEST)))

    call_with_room(look)
    look()
    with_room, without = most
    assert with_room < N_CALLS // 10
    assert without >= N_CALLS  # if not, Python's call stack has changed, and `call_with_room` can go
