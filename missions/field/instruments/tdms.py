"""Files of LabVIEW (TDMS), through nptdms."""

import logging
from pathlib import Path

import numpy as np

from pdpatrol.missions.field.instruments.record import WaveformRecord


def read_tdms(path: Path) -> WaveformRecord:
    """Read all channels of a TDMS file; each group is a segment if all groups have the same channels.

    Raises:
        ValueError: If the file is damaged, or its channels differ in rate or length, or lack a rate.
        ModuleNotFoundError: If nptdms is not installed.
    """
    from nptdms import TdmsFile  # in the extra `instruments`

    logging.getLogger("nptdms").setLevel(logging.ERROR)  # a file that is cut off is an error below, not a warning
    try:
        groups = [group.channels() for group in TdmsFile.read(path).groups()]
        groups = [channels for channels in groups if channels]
        segments = [[np.asarray(channel[:], dtype=np.float64) for channel in channels] for channels in groups]
    except Exception as error:  # damaged bytes raise errors of many types
        raise ValueError(f"must be a TDMS file of numbers ({' '.join(str(error).split()):.100})") from None
    intervals_s = {float(each.properties.get("wf_increment", np.nan)) for channels in groups for each in channels}
    lengths = {each.size for segment in segments for each in segment}
    if len(lengths) != 1 or len(intervals_s) != 1 or not min(intervals_s) > 0:
        raise ValueError("must have channels of one length, with one sampling interval wf_increment")
    names = [tuple(channel.name for channel in channels) for channels in groups]
    if len(set(names)) > 1:  # groups of other channels of the same pulse
        return WaveformRecord.of(
            np.concatenate(segments), 1.0 / intervals_s.pop(), tuple(name for of_group in names for name in of_group)
        )
    return WaveformRecord.of(np.array(segments), 1.0 / intervals_s.pop(), names[0])
