"""Recordings with SigMF metadata, through sigmf."""

from pathlib import Path

import numpy as np

from pdpatrol.missions.field.instruments.record import WaveformRecord

SUFFIXES = {".sigmf-meta", ".sigmf-data", ".sigmf"}
"""Endings of metadata, data, and archives of both; the standard finds one file from the other by its name."""


def is_sigmf(path: Path, head: bytes) -> bool:
    """Return whether a file is a part of a recording with SigMF metadata."""
    return path.suffix.lower() in SUFFIXES or b'"core:datatype"' in head


def read_sigmf(path: Path) -> WaveformRecord:
    """Read a recording of real samples; those of fixed point are scaled so that full scale is 1 V.

    Raises:
        ValueError: If the recording is damaged, or has complex samples or no rate.
        ModuleNotFoundError: If sigmf is not installed.
    """
    import sigmf  # in the extra `instruments`

    try:
        recording = sigmf.fromfile(path)
        samples = np.asarray(recording.read_samples())
        rate_hz, n_channels = recording.sample_rate, recording.num_channels
    except Exception as error:  # damaged files raise errors of many types
        raise ValueError(f"must be a SigMF recording ({' '.join(str(error).split()):.100})") from None
    if samples.dtype.kind == "c":
        raise ValueError("must have real samples (core:datatype r...), got complex ones")
    if rate_hz is None:
        raise ValueError("must have core:sample_rate in its metadata")
    return WaveformRecord.of(samples.reshape(-1, n_channels).T.copy(), float(rate_hz))
