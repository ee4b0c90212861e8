"""Files of MATLAB, through scipy.io and, from version 7.3 on, h5py; and HDF5 files with the same names."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, whosmat

from pdpatrol.missions.field.instruments.record import MAX_BYTES, WaveformRecord

INTERVALS = {"tinterval", "xinc", "xincrement", "dt", "ts", "tinc", "sampleinterval"}
"""Names of the sampling interval in seconds, in lower case; PicoScope writes Tinterval."""

RATES = {"sample_rate_hz", "samplerate", "sample_rate", "fs", "rate_hz"}
"""Names of the sampling rate in hertz."""

TIMES = re.compile(r"(?i)(time|t)(s|_s)?")
"""Names of a vector of times in seconds."""

OTHER_TIMES = re.compile(r"(?i)(time|t)_?(ms|us|ns|ps)")
"""Names of vectors of times in other units, which are not channels."""

SAME_RATE = 0.01
"""Relative difference up to which rate, interval and times agree (assumed): some are rounded."""


def read_matlab(path: Path) -> WaveformRecord:
    """Read a file of MATLAB up to version 7.2; names as in `record_of_arrays`.

    Raises:
        ValueError: If the file is damaged, or has no waveforms.
    """
    try:
        contents = whosmat(path)
        if sum(8 * math.prod(shape) for _, shape, _ in contents) > MAX_BYTES:  # known before they are decompressed
            raise ValueError(f"arrays must be smaller than {MAX_BYTES / 1e6:g} MB together")
        kinds = {name: kind for name, _, kind in contents}
        arrays = {name: array for name, array in loadmat(path).items() if isinstance(array, np.ndarray)}
        for name, array in arrays.items():  # whole numbers of the class `double` are stored as integers
            if array.dtype.kind in "iu" and kinds.get(name) in ("double", "single"):
                arrays[name] = array.astype(np.float64)
    except Exception as error:  # damaged bytes raise errors of many types
        raise ValueError(f"must be a MATLAB file ({' '.join(str(error).split()):.100})") from None
    return record_of_arrays(arrays)


def read_hdf5(path: Path, *, is_matlab: bool) -> WaveformRecord:
    """Read a file of MATLAB 7.3, whose arrays have their axes in reverse order, or another HDF5 file.

    Raises:
        ValueError: If the file is damaged, or has no waveforms.
        ModuleNotFoundError: If h5py is not installed.
    """
    import h5py  # in the extra `instruments`

    arrays, repeated = dict[str, NDArray[Any]](), list[str]()

    def add(path: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iufc":
            if item.nbytes + sum(array.nbytes for array in arrays.values()) > MAX_BYTES:
                raise ValueError(f"datasets must be smaller than {MAX_BYTES / 1e6:g} MB together")
            array, name = np.asarray(item), path.rpartition("/")[2]
            if name in arrays:
                repeated.append(name)
            arrays[name] = array.T if is_matlab else array

    try:
        with h5py.File(path) as file:
            file.visititems(add)
        arrays = {name: arrays[name] for name in sorted(arrays, key=_natural)}
    except Exception as error:  # damaged bytes raise errors of many types
        raise ValueError(f"must be an HDF5 file ({' '.join(str(error).split()):.100})") from None
    if repeated:
        raise ValueError(f"must have one dataset of each name, in all groups together; got several {repeated[0]}")
    return record_of_arrays(arrays)


def record_of_arrays(arrays: dict[str, NDArray[Any]]) -> WaveformRecord:
    """Make a record of named arrays.

    They hold a sampling interval, a rate or a vector of times, and either `waveforms` as in `WaveformRecord.of` with
    `volts_per_count` for counts, or one vector for each channel, as PicoScope writes them.

    Raises:
        ValueError: If waveform or rate is missing, or contents are ambiguous.
    """
    numbers = {name: array for name, array in arrays.items() if array.size and array.dtype.kind in "iufc"}
    named = {name.lower(): array for name, array in numbers.items()}
    rate_hz = _rate_hz(numbers)
    if rate_hz is None:
        raise ValueError(f"must have a rate or interval, such as sample_rate_hz or Tinterval; got {_listed(arrays)}")
    scale = named.get("volts_per_count", np.ones(1)).ravel().astype(np.float64)
    scale = scale if scale.size > 1 else scale[0]
    if "waveforms" in named:
        channels, samples = (), named["waveforms"]
    else:
        vectors = {
            name: array.ravel()
            for name, array in numbers.items()
            if array.size > 1
            and array.size == max(array.shape)
            and not TIMES.fullmatch(name)
            and name.lower() != "volts_per_count"
        }
        vectors = {name: vector for name, vector in vectors.items() if not OTHER_TIMES.fullmatch(name)}
        if not vectors:
            raise ValueError(f"must have waveforms, or one vector for each channel; got {_listed(arrays)}")
        if len({vector.size for vector in vectors.values()}) > 1:
            sizes = ", ".join(f"{name} of {vector.size}" for name, vector in vectors.items())
            raise ValueError(f"all vectors of samples must have one length, got {sizes:.150}")
        channels, samples = tuple(vectors), np.array(list(vectors.values()))
    if samples.dtype.kind == "c":
        raise ValueError("samples must be real numbers, got complex ones")
    if samples.dtype.kind in "iu" and "volts_per_count" not in named:
        raise ValueError("samples that are whole numbers need volts_per_count")
    return WaveformRecord.of(samples, rate_hz, channels, scale)


def _rate_hz(numbers: dict[str, NDArray[Any]]) -> float | None:
    """Return the sampling rate by a rate, an interval or times; None without any.

    Raises:
        ValueError: If they differ, or times do not rise in even steps.
    """
    found = dict[str, float]()
    for name, array in numbers.items():
        first = float(np.real(array.flat[0]))
        if name.lower() in INTERVALS and first > 0:
            found[name] = 1.0 / first
        elif name.lower() in RATES:
            found[name] = first
        elif TIMES.fullmatch(name) and array.size > 1:
            times_s = np.real(array.ravel()).astype(np.float64)
            steps = np.arange(times_s.size) / (times_s.size - 1)
            span_s = float(times_s[-1] - times_s[0])
            if not np.abs(times_s - times_s[0] - span_s * steps).max() <= 0.5 * span_s / (times_s.size - 1):
                raise ValueError(f"{name} must rise in even steps")
            found[name] = (times_s.size - 1) / span_s
    (first_name, rate_hz), *others = found.items() or [("", None)]
    for name, other_hz in others:
        if rate_hz is not None and not abs(other_hz / rate_hz - 1.0) < SAME_RATE:
            raise ValueError(f"{name} must agree with {first_name}, got {other_hz:g} and {rate_hz:g} Hz")
    return rate_hz


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a key that sorts names by the numbers in them: channel_2 before channel_10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]


def _listed(arrays: dict[str, NDArray[Any]]) -> str:
    return ", ".join(arrays)[:100] or "nothing"
