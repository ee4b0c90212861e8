"""Archives of NumPy (.npz) with `waveforms`, `sample_rate_hz` and, for counts, `volts_per_count`."""

from pathlib import Path

import numpy as np

from dirmusic import InputFileError
from dirmusic.input_file import opened
from pdpatrol.missions.field.instruments.record import MAX_BYTES, WaveformRecord


def read_numpy_archive(path: Path) -> WaveformRecord:
    """Read an archive; arrays as in `WaveformRecord.of`.

    Raises:
        ValueError: If its contents cannot be a record.
    """
    try:
        with opened(path, MAX_BYTES) as file, np.load(file, allow_pickle=False) as archive:
            if sum(member.file_size for member in archive.zip.infolist()) > MAX_BYTES:
                raise InputFileError([f"arrays must have at most {MAX_BYTES / 1e6:.0f} MB"])
            samples, rate_hz = archive["waveforms"], float(archive["sample_rate_hz"])
            scale = np.asarray(archive["volts_per_count"], np.float64) if "volts_per_count" in archive else None
    except InputFileError:
        raise
    except Exception as error:  # damaged bytes raise errors of many types in zipfile, zlib and the header reader
        raise ValueError(
            "must be an .npz archive with the arrays waveforms, sample_rate_hz and, for counts, volts_per_count "
            f"({' '.join(str(error).split()):.100})"
        ) from None
    if scale is None and samples.dtype.kind != "f":
        raise ValueError(f"waveforms of whole numbers need volts_per_count, got {samples.dtype} without it")
    return WaveformRecord.of(samples, rate_hz, volts_per_count=1.0 if scale is None else scale)
