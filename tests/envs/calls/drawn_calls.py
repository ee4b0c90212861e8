"""Calls of an environment, right and wrong ones, each with what it means."""

from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as of_numpy

N_ROBOTS = 3


def listed(told: Any) -> Any:  # noqa: ANN401
    """What an environment tells, with arrays of objects as lists: so it can be compared."""
    if isinstance(told, dict):
        return {key: listed(value) for key, value in told.items()}
    if isinstance(told, tuple) or (isinstance(told, np.ndarray) and told.dtype == np.object_):
        return [listed(each) for each in told]
    return told


class Argument(NamedTuple):
    """What is handed over, and what it means: None where it is to be refused."""

    given: Any
    meaning: Any


class Meaning(NamedTuple):
    """The plain form of an argument, as the twin is handed it."""

    value: Any


def good(value: Any, meaning: Any) -> Argument:  # noqa: ANN401
    return Argument(value, Meaning(meaning))


def refused(*values: Any) -> st.SearchStrategy[Argument]:  # noqa: ANN401
    return st.sampled_from([Argument(value, None) for value in values])


def good_actions(shape: tuple[int, ...]) -> st.SearchStrategy[Argument]:
    reals = st.sampled_from([np.float16, np.float32, np.float64, np.dtype(">f4")]).flatmap(
        lambda dtype: of_numpy.arrays(dtype, shape, elements=st.floats(-3, 3, width=16))
    )
    huge = of_numpy.arrays(np.float64, shape, elements=st.sampled_from([1e308, -1e308, 0.5, -0.0]))
    whole = st.sampled_from([np.uint8, np.int64]).flatmap(
        lambda dtype: of_numpy.arrays(dtype, shape, elements=st.integers(0, 3))
    )
    arrays = st.one_of(reals, huge, whole)
    ways = st.sampled_from([np.asarray, np.asfortranarray, np.ndarray.tolist, frozen, strided])
    return st.builds(
        lambda array, way: good(way(array), np.clip(array.astype(np.float64), -1.0, 1.0).copy()), arrays, ways
    )


def frozen(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


def strided(array: np.ndarray) -> np.ndarray:
    return np.repeat(array, 2, axis=-1)[..., ::2]


def bad_actions(shape: tuple[int, ...]) -> st.SearchStrategy[Argument]:
    near = st.sampled_from([(2,), (1, 2), (2, 2), (4, 2), (64, 2), (6,), (3,), (2, 3), (3, 3), (1, 3, 2), ()])
    far = of_numpy.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=64)
    shapes = (near | far).filter(lambda other: other != shape)
    misshapen = shapes.map(lambda other: Argument(np.ones(other, dtype=np.float32), None))
    kinds = st.sampled_from([np.bool_, np.complex64, np.dtype("U3"), np.dtype("M8[s]"), np.object_, np.void])
    untyped = kinds.map(lambda kind: Argument(np.zeros(shape, dtype=kind), None))

    def broken(value: float, at: int) -> Argument:
        array = np.zeros(shape, dtype=np.float32)
        array.flat[at] = value
        return Argument(array, None)

    not_finite = st.builds(broken, st.sampled_from([np.nan, np.inf, -np.inf]), st.integers(0, int(np.prod(shape)) - 1))
    others = refused(None, "ahead", 1.0, {}, {"speed": 1.0}, [[0.0, 0.0], [0.0]], [], b"ab", object())
    return st.one_of(misshapen, untyped, not_finite, others)


WHOLE = st.integers(0, 2**40)
BAD_SEEDS = refused(-1, np.int64(-7), 1.0, np.float64(2.0), "x", b"5", np.bool_(True), {}, {5}, object(), 1j)


def one_seed() -> st.SearchStrategy[Argument]:
    ways = st.sampled_from([int, np.int64, np.uint64, np.array])
    return st.one_of(st.just(good(None, None)), st.builds(lambda seed, way: good(way(seed), seed), WHOLE, ways))


def row_seeds() -> st.SearchStrategy[Argument]:
    first = one_seed().map(lambda seed: good(seed.given, rows_from(seed.meaning.value)))
    each = st.lists(one_seed(), min_size=N_ROBOTS, max_size=N_ROBOTS)
    lists = st.builds(
        lambda seeds, way: good(way(seed.given for seed in seeds), [seed.meaning.value for seed in seeds]),
        each,
        st.sampled_from([list, tuple]),
    )
    arrays = of_numpy.arrays(np.int64, N_ROBOTS, elements=WHOLE).map(lambda array: good(array, array.tolist()))
    return st.one_of(first, lists, arrays)


