"""Files of LabVIEW (TDMS), through nptdms."""

import logging
from pathlib import Path
from typing import Any

import numpy as np

from pdpatrol.missions.field.instruments.record import VOLTS, WaveformRecord


def read_tdms(path: Path) -> WaveformRecord:
    """Read all channels of a TDMS file; each group is a segment if all groups have the same channels.

    Raises:
        ValueError: If the file is damaged, or its channels differ in rate or length, or lack a rate.
        ModuleNotFoundError: If nptdms is not installed.
    """
    from nptdms import TdmsFile  # in the extra `instruments`

    for name in ("nptdms.reader", "nptdms.tdms_segment"):  # a file that is cut off is an error below, not a warning
        logging.getLogger(name).setLevel(logging.ERROR)
    try:
        groups = [group.channels() for group in TdmsFile.read(path).groups()]
        groups = [channels for channels in groups if channels]
        samples = [[np.asarray(channel[:], dtype=np.float64) for channel in channels] for channels in groups]
        every = [channel for channels in groups for channel in channels]
        interval_s = {float(channel.properties.get("wf_increment", np.nan)) for channel in every}
        start_s = [[float(each.properties.get("wf_start_offset", 0.0)) for each in channels] for channels in groups]
    except Exception as error:  # damaged bytes raise errors of many types
        raise ValueError(f"must be a TDMS file of numbers ({' '.join(str(error).split()):.100})") from None
    if (
        len({channel.size for channels in samples for channel in channels}) != 1
        or len(interval_s) != 1
        or not min(interval_s) > 0
    ):
        raise ValueError("must have channels of one length, with one sampling interval wf_increment")
    scale = [np.array([[_volts(channel)] for channel in channels]) for channels in groups]
    segments = [volts * of_group for volts, of_group in zip(samples, scale, strict=True)]
    names, rate_hz = [tuple(channel.name for channel in channels) for channels in groups], 1.0 / interval_s.pop()
    if len(set(names)) > 1:  # groups of other channels of the same pulse
        segments, start_s = [np.concatenate(segments)], [[each for of_group in start_s for each in of_group]]
        names = [tuple(name for of_group in names for name in of_group)]
    for of_group in start_s:
        if (max(of_group) - min(of_group)) * rate_hz > 1.5:
            raise ValueError(
                f"wf_start_offset must be equal in all channels, got {min(of_group):g} to {max(of_group):g}"
            )
    return WaveformRecord.of(np.array(segments), rate_hz, names[0])


def _volts(channel: Any) -> float:  # noqa: ANN401 - nptdms is in an extra
    """Return the factor from the samples of a channel to volts.

    Raises:
        ValueError: If it is in another unit, or not scaled.
    """
    if channel.dtype.kind in "iu":
        raise ValueError(f"{channel.name} must be scaled to volts, got whole numbers")
    unit = str(channel.properties.get("unit_string", "")).strip()
    if unit and unit.lower() not in VOLTS:
        raise ValueError(f"{channel.name} must be in volts, got {unit}")
    return VOLTS.get(unit.lower(), 1.0)
