"""Readers of the files that oscilloscopes and other instruments write; the kind is recognised by content."""

from pathlib import Path

from dirmusic.input_file import opened
from pdpatrol.missions.field.instruments.matlab import read_hdf5, read_matlab
from pdpatrol.missions.field.instruments.numpy_archive import read_numpy_archive
from pdpatrol.missions.field.instruments.oscilloscope import is_oscilloscope_file, read_oscilloscope_file
from pdpatrol.missions.field.instruments.record import MAX_BYTES, WaveformRecord
from pdpatrol.missions.field.instruments.signal_metadata import is_sigmf, read_sigmf
from pdpatrol.missions.field.instruments.tdms import read_tdms
from pdpatrol.missions.field.instruments.text import read_text

__all__ = ["WaveformRecord", "read_record"]


def read_record(path: Path) -> WaveformRecord:
    """Read a file of waveforms.

    It may be text or a binary file of an oscilloscope, .npz, TDMS, MATLAB, HDF5, or SigMF.

    Raises:
        InputFileError: If the file cannot be opened.
        ValueError: If its contents cannot be read; the message does not name the file.
        ModuleNotFoundError: If the library for this kind of file is not installed: the extra `instruments`.
    """
    with opened(path, MAX_BYTES) as file:
        head = file.read(8192)
    if not head:
        raise ValueError("must have contents, is empty")
    if head.startswith(b"PK\x03\x04"):
        return read_numpy_archive(path)
    if head.startswith(b"TDSm"):
        return read_tdms(path)
    if head.startswith((b"MATLAB 7.3", b"\x89HDF")):
        return read_hdf5(path, is_matlab=head.startswith(b"MATLAB"))
    if head.startswith(b"MATLAB"):
        return read_matlab(path)
    if is_sigmf(path, head):
        return read_sigmf(path)
    if is_oscilloscope_file(head):
        return read_oscilloscope_file(path)
    return read_text(path)
