"""Surveys that are located while they are recorded end like the finished file."""

import json
import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import psutil
import pytest

from dirmusic import GaussianPattern, InputFileError
from dirmusic.angles import wrap
from pdpatrol.missions.field.follow import SurveyFollower
from pdpatrol.missions.field.input_table import read_table
from pdpatrol.missions.field.line_sources import LineBuffer
from pdpatrol.missions.field.record_table import RecordTable
from pdpatrol.missions.field.survey import SurveyOptions
from tests.missions.conftest import Refused
from tests.missions.field.surveys import EXAMPLE
from tests.processes import PDPATROL, pdpatrol, without_screen

HEADER, *ROWS = EXAMPLE.read_text(encoding="utf-8").splitlines()
NAMES = HEADER.split(",")


def feed(folder: Path, data: bytes, sizes: Iterable[int]) -> list[str]:
    """Store the records in some bytes, which arrive in pieces of some sizes, and return the reports."""
    reports, at = list[str](), 0
    table, buffer = (
        RecordTable(folder / "received.csv", Path("s.csv"), None, reports.append),
        LineBuffer(reports.append),
    )
    for _ in table.stored():
        pass
    for size in sizes:
        table.add(buffer.add(data[at : at + size]))
        at += size
    table.add(buffer.add(data[at:]))
    table.add(buffer.end(), is_end=True)
    return reports


def stored_is(folder: Path, rows: Sequence[str]) -> bool:
    """Compare the stored table with rows of the example, bit for bit."""
    (folder / "expected.csv").write_text("\n".join([HEADER, *rows, ""]))
    stored, expected = read_table(folder / "received.csv"), read_table(folder / "expected.csv")
    return all(np.array_equal(stored.columns[name], expected.columns[name]) for name in NAMES)


