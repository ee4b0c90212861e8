"""Merging of tracks."""

import numpy as np

from dirmusic.locating.initiation import APART_M
from dirmusic.locating.track import TWINS_APART_M, Track, merge

MERGE_M = 0.3


def track_at(x_m: float, number: int, initiated_s: float = 0.0, confirmed_s: float | None = None) -> Track:
    """Create a track, confirmed at a time or never."""
    return Track(
        id=number,
        position_m=np.array([x_m, 5.0, 1.0]),
        covariance_m2=0.01 * np.eye(3),
        uncertainty=0.01 * np.eye(3),
        initiated_s=initiated_s,
        first_s=initiated_s,
        last_s=initiated_s,
        direct=np.empty(0),
        multipath=np.empty(0),
        state="candidate" if confirmed_s is None else "confirmed",
        confirmed_s=confirmed_s,
    )


def kept(*tracks: Track) -> set[int]:
    """Return the ids of the tracks that remain."""
    return {track.id for track in merge(list(tracks), MERGE_M)}


def test_tracks_of_one_place_become_one() -> None:
    """Keep the first, or the confirmed one, and both if they are farther apart."""
    assert kept(track_at(4.0, 1), track_at(4.0 + 0.9 * MERGE_M, 2)) == {1}
    assert kept(track_at(4.0, 1), track_at(4.0 + 0.9 * MERGE_M, 2, confirmed_s=9.0)) == {2}
    assert kept(track_at(4.0, 1), track_at(4.0 + 1.1 * MERGE_M, 2)) == {1, 2}


def test_candidate_near_a_source_that_was_confirmed_before_is_merged() -> None:
    """Reflections of a confirmed source cause candidates near it; a candidate that is older than it remains."""
    source = track_at(4.0, 1, confirmed_s=50.0)
    near_m, far_m = 4.0 + 0.9 * APART_M, 4.0 + 1.1 * APART_M
    assert kept(source, track_at(near_m, 2, initiated_s=60.0)) == {1}
    assert kept(source, track_at(far_m, 2, initiated_s=60.0)) == {1, 2}
    assert kept(source, track_at(near_m, 2, initiated_s=40.0)) == {1, 2}
    assert kept(source, track_at(near_m, 2, initiated_s=60.0, confirmed_s=70.0)) == {1, 2}


def test_twins_may_be_closer_until_they_part() -> None:
    """Two tracks that were split are merged only at nearly one position; far apart, they are ordinary tracks."""
    for off_m, both_remain in ((0.5 * TWINS_APART_M, False), (0.5 * (TWINS_APART_M + MERGE_M), True)):
        source, twin = track_at(4.0, 1, confirmed_s=50.0), track_at(4.0 + off_m, 2, initiated_s=60.0)
        twin.twin = source.id
        assert kept(source, twin) == ({1, 2} if both_remain else {1})
    source, twin = track_at(4.0, 1, confirmed_s=50.0), track_at(4.0 + 1.1 * APART_M, 2, initiated_s=60.0)
    twin.twin = source.id
    assert kept(source, twin) == {1, 2}
    assert twin.twin == 0
