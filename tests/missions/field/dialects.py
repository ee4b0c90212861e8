"""Text as oscilloscopes of different vendors write it, for tests."""

from collections.abc import Callable

from dirmusic.arrays import FloatArray

STEP_S = 5e-11


def _rows(volts: FloatArray, start: str = "{time:.3e},", cell: str = "{:.6e}", unit: float = 1.0) -> list[str]:
    """Return one line for each sample of volts (n_channels, n_samples)."""
    return [
        start.format(time=(k - 100) * STEP_S / unit, index=k) + ",".join(cell.format(v) for v in column)
        for k, column in enumerate(volts.T)
    ]


def _each(text: str, volts: FloatArray) -> str:
    """Return a text for each channel, separated by commas; `#` in it is the number of the channel."""
    return ",".join(text.replace("#", str(k + 1)) for k in range(len(volts)))


def tektronix(volts: FloatArray) -> str:
    """Return the form of the series 5: keys and values, an empty line, labels, names."""
    header = [
        "Model,MSO58", f"Horizontal Scale,{STEP_S * 50:g},,", f"Sample Interval,{STEP_S:g},,",
        f"Record Length,{volts.shape[1]},,", f"Vertical Units,{_each('V', volts)}", "", f"Label,{_each('', volts)}",
        f"TIME,{_each('CH#', volts)}",
    ]  # fmt: skip
    return "\n".join([*header, *_rows(volts)])


def lecroy(volts: FloatArray) -> str:
    """Return a header with segments, and a line of names."""
    header = ["LECROYWR640Zi,61392,Waveform", f"Segments,1,SegmentSize,{volts.shape[1]}"]
    header += ["Segment,TrigTime,TimeSinceSegment1", "#1,02-Jan-2026 03:04:05,0        "]
    return "\n".join([*header, f"Time,{_each('Ampl#', volts)}", *_rows(volts)])


def lecroy_decimal_comma(volts: FloatArray) -> str:
    """Return the same with semicolons and decimal commas."""
    return lecroy(volts).replace(",", ";").replace(".", ",")


def keysight(volts: FloatArray) -> str:
    """Return numbers of channels as names, and a line of units."""
    return "\n".join([f"x-axis,{_each('#', volts)}", f"second,{_each('Volt', volts)}", *_rows(volts)])


def rigol_times(volts: FloatArray) -> str:
    """Return the form with times: no name above them, and a separator at the end of a line."""
    header = [f",{_each('CH#', volts)}", f"Second,{_each('Volt', volts)}"]
    return "\n".join([*header, *(f"{row}, " for row in _rows(volts))])


def rigol_increment(volts: FloatArray) -> str:
    """Return the form without times: their start and increment stand in the second line."""
    header = [f"X,{_each('CH#', volts)},Start,Increment,", f"Sequence,{_each('Volt', volts)},0.0,{STEP_S:e}"]
    return "\n".join([*header, *(f"{row}," for row in _rows(volts, "{index},"))])


def siglent(volts: FloatArray) -> str:
    """Return a header of keys with values behind colons."""
    header = [f"Record Length,Analog:{volts.shape[1]},", f"Sample Interval,Analog:{STEP_S:e},"]
    header += [f"Vertical Units,{_each('CH#:V', volts)},,", "Horizontal Units,s,,", f"Second,{_each('Value', volts)}"]
    return "\n".join([*header, *_rows(volts)])


def rohde_schwarz(volts: FloatArray) -> str:
    """Return rows without any header."""
    return "\n".join(_rows(volts))


def yokogawa(volts: FloatArray) -> str:
    """Return quoted keys, and rows that begin with an empty cell and have no time."""
    header = [
        '"Model Name","DL9000"', '"BlockNumber","1"', f'"TraceName",{_each("CH#", volts)}',
        f'"BlockSize",{_each(str(volts.shape[1]), volts)}', f'"VUnit",{_each("V", volts)}',
        f'"SampleRate",{_each(f"{1 / STEP_S:e}", volts)}', f'"HResolution",{_each(f"{STEP_S:e}", volts)}',
        f'"HUnit",{_each("s", volts)}', f'"Date",{_each("2026/01/02", volts)}', "",
    ]  # fmt: skip
    return "\n".join([*header, *_rows(volts, ",")])


def picoscope(volts: FloatArray) -> str:
    """Return nanoseconds and millivolts, with units in brackets below the names."""
    header = ["Time,Channel A,Channel B,Channel C,Channel D"[: 4 + 10 * len(volts)]]
    header += [f"(ns),{_each('(mV)', volts)}", ""]
    return "\n".join([*header, *_rows(1e3 * volts, "{time:.4f},", "{:.6f}", unit=1e-9)])


def digilent(volts: FloatArray) -> str:
    """Return comments, and units in brackets behind the names."""
    header = ["#Digilent WaveForms Oscilloscope Acquisition", "#Date Time: 2026-01-02 03:04:05", ""]
    return "\n".join([*header, f"Time (s),{_each('Channel # (V)', volts)}", *_rows(volts)])


DIALECTS: dict[str, Callable[[FloatArray], str]] = {
    "tektronix": tektronix,
    "lecroy": lecroy,
    "lecroy_decimal_comma": lecroy_decimal_comma,
    "keysight": keysight,
    "rigol_times": rigol_times,
    "rigol_increment": rigol_increment,
    "siglent": siglent,
    "rohde_schwarz": rohde_schwarz,
    "yokogawa": yokogawa,
    "picoscope": picoscope,
    "digilent": digilent,
}