@pytest.mark.parametrize("seed", range(3))
def test_pieces_and_kills_of_the_reader_change_nothing(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    data = "\n".join([HEADER, *ROWS, ""]).encode()
    for end in np.sort(rng.integers(0, len(data), 4)).tolist():  # the reader is killed while it writes a row
        feed(tmp_path, data[:end], rng.integers(1, 300, 20).tolist())
        with (tmp_path / "received.csv").open("r+b") as file:
            file.truncate(max(file.seek(0, 2) - int(rng.integers(0, 60)), 0))
    feed(tmp_path, data, rng.integers(1, 300, 40).tolist())
    assert stored_is(tmp_path, ROWS)


def test_separators_at_the_end_of_all_lines_are_read(tmp_path: Path) -> None:
    data = "\n".join([f"{line.replace(',', ';')};" for line in (HEADER, *ROWS)] + [""]).encode()
    assert feed(tmp_path, data, [100]) == []
    assert stored_is(tmp_path, ROWS)


def test_unusable_records_are_one_line_each(tmp_path: Path) -> None:
    lines = [
        HEADER,
        *ROWS[:20],
        ROWS[19],
        *ROWS[3:9],
        ROWS[20],
        ROWS[21][:30],
        f"1e300,{ROWS[21].partition(',')[2]}",
        "\x00\x01",
        HEADER,
        *ROWS[21:],
        ROWS[0][:25],
    ]
    reports = feed(tmp_path, "\n".join(lines).encode(), [])
    assert stored_is(tmp_path, ROWS)
    patterns = [
        "7 records from 20 to 80 s are repeated or late: left out",
        "line left out, must have 16 cells: ",
        "line left out, must have 16 cells: ",
        r"record at 1e\+300 s left out, time_s must be a number from .* got 1e\+300",
        "last line has no end and may be torn: left out: ",
    ]
    assert len(reports) == len(patterns)
    assert all(any(re.match(pattern, report) for report in reports) for pattern in patterns)


def test_gap_is_reported_and_a_single_time_far_ahead_left_out(tmp_path: Path) -> None:
    later = [f"{float(row.partition(',')[0]) + 900.0},{row.partition(',')[2]}" for row in ROWS[60:]]
    ahead = f"59600.0,{ROWS[59].partition(',')[2]}"
    reports = feed(tmp_path, "\n".join([HEADER, *ROWS[:40], ahead, *ROWS[40:60], *later, ""]).encode(), [])
    assert stored_is(tmp_path, [*ROWS[:60], *later])
    assert reports == [
        "record at 59600 s is far ahead of the next one: left out",
        "no records from 200 to 1120 s",
    ]


def test_changed_header_and_json_are_read_by_name(tmp_path: Path) -> None:
    order = np.random.default_rng(4).permutation(len(NAMES)).tolist()

    def turned(row: str) -> str:
        return ";".join(row.split(",")[k] for k in order).replace(".", ",") + ";7"

    objects = [json.dumps(dict(zip(NAMES, map(float, row.split(",")), strict=True))) for row in ROWS[60:]]
    renamed = HEADER.replace("strength_3", "strength_three")
    other = ";".join(NAMES[k] for k in order) + ";humidity"
    reports = feed(
        tmp_path,
        "\n".join([HEADER, *ROWS[:30], renamed, ROWS[30], other, *map(turned, ROWS[30:60]), *objects]).encode(),
        [100, 50, 1000],
    )
    assert stored_is(tmp_path, ROWS)
    patterns = (
        "header changed to .* without strength_3: its records are left out",
        "line left out, has no usable header before it",
        "header changed to .* its records are used, without humidity",
        "header changed to time_s, x_m, .* its records are used",
    )
    assert len(reports) == len(patterns)
    assert all(any(re.match(pattern, report) for report in reports) for pattern in patterns)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (HEADER + ",humidity", "humidity is unknown"),
        ("time_s,x_m,y_m,yaw_deg,waveform", "--follow takes strength_1"),
        ("time_s,x_m,y_m,yaw_deg,strength_1,strength_2,strength_3", "or --noise-v"),
    ],
)
def test_unusable_first_header_is_refused(tmp_path: Path, header: str, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        feed(tmp_path, f"{header}\n".encode(), [])
    assert list(tmp_path.iterdir()) == []


def test_findings_are_printed_as_they_change(tmp_path: Path) -> None:
    reports = list[str]()
    follower = SurveyFollower(tmp_path, EXAMPLE, SurveyOptions(), reports.append)
    news = list[str]()
    for line in [HEADER, *ROWS]:
        follower.add([line])
        news += follower.news()
    assert (reports, follower.n_records) == ([], len(ROWS))
    assert news[0].split(" at ")[0].strip().endswith("s  candidate 1")
    truth = json.loads(EXAMPLE.with_name("truth.json").read_text())
    found = re.search(r"finding 1 at \(([\d.]+), ([\d.]+),", news[-1])
    assert found is not None
    assert np.hypot(*np.subtract([float(found[1]), float(found[2])], truth["position_m"][:2])) < 0.3


def test_continued_survey_is_soon_up_to_date(tmp_path: Path) -> None:
    """The stored records are located in less than half the time, with the same result."""
    rows = [f"{5.0 * k},{row.partition(',')[2]}" for k, row in enumerate(ROWS)]
    places_m, cost_s = list[np.ndarray](), list[float]()
    for piece in ([HEADER, *rows], []):
        before_s = time.process_time()
        follower = SurveyFollower(tmp_path, EXAMPLE, SurveyOptions(), list[str]().append)
        for line in piece:
            follower.add([line])
        cost_s.append(time.process_time() - before_s)
        assert follower.locator is not None
        (finding,) = follower.locator.findings
        assert (follower.n_records, finding.state) == (len(rows), "confirmed")
        places_m.append(finding.position_m)
    assert np.linalg.norm(places_m[1] - places_m[0]) < 0.1
    assert cost_s[1] < 0.5 * cost_s[0]


def start(*arguments: object, cwd: Path) -> subprocess.Popen[str]:
    """Start to follow a source."""
    return subprocess.Popen(
        [PDPATROL, "locate", "--follow", *map(str, arguments)],
        cwd=cwd, env=without_screen(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def wait_for(path: Path, n_lines: int) -> None:
    """Wait until a file has a number of lines."""
    deadline_s = time.monotonic() + 120.0
    while not path.exists() or len(path.read_bytes().splitlines()) < n_lines:
        assert time.monotonic() < deadline_s
        time.sleep(0.05)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.mark.whole
def test_every_source_ends_like_the_finished_file(tmp_path: Path) -> None:
    """The file grows while writer and reader are killed; a folder, standard input and a socket are complete."""
    done = pdpatrol("locate", EXAMPLE, "--date", "2026-01-01", "--json", "--out", "whole", cwd=tmp_path)
    expected, port = json.loads(done.stdout), free_port()
    text = "\n".join([HEADER, *ROWS, ""])
    objects = "".join(json.dumps(dict(zip(NAMES, map(float, row.split(",")), strict=True))) + "\n" for row in ROWS)
    growing, folder = tmp_path / "strengths.csv", tmp_path / "parts"
    folder.mkdir()
    for k in range(3):
        (folder / f"{k}.csv").write_text("\n".join([HEADER, *ROWS[28 * k : 28 * k + 28], ""]))
    arguments = ("--date", "2026-01-01", "--json", "--out")
    growing.write_text(text[:4000])
    reader = start(growing, *arguments, "growing", cwd=tmp_path)
    wait_for(tmp_path / "growing" / "received.csv", 10)
    reader.kill()
    reader.communicate()
    growing.write_text(text[:6000])
    with growing.open("a") as file:
        file.write("\n" + text[4000:].partition("\n")[2])  # the writer was killed, and sends its last records again
    readers = {
        "growing": start(growing, *arguments, "growing", "--idle-s", "3", cwd=tmp_path),
        "folder": start(folder, *arguments, "folder", cwd=tmp_path),
        "stdin": start("-", *arguments, "stdin", cwd=tmp_path),
        "socket": start(f"127.0.0.1:{port}", *arguments, "socket", "--idle-s", "8", cwd=tmp_path),
    }
    assert readers["stdin"].stdin is not None
    readers["stdin"].stdin.write(objects)
    readers["stdin"].stdin.close()
    readers["stdin"].stdin = None
    for part in (objects[:5000], objects[objects.rfind("\n", 0, 5000) + 1 :]):  # the first sender is killed
        deadline_s = time.monotonic() + 60.0
        while time.monotonic() < deadline_s:
            try:
                with socket.create_connection(("127.0.0.1", port)) as sender:
                    sender.sendall(part.encode())
                break
            except ConnectionRefusedError:
                time.sleep(0.1)
    wait_for(tmp_path / "folder" / "received.csv", 85)
    readers["folder"].send_signal(signal.SIGINT)
    for name, reader in readers.items():
        out, err = reader.communicate(timeout=120)
        assert reader.returncode == 0, err
        report = json.loads(out)
        assert report["findings"] == expected["findings"], name
        files = {path.name for path in (tmp_path / name).iterdir()}
        assert files == {path.name for path in (tmp_path / "whole").iterdir()} | {"received.csv"}
    again = pdpatrol("locate", "growing/received.csv", *arguments, "again", cwd=tmp_path)
    assert json.loads(again.stdout)["findings"] == expected["findings"]


def test_sources_that_cannot_be_followed_are_one_line(tmp_path: Path, refused: Refused) -> None:
    for source, message in (
        ("0.0.0.0:5000", "must be 127.0.0.1:PORT"),
        ("127.0.0.1:0", "port from 1 to 65535"),
        ("none/a.csv", "no such file or folder"),
    ):
        (line,) = refused("locate", "--follow", source, cwd=tmp_path)
        assert message in line
    (line,) = refused("locate", EXAMPLE, "--idle-s", "1", cwd=tmp_path)
    assert line == "--live and --idle-s need --follow"
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_ten_minutes_of_200_pulses_per_second_take_little_memory(tmp_path: Path) -> None:
    """Pieces of up to half a second with repeats; a computing time below 1 s each is a delay below 1 s."""
    rng, n = np.random.default_rng(5), 60_000
    time_s = 0.01 * np.arange(n)
    corners_m = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [0.0, 15.0], [0.0, 0.0]])
    side_m, along_m = np.array([0.0, 20.0, 35.0, 55.0, 70.0]), (0.5 * time_s) % 70.0
    place_m = np.column_stack([np.interp(along_m, side_m, corner_m) for corner_m in corners_m.T])
    yaw_rad = np.array([0.0, 0.5, 1.0, -0.5])[np.searchsorted(side_m, along_m, side="right") - 1] * np.pi
    boresights_rad, gains = np.radians([90, 30, -30, -90, -150, 150]), 1.0 + 0.05 * rng.standard_normal(6)
    parts: list[np.ndarray] = []
    for k, source_m in enumerate(((12.0, 8.0), (6.0, 4.0))):
        off_m = np.array(source_m) - place_m
        azimuth_rad = np.arctan2(off_m[:, 1], off_m[:, 0]) - yaw_rad
        gain = gains * GaussianPattern()(wrap(azimuth_rad[:, np.newaxis] - boresights_rad))
        strengths_v = 0.3 * gain / np.hypot(*off_m.T)[:, np.newaxis] + 1e-3 * rng.standard_normal((n, 6))
        pose = np.column_stack([time_s + 0.005 * k, place_m, np.degrees(yaw_rad)])
        parts.append(np.hstack([pose, np.maximum(strengths_v, 0.0)]))
    rows = [",".join(f"{value:.6f}" for value in row) for row in np.stack(parts, axis=1).reshape(-1, 10).tolist()]
    header = ",".join(NAMES[:10])
    follower = SurveyFollower(tmp_path, Path("long.csv"), SurveyOptions(noise_v=1e-3), list[str]().append)
    follower.add([header])
    at, memory_mb, start_mb, longest_s = 0, np.nan, np.nan, 0.0
    while at < len(rows):
        size = int(rng.integers(1, 100))
        piece, before_s = rows[max(at - int(rng.integers(0, 3)), 0) : at + size], time.process_time()
        follower.add(piece)
        at += size
        if at > 12_000:  # after a minute all code is loaded
            memory_mb = psutil.Process().memory_info().rss / 1e6
            start_mb = memory_mb if np.isnan(start_mb) else start_mb
            longest_s = max(longest_s, time.process_time() - before_s)
    assert memory_mb < 1.2 * start_mb
    assert longest_s < 1.0
    assert (tmp_path / "received.csv").read_text().count("\n") == len(rows) + 1
    sent, received = np.loadtxt(rows, delimiter=","), read_table(tmp_path / "received.csv").columns
    assert all(np.array_equal(received[name], column) for name, column in zip(NAMES, sent.T, strict=False))
