"""The page of measured data is made from files in the layouts of the three repositories; these here are drawn."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dirmusic import GaussianPattern
from dirmusic.arrays import FloatArray

pytest.importorskip("openpyxl", reason="the extra `measured` is not installed")
pytestmark = pytest.mark.whole

SCRIPT = Path(__file__).parents[2] / "examples" / "measured" / "make_page.py"


def gain_db(off_rad: FloatArray) -> FloatArray:
    return 20.0 * np.log10(0.1 + GaussianPattern()(off_rad))


def write_rfid(folder: Path, rng: np.random.Generator) -> None:
    """Write turns of a tag, levels over distance, and one tag read from eight poses around it."""
    folder.mkdir()
    for number in (1, 2):
        phi_deg = np.repeat(np.arange(-75, 76, 5), 3)
        level_db = 2.0 * gain_db(np.radians(phi_deg)) - 50.0 + rng.normal(0.0, 0.5, phi_deg.size)
        turn = pd.DataFrame({"RSSI-Org": np.rint(100.0 * level_db).astype(int), "phi": phi_deg})
        turn.to_csv(folder / f"RSSI-Phi-{number}.csv", sep=";", index=False)
    distance_m = np.repeat(np.arange(0.5, 3.1, 0.25), 3)
    level_db = -50.0 - 40.0 * np.log10(distance_m) + rng.normal(0.0, 0.3, distance_m.size)
    pd.DataFrame({"Distance": distance_m, "RSSI": level_db}).to_excel(folder / "rssi-distance-1.xlsx", index=False)
    tag_m, azimuth_rad = np.array([0.3, 1.4]), np.radians(np.arange(-60.0, 61.0, 15.0))
    antenna_m = tag_m - 1.5 * np.column_stack([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    off_rad = rng.uniform(-0.5, 0.5, azimuth_rad.size)
    level_db = -50.0 - 40.0 * np.log10(1.5) + 2.0 * gain_db(off_rad)
    table = pd.DataFrame(
        {
            "RSSI": level_db,
            "Antenna x [m]": antenna_m[:, 0],
            "Antenna y [m]": antenna_m[:, 1],
            "Antenna rot z [deg]": 90.0 - np.degrees(azimuth_rad - off_rad),
            "Tag ID": "E280123",
            "Tag x [m]": tag_m[0],
            "Tag y [m]": tag_m[1],
        }
    )
    table.to_excel(folder / "rfid_data_010125_120000_Test1.xlsx", index=False)


def write_wifi_robot(folder: Path, rng: np.random.Generator) -> None:
    """Write two turns on the spot, and one drive past the access point at (9, 0)."""
    folder.mkdir()
    boresight_rad = np.radians([45.0, -45.0, 135.0, -135.0, 0.0])
    turn, line = np.linspace(0.0, 2.0 * np.pi, 120), np.linspace(0.0, 18.0, 120)
    drives = {6: (0 * turn, 0 * turn, turn), 7: (0 * turn, 0 * turn, -turn), 2: (line, 6.0 + 0 * line, 0 * line)}
    for number, (x_m, y_m, yaw_rad) in drives.items():
        off_rad = np.arctan2(-y_m, 9.0 - x_m)[:, np.newaxis] - yaw_rad[:, np.newaxis] - boresight_rad
        range_m = np.hypot(9.0 - x_m, y_m)[:, np.newaxis]
        directional = gain_db(off_rad) * (np.arange(5) < 4)
        level_db = -25.0 - 30.0 * np.log10(range_m) + directional + rng.normal(0.0, 1.0, off_rad.shape)
        blank = np.zeros(120)
        columns = [blank, blank, blank, x_m, y_m, blank, blank, np.sin(yaw_rad / 2), np.cos(yaw_rad / 2)]
        table = np.column_stack([*columns, *[blank] * 6, np.rint(level_db)])
        np.savetxt(folder / f"Dataset{number}.datalog", table, fmt="%.6f", header="columns as published", comments="")


def write_powder(folder: Path, rng: np.random.Generator) -> None:
    """Write levels of nine receivers on a campus, for one emitter and for two at once."""
    folder.mkdir()
    lat_deg, lon_deg = (each.ravel() for each in np.meshgrid([40.76, 40.765, 40.77], [-111.85, -111.845, -111.84]))
    known = {f"receiver-{k}": place for k, place in enumerate(zip(lat_deg.tolist(), lon_deg.tolist(), strict=True))}
    (folder / "location_coordinates.json").write_text(json.dumps(known))
    per_degree_m, receiver_db = np.array([111e3, 84e3]), rng.normal(-10.0, 3.0, 9)
    receiver_m = np.column_stack([lat_deg, lon_deg]) * per_degree_m
    for name, labels in (("single_tx.csv", ["tx"]), ("two_tx.csv", ["tx1", "tx2"])):
        n = 60
        place_deg = rng.uniform([40.761, -111.849], [40.769, -111.841], (len(labels), n, 2))
        range_m = np.linalg.norm(place_deg[..., np.newaxis, :] * per_degree_m - receiver_m, axis=-1)
        watt = 10.0 ** ((receiver_db - 30.0 * np.log10(np.maximum(range_m, 20.0))) / 10.0)
        level_db = 10.0 * np.log10(watt.sum(axis=0)) + rng.normal(0.0, 2.0, (n, 9))
        table = pd.DataFrame(level_db, columns=list(known))
        table.insert(0, "timestamp", [f"2022-01-01 00:{k:02d}:00" for k in range(n)])
        for label, place in zip(labels, place_deg, strict=True):
            table[f"{label}_x_coord"], table[f"{label}_y_coord"] = place.T
        table.to_csv(folder / name, index=False)


def test_command_makes_the_page_with_a_table_for_each_set(tmp_path: Path) -> None:
    data, rng = tmp_path / "data", np.random.default_rng(0)
    data.mkdir()
    write_rfid(data / "rfid", rng)
    write_wifi_robot(data / "wifi_robot", rng)
    write_powder(data / "powder", rng)
    page = tmp_path / "measured.md"
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(data), "--page", str(page)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    text = page.read_text(encoding="utf-8")
    assert "<!-- " not in text
    rows = {row[0]: row for line in text.splitlines() if len(row := line.strip("| ").split(" | ")) == 7}
    assert float(rows["Test1, tag 123"][2]) < 0.15
    assert float(rows["set 2"][2]) < 2.5
    assert rows["set 2"][4] == "yes"
    mean_m = dict(re.findall(r"^\| (nearest receiver|ours) \| (\d+) ", text, flags=re.MULTILINE))
    assert int(mean_m["ours"]) < int(mean_m["nearest receiver"])
    assert "both within 300 m" in text


def test_folder_that_lacks_a_set_is_one_line(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(SCRIPT), str(tmp_path)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith("must have the folders rfid, wifi_robot, powder, got none of them")