def rows_from(seed: int | None) -> list[int | None]:
    return [None if seed is None else seed + row for row in range(N_ROBOTS)]


BAD_ROW_SEEDS = BAD_SEEDS | refused(
    [1, 2], (1, 2, 3, 4), [], [1, 2, -3], [1, 2.0, 3], "abc", np.ones(3), np.eye(3, dtype=int)
)

POSE, PLACE = (8.0, 6.0, 0.5), (20.0, 6.0, 1.5)
GOOD_OPTIONS = st.sampled_from(
    [
        good(None, {}),
        good({}, {}),
        good({"start_pose": POSE}, {"start_pose": POSE}),
        good({"start_pose": np.array(POSE, np.float32)}, {"start_pose": POSE}),
        good({"sources": {"discharge": list(PLACE)}}, {"sources": {"discharge": PLACE}}),
        good({"start_pose": None, "sources": None}, {}),
    ]
)
BAD_OPTIONS = refused(
    5, "x", [], ["start_pose"], {"pose": POSE}, {5: 5}, {"start_pose": "here"}, {"start_pose": (8.0, 6.0)},
    {"start_pose": (8.0, 6.0, np.nan)}, {"start_pose": (1e300, 6.0, 0.0)}, {"start_pose": (8.0, [6.0], 0.0)},
    {"start_pose": (-3.0, 1.0, 0.0)}, {"sources": 5}, {"sources": ["discharge"]},
    {"sources": {"other": PLACE}}, {"sources": {"discharge": None}}, {"sources": {"discharge": "nowhere"}},
    {"sources": {"discharge": (20.0, 6.0, -1.0)}}, {"sources": {"discharge": (np.inf, 6.0, 1.0)}},
    {"sources": {"discharge": (20.0, 6.0, 1e300)}},
)  # fmt: skip
MASK = "reset_mask"
BAD_MASKS = refused(
    None, 1, "all", [1, 0, 1], np.ones(N_ROBOTS), np.ones(2, np.bool_), np.ones((N_ROBOTS, 1), np.bool_), [],
    [[True], []], np.zeros(N_ROBOTS, np.bool_), [True, None, False],
).map(lambda mask: Argument({MASK: mask.given}, None))  # fmt: skip


def masked_options() -> st.SearchStrategy[Argument]:
    masks = of_numpy.arrays(np.bool_, N_ROBOTS).filter(np.any)
    ways = st.sampled_from([np.asarray, np.ndarray.tolist])
    return st.builds(
        lambda options, mask, way: good(
            (options.given or {}) | {MASK: way(mask)}, options.meaning.value | {MASK: mask}
        ),
        GOOD_OPTIONS,
        masks,
        ways,
    )


class Call(NamedTuple):
    """A call of a method, or of `np_random_seed`."""

    name: str
    arguments: tuple[Argument, ...] = ()

    @property
    def is_good(self) -> bool:
        return all(argument.meaning is not None for argument in self.arguments)

    @property
    def given(self) -> tuple[Any, ...]:
        return tuple(argument.given for argument in self.arguments)

    @property
    def meaning(self) -> tuple[Any, ...]:
        return tuple(argument.meaning.value for argument in self.arguments)


def calls(shape: tuple[int, ...]) -> st.SearchStrategy[Call]:
    is_single = len(shape) == 1
    seeds, bad_seeds = (one_seed(), BAD_SEEDS) if is_single else (row_seeds(), BAD_ROW_SEEDS)
    options = GOOD_OPTIONS if is_single else GOOD_OPTIONS | masked_options()
    bad_options = BAD_OPTIONS if is_single else BAD_OPTIONS | BAD_MASKS
    steps, resets = good_actions(shape), st.tuples(seeds, options)
    bad_resets = st.tuples(bad_seeds, options) | st.tuples(seeds, bad_options)
    return st.one_of(
        steps.map(lambda action: Call("step", (action,))),
        steps.map(lambda action: Call("step", (action,))),
        resets.map(lambda both: Call("reset", both)),
        bad_actions(shape).map(lambda action: Call("step", (action,))),
        bad_resets.map(lambda both: Call("reset", both)),
        st.integers(0, 9).map(lambda n: Call("close" if n == 0 else "np_random_seed")),
    )


def sequences(shape: tuple[int, ...]) -> st.SearchStrategy[list[Call]]:
    """Most begin with a reset, as they should."""
    begun = st.just([Call("reset", (good(7, 7 if len(shape) == 1 else rows_from(7)), good(None, {})))])
    return st.builds(lambda first, then: first + then, begun | begun | st.just([]), st.lists(calls(shape), max_size=12))
