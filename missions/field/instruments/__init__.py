"""Readers of the files that oscilloscopes and other instruments write; the kind is recognised by content."""

from pathlib import Path

from dirmusic.input_file import opened
from pdpatrol.missions.field.instruments.numpy_archive import read_numpy_archive
from pdpatrol.missions.field.instruments.record import MAX_BYTES, WaveformRecord
from pdpatrol.missions.field.instruments.text import read_text

__all__ = ["WaveformRecord", "read_record"]


def read_record(path: Path) -> WaveformRecord:
    """Read a file of waveforms: text of an oscilloscope, or .npz.

    Raises:
        InputFileError: If the file cannot be opened.
        ValueError: If its contents cannot be read; the message does not name the file.
    """
    with opened(path, MAX_BYTES) as file:
        head = file.read(4096)
    if not head:
        raise ValueError("must have contents, is empty")
    if head.startswith(b"PK\x03\x04"):
        return read_numpy_archive(path)
    return read_text(path)
