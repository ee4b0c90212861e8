"""`pdpatrol calibrate`: pattern of an antenna from levels received in turns on the spot."""

from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from pydantic import Field

from dirmusic.array.level_calibration import LearnedPattern
from pdpatrol.missions.atomic_file import write_text
from pdpatrol.missions.cli.arguments import Flag
from pdpatrol.missions.cli.terminal import say
from pdpatrol.missions.field.turns import learn_from_turns
from pdpatrol.missions.record.words import counted

Degrees = Annotated[float, Field(ge=-360.0, le=360.0)]


def calibrate(
    turns: Annotated[Path, tyro.conf.arg(metavar="TURNS.csv")],
    /,
    *,
    source_m: Annotated[tuple[float, float], tyro.conf.arg(metavar="X Y")],
    boresights_deg: Annotated[tuple[Degrees, ...], tyro.conf.arg(metavar="DEGREES [DEGREES ...]")] = (0.0,),
    is_passive: Annotated[Flag, tyro.conf.arg(name="passive")] = False,
    out_file: Annotated[Path, tyro.conf.arg(name="out", metavar="FILE")] = Path("pattern.csv"),
) -> None:
    """Learn the common pattern of all channels from turns on the spot, and write it for `locate --pattern`.

    The table has the columns x_m, y_m, yaw_deg and level_1 to level_n in decibels, for example dBm. A turn ends where
    the robot moves by 0.5 m. The pattern is the mean over turns and channels; how much these differ, mostly because of
    multipath, is printed and stands in the comments of the file.

    Args:
        turns: The table.
        source_m: Position of the emitter, x and y, in the frame of the table.
        boresights_deg: Azimuth of the boresight of each channel relative to the heading.
        is_passive: The antenna also sends the wave that the emitter returns, so that the pattern counts twice.
        out_file: File to write.
    """
    learned, n_turns = learn_from_turns(turns, np.array(source_m), np.radians(boresights_deg), 2 if is_passive else 1)
    write_text(out_file, _text(learned, n_turns))
    strongest = int(np.argmax(learned.gain_db))
    missing = int(np.sum(~learned.is_measured))
    say(
        f"{out_file}: {counted(n_turns, 'turn')}, "
        f"strongest at {np.degrees(learned.off_boresight_rad[strongest]):.0f} degrees, "
        f"{np.ptp(learned.gain_db):.1f} dB above the weakest direction; {_spread_text(learned)}"
    )
    if missing:
        say(f"{missing} of {learned.gain_db.size} directions have no levels and are interpolated", style="yellow")


def _spread_text(learned: LearnedPattern) -> str:
    if np.isnan(learned.spread_db):
        return "how much turns differ is unknown, because there is only one"
    return f"turns differ by {learned.spread_db:.1f} dB (rms)"


def _text(learned: LearnedPattern, n_turns: int) -> str:
    """Return the pattern file, with the standard deviation of a turn about the mean in comments."""
    angle_deg = np.degrees(learned.off_boresight_rad)
    deviations = [f"#   {a:g}, {std:.2f}" for a, std in zip(angle_deg, learned.std_db, strict=True)]
    rows = [f"{a:g},{gain:.3f}" for a, gain in zip(angle_deg, learned.gain_db, strict=True)]
    head = [
        f"# Learned from {counted(n_turns, 'turn')}: {_spread_text(learned)}.",
        "# Standard deviation of a turn about the mean, in dB, by angle in degrees:",
    ]
    return "\n".join([*head, *deviations, "angle_deg,gain_db", *rows, ""])
