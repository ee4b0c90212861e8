"""The array that took the field data, as the estimators know it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dirmusic import ArrayModel, ElementSpread, GainManifold, GainPattern, GaussianPattern, InputFileError
from pdpatrol.envs.scenario.calibration import ArrayCalibration, CalibratedArray
from pdpatrol.missions.field.field_data import FieldData


def array_model(
    data: FieldData,
    spread: ElementSpread,
    pattern: GainPattern | None,
    boresights_deg: Sequence[float] | None,
    ring_radius_m: float,
    height_m: float,
) -> ArrayModel:
    """Model of the array that took the data, of its live channels alone.

    Args:
        data: The pulses, with the numbers of the live channels.
        spread: Deviations of such arrays from their data sheet.
        pattern: Pattern of every element; None for eq. (1) of the Dir-MUSIC paper.
        boresights_deg: Azimuth of each recorded channel's element; None for an even ring, of which four channels are
            the first four of six elements.
        ring_radius_m: Radius of the ring.
        height_m: Of the ring above the ground.

    Raises:
        InputFileError: If the numbers of boresights and channels differ, or the pattern is the same all round.
    """
    n = data.n_recorded
    if boresights_deg is not None and (len(boresights_deg) != n or not np.isfinite(boresights_deg).all()):
        raise InputFileError(
            [f"--boresights-deg: got {len(boresights_deg)} for {n} channels; allowed is one number for each"]
        )
    boresights = np.array(GainManifold.ring(6 if n == 4 else n).boresights_rad[:n])
    if boresights_deg is not None:
        boresights = np.radians(boresights_deg)
    try:
        manifold = GainManifold(pattern or GaussianPattern(), boresights).take(data.channels)
    except ValueError as error:
        raise InputFileError([f"--pattern, --boresights-deg: {error}"]) from None
    ring = ring_radius_m * np.stack([np.cos(boresights), np.sin(boresights)], axis=-1)
    positions = np.column_stack([ring, np.full(len(boresights), height_m)])
    return ArrayModel(manifold=manifold, positions_m=positions[data.channels], spread=spread)


def calibrated(array: ArrayModel, calibration: ArrayCalibration) -> ArrayModel:
    """The array with what earlier data have shown of its errors.

    Raises:
        InputFileError: If the calibration is of another array.
    """
    faults = calibration.faults(CalibratedArray.of(array, None))
    if faults:
        raise InputFileError([f"--calibration: {fault}" for fault in faults])
    return calibration.taken_up_by(array)
