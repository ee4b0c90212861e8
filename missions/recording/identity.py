"""What a recording is called, and what tells it from others where a viewer shows several."""

from __future__ import annotations

import hashlib
import json
from typing import NamedTuple

import numpy as np
import rerun as rr

from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.scoring import Found, evaluate, true_sources

PROPERTY = "mission"
"""Of the recording: what kind of mission it is, how it ended, and what wrote it."""


def recording_stream(log: MissionLog) -> rr.RecordingStream:
    """A stream with the name and the properties of a mission as its log stands; it goes nowhere yet.

    Recordings of one scenario share an application id, so that one blueprint serves them all; recordings of one log
    share their recording id as well, so that a viewer shows them once. It is in words, for a viewer shows it where it
    has not read the name yet.
    """
    stream = rr.RecordingStream(
        f"pdpatrol {log.meta.get('name', 'mission')}",
        recording_id=f"{_kind(log)} ({_digest(log)})",
        send_properties=False,
    )
    send_identity(stream, log)
    return stream


def send_identity(stream: rr.RecordingStream, log: MissionLog) -> None:
    """Send name and properties of a mission as its log stands: at the start, and once more at the end."""
    stream.send_recording_name(recording_name(log))
    outcome, meta, time_s = _outcome(log), log.meta, log.column("step", "time_s")
    facts = {
        "scenario": meta.get("name"),
        "seed": meta.get("seed"),
        "policy": meta.get("policy"),
        "findings": outcome.n_findings,
        "sources_found": outcome.n_found,
        "sources": outcome.n_sources,
        "simulated_s": round(float(time_s[-1]), 1) if time_s.size else 0.0,
        **{f"{library}_version": number for library, number in meta.get("versions", {}).items()},
    }
    stream.send_property(PROPERTY, rr.AnyValues(**{name: fact for name, fact in facts.items() if fact is not None}))


def recording_name(log: MissionLog) -> str:
    """Scenario, seed, policy, and what has been found so far, of how many where the log holds the truth."""
    outcome = _outcome(log)
    if outcome.n_sources is not None:
        return f"{_kind(log)}: found {outcome.n_found} of {outcome.n_sources}"
    return f"{_kind(log)}: {outcome.n_findings} finding{'s' if outcome.n_findings != 1 else ''}"


def _kind(log: MissionLog) -> str:
    """Scenario, seed and policy, as far as there are any."""
    seed = None if log.meta.get("seed") is None else f"seed {log.meta['seed']}"
    return ", ".join(str(part) for part in (log.meta.get("name", "mission"), seed, log.meta.get("policy")) if part)


class _Outcome(NamedTuple):
    """What has been confirmed so far; the counts of sources are None where the log does not hold the truth."""

    n_findings: int
    n_found: int | None
    n_sources: int | None


def _outcome(log: MissionLog) -> _Outcome:
    finding = log.table("finding")
    last = finding["step"].size and finding["step"] == finding["step"][-1]
    rows = np.flatnonzero(last & (finding["state"] == "confirmed"))
    confirmed = [Found(*(finding[name][row] for name in Found._fields)) for row in rows]
    if "truth" not in log.meta:
        return _Outcome(len(confirmed), None, None)
    sources = evaluate(confirmed, true_sources(log.meta["truth"])).sources
    return _Outcome(len(confirmed), sum(source.found for source in sources), len(sources))


def _digest(log: MissionLog) -> str:
    """Of the facts of a mission and of how it went so far."""
    digest = hashlib.sha256(json.dumps(log.meta, sort_keys=True).encode())
    for table, column in (("step", "pose"), ("finding", "position_m")):
        digest.update(np.ascontiguousarray(log.column(table, column)).tobytes())
    return digest.hexdigest()[:8]
