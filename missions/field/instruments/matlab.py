"""Files of MATLAB, through scipy.io and, from version 7.3 on, h5py; and HDF5 files with the same names."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from pdpatrol.missions.field.instruments.record import WaveformRecord

INTERVALS = {"tinterval", "xinc", "xincrement", "dt", "ts", "tinc", "sampleinterval"}
"""Names of the sampling interval in seconds, in lower case; PicoScope writes Tinterval."""

RATES = {"sample_rate_hz", "samplerate", "sample_rate", "fs", "rate_hz"}
"""Names of the sampling rate in hertz."""

TIMES = {"time_s", "time", "t", "times"}
"""Names of a vector of times in seconds."""


def read_matlab(path: Path) -> WaveformRecord:
    """Read a file of MATLAB up to version 7.2; names as in `record_of_arrays`.

    Raises:
        ValueError: If the file is damaged, or has no waveforms.
    """
    try:
        arrays = {name: array for name, array in loadmat(path).items() if isinstance(array, np.ndarray)}
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
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iuf":
            array, name = np.asarray(item), path.rpartition("/")[2]
            if name in arrays:
                repeated.append(name)
            arrays[name] = array.T if is_matlab else array

    try:
        with h5py.File(path) as file:
            file.visititems(add)
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
        ValueError: If waveform or rate is missing.
    """
    named = {name.lower(): array for name, array in arrays.items() if array.size and array.dtype.kind in "iuf"}
    interval_s = next((float(named[name].flat[0]) for name in named if name in INTERVALS), None)
    rate_hz = next((float(named[name].flat[0]) for name in named if name in RATES), None)
    times_s = next((named[name].ravel() for name in named if name in TIMES and named[name].size > 1), None)
    if rate_hz is None and interval_s is None and times_s is not None:
        interval_s = float(times_s[-1] - times_s[0]) / (times_s.size - 1)
    if rate_hz is None and not (interval_s or 0.0) > 0:
        raise ValueError(f"must have a rate or interval, such as sample_rate_hz or Tinterval; got {_listed(arrays)}")
    rate_hz = rate_hz or 1.0 / (interval_s or 1.0)
    scale = named.get("volts_per_count", np.ones(1)).ravel().astype(np.float64)
    scale = scale if scale.size > 1 else scale[0]
    if "waveforms" in named:
        return WaveformRecord.of(named["waveforms"], rate_hz, volts_per_count=scale)
    vectors = {
        name: array.ravel()
        for name, array in arrays.items()
        if array.dtype.kind in "iuf" and array.size > 1 and array.size == max(array.shape) and name.lower() not in TIMES
    }
    longest = max((vector.size for vector in vectors.values()), default=0)
    channels = {
        name: vector for name, vector in vectors.items() if vector.size == longest and name != "volts_per_count"
    }
    if not channels:
        raise ValueError(f"must have waveforms, or one vector for each channel; got {_listed(arrays)}")
    return WaveformRecord.of(np.array(list(channels.values())), rate_hz, tuple(channels), scale)


def _listed(arrays: dict[str, NDArray[Any]]) -> str:
    return ", ".join(arrays)[:100] or "nothing"
