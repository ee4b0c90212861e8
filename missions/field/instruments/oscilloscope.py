"""Binary files of oscilloscopes (.wfm, .trc, .bin, .isf), through RigolWFM.

Known vendors: Rigol, Agilent and Keysight, Siglent, Rohde & Schwarz, LeCroy, Tektronix and Yokogawa.
"""

import gc
import re
import warnings
from pathlib import Path

import numpy as np

from pdpatrol.missions.field.instruments.record import WaveformRecord

SIGNS = b"WAVEDESC", b":CURV", b"$PublicInfo", b"<?xml", b"YMU:"
"""Words near the start of files that have a header of text: those of LeCroy, Tektronix (.isf), Yokogawa (.hdr), Rohde &
Schwarz, and Yokogawa (.wfm)."""


def is_oscilloscope_file(head: bytes) -> bool:
    """Return whether the first bytes of a file can be those of a binary file of an oscilloscope."""
    return b"\0" in head or any(sign in head for sign in SIGNS)


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
    if len(rates_hz) != 1 or units != {"v"}:
        raise ValueError(f"must have channels in volts of one rate, got {len(channels)} in {', '.join(sorted(units))}")
    return WaveformRecord.of(volts, rates_hz.pop(), tuple(each.name for each in channels))
