"""Seeded mutations of a valid table and of a valid archive of waveforms."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np

CELLS = (
    "nan", "-inf", "1e300", "1e-320", "", "1_000", "٣", "0x10", "1" * 5000, "=1+1", '"', "1;5", "-1", "720",
    "\x1b[31m", "\u2028",
)  # fmt: skip


def table(good: str, rng: np.random.Generator) -> bytes:
    """Return the table with up to two errors, or harmless changes."""
    lines = good.splitlines()
    for _ in range(rng.integers(0, 3)):
        lines = TABLES[rng.integers(len(TABLES))](lines, rng)
    data = "\n".join(lines).encode()
    if rng.random() < 0.2:
        data = mutated(data, rng)
    return data


def archive(rng: np.random.Generator) -> bytes:
    """Return an archive of waveforms, in two of three cases with damaged bytes."""
    data = packed(waveforms(rng))
    return mutated(data, rng) if rng.integers(3) else data


def waveforms(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return one pulse in six channels, in counts."""
    pulse = np.zeros(400)
    pulse[200:230] = np.sin(np.arange(30))
    counts = 900 * np.array([1.0, 0.9, 0.5, 0.3, 0.2, 0.6])[:, np.newaxis] * pulse + 9 * rng.standard_normal((6, 400))
    return {
        "waveforms": np.round(counts).astype(np.int16),
        "sample_rate_hz": np.array(20e9),
        "volts_per_count": np.array(1e-3),
    }


def packed(arrays: dict[str, np.ndarray]) -> bytes:
    """Return an archive as NumPy writes it."""
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # pyright: ignore[reportArgumentType]
    return file.getvalue()


def _cells(lines: list[str], rng: np.random.Generator) -> list[str]:
    row = int(rng.integers(len(lines)))
    cells = lines[row].split(",")
    cells[rng.integers(len(cells))] = CELLS[rng.integers(len(CELLS))]
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


TABLES: tuple[Callable[[list[str], np.random.Generator], list[str]], ...] = (
    _cells,
    lambda lines, rng: lines[: rng.integers(len(lines) + 1)],
    lambda lines, rng: [lines[0], *np.array(lines[1:])[rng.permutation(len(lines) - 1)]] if lines else lines,
    lambda lines, rng: ["sep=" + ",;\t|"[rng.integers(4)], *lines],
    lambda lines, rng: [line.replace(",", ";\t |"[rng.integers(4)]) for line in lines],
    lambda lines, rng: [*lines[:3], *["x" * 200_000] * int(rng.integers(2)), *lines[3:]],
    lambda lines, rng: [*lines, *lines[1:]],
)


def _flipped(data: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.integers(1, 30) if changed else 0):
        changed[rng.integers(len(changed))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


BYTES: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    _flipped,
    lambda data, rng: data[: rng.integers(len(data) + 1)],
    lambda data, rng: data[rng.integers(len(data) + 1) :],
    lambda data, rng: data + rng.bytes(200),
    lambda data, rng: data.decode("latin-1").encode("utf-16"),
    lambda data, rng: rng.bytes(int(rng.integers(2000))),
)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes of a file with an error."""
    return BYTES[rng.integers(len(BYTES))](data, rng)
