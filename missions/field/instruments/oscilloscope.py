"""Binary files of oscilloscopes (.wfm, .trc, .bin, .isf), through RigolWFM.

Known vendors: Rigol, Agilent and Keysight, Siglent, Rohde & Schwarz, LeCroy, Tektronix and Yokogawa.
"""

import gc
import re
import struct
import warnings
from pathlib import Path

import numpy as np

from dirmusic.input_file import read_whole
from pdpatrol.missions.field.instruments.record import MAX_BYTES, VOLTS, WaveformRecord

SIGNS = b"WAVEDESC", b":CURV", b"$PublicInfo", b"<?xml", b"YMU:"
"""Words near the start of files that have a header of text: those of LeCroy, Tektronix (.isf), Yokogawa (.hdr), Rohde &
Schwarz, and Yokogawa (.wfm)."""


def is_oscilloscope_file(head: bytes) -> bool:
    """Return whether the first bytes of a file can be those of a binary file of an oscilloscope."""
    is_utf_16 = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    return (b"\0" in head and not is_utf_16) or any(sign in head for sign in SIGNS)


def read_oscilloscope_file(path: Path) -> WaveformRecord:
    """Read a binary file of an oscilloscope; of Rohde & Schwarz, either of the two files NAME.bin and NAME.Wfm.bin.

    Raises:
        ValueError: If the file is of no known kind, damaged, or not in volts.
        ModuleNotFoundError: If RigolWFM is not installed.
    """
    from RigolWFM.wfm import Wfm  # in the extra `instruments`

    header = path.with_name(re.sub(r"(?i)\.wfm\.bin$", ".bin", path.name))
    if not header.exists():
        raise ValueError(f"must have its header file {header.name} next to it")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # RigolWFM leaves its files to the garbage collector
            channels = [each for each in Wfm.from_file(str(header)).channels if each.enabled_and_selected]
            gc.collect()
        volts = np.array([each.volts for each in channels], dtype=np.float64)
        rates_hz = {round(1.0 / float(each.seconds_per_point), 3) for each in channels}
    except Exception as error:  # damaged bytes raise errors of many types
        reason = " ".join(str(error).replace(f"{header.parent}/", "").split())
        raise ValueError(f"must be text or a binary file of a known oscilloscope ({reason:.100})") from None
    units = {each.unit.name for each in channels}
    data = read_whole(header, MAX_BYTES)
    _check_header(data, volts.shape[-1])
    if len(rates_hz) != 1 or units != {"v"}:
        raise ValueError(f"must have channels in volts of one rate, got {len(channels)} in {', '.join(sorted(units))}")
    segments = volts.reshape(len(channels), _count_segments(data, volts.shape[-1]), -1).swapaxes(0, 1)
    return WaveformRecord.of(segments, rates_hz.pop(), tuple(each.name for each in channels))


BYTE_ORDER, N_SEGMENTS, VERTICAL_UNIT = 34, 144, slice(196, 244)
"""Places after the word WAVEDESC in files of LeCroy (LECROY_2_3 template): COMM_ORDER, SUBARRAY_COUNT, and VERTUNIT."""


def _count_segments(data: bytes, n_samples: int) -> int:
    """Return the number of segments of a file of LeCroy, which records one for each trigger in a sequence; 1 of others.

    Raises:
        ValueError: If the segments cannot have one length.
    """
    at = data[:8192].find(b"WAVEDESC")
    if at < 0 or b"LECROY_2_3" not in data[at : at + 32]:
        return 1
    order = "<" if data[at + BYTE_ORDER] else ">"
    n = max(struct.unpack_from(f"{order}i", data, at + N_SEGMENTS)[0], 1)
    if n_samples % n:
        raise ValueError(f"must have {n} segments of one length as its header states, got {n_samples} samples")
    return int(n)


def _check_header(data: bytes, n_samples: int) -> None:
    """Check unit and length in headers of Tektronix (.isf) and LeCroy, which RigolWFM does not check.

    Raises:
        ValueError: If the samples are not in volts, or fewer than the header states.
    """
    text, unit, n_stated = data[:8192], b"V", n_samples
    if b":CURV" in text:
        text = text[: text.index(b":CURV")]
        found = re.search(rb'YUN(?:IT)?\s+"?([^";\s]+)', text)
        unit = found[1] if found else unit
        found = re.search(rb"NR_P(?:T)?\s+(\d+)", text)
        n_stated = int(found[1]) if found else n_stated
    elif b"WAVEDESC" in text:
        unit = data[text.index(b"WAVEDESC") :][VERTICAL_UNIT].split(b"\0")[0] or unit
    name = unit.decode("latin-1").strip()
    if VOLTS.get(name.lower()) != 1.0:
        raise ValueError(f"must be in volts, got {name:.20} in the header")
    if n_samples < n_stated:
        raise ValueError(f"must have {n_stated} samples as its header states, got {n_samples}; is it cut off?")
