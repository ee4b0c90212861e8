"""Which pulse belongs to which finding: by where it points, by what the map hides, and by how loud it is.

Behind equipment every pulse comes round a corner or from a mirror: a perfectly consistent, wrong point source. Two
things tell: the map, if there is one, since what mirrors stands between the robot and the mirror image; and the
strength, since strength times range is the same for all that comes straight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dirmusic.angles import difference
from dirmusic.array.bounds import manifold_error, manifold_error_std
from dirmusic.array.element_errors import ElementErrors
from dirmusic.array.model import ArrayModel
from dirmusic.locating.finding import Finding
from dirmusic.locating.joint_fix import PoseError
from dirmusic.pulses.batch import PulseBatch

FloatArray = NDArray[np.float64]

InSight = Callable[[FloatArray, FloatArray, float], NDArray[np.bool_]]
"""(points (n, 2), target (2,), metres at the target's end that do not count) -> whether known equipment leaves the
target in sight, (n,)."""

NEAR_FIELD_SHARE = 0.5
"""Share of the ring's radius by which a far-field bearing may miss a source close by (assumed)."""

UNASSIGNED, AMBIGUOUS, ECHO = -1, -2, -3


@dataclass(frozen=True, kw_only=True)
class AssignmentRules:
    """When a pulse belongs to a finding. All values are assumed.

    Attributes:
        gate_sigmas: How far from a finding a bearing may point and still belong to it.
        level_s: Pulses within so long and so wide an arc are judged by their median strength.
        level_arc_rad: See above.
        hidden_db: A finding's pulses this much weaker than strength over range says came round a corner.
        loud_db: A confirmed finding's pulses that are no weaker than this below its level came straight, whatever the
            map says: what hides takes more.
        echo_db: While the map hides a confirmed finding, pulses that are not this much louder than it would be in sight
            are its echoes, wherever they point.
        blur_rad: While it is in sight, pulses as loud as it would be that point past it by so much are its own, bent by
            a reflection; they are left out.
        blur_db: As loud means within this.
        inside_m: A finding this far behind a surface is still in sight: it sits on it, and is not known better.
        edge_m: What would be hidden so far to one side may be hidden: map and poses are no better known.
        near_m: From where a finding in sight should be heard.
    """

    gate_sigmas: float = 3.0
    level_s: float = 1.0
    level_arc_rad: float = np.radians(30.0)
    hidden_db: float = 10.0
    loud_db: float = 4.0
    echo_db: float = 2.0
    blur_rad: float = np.radians(20.0)
    blur_db: float = 5.0
    inside_m: float = 0.6
    edge_m: float = 0.5
    near_m: float = 6.0


class Assignment(NamedTuple):
    """Who each pulse belongs to.

    Attributes:
        owner: Position of the finding, or UNASSIGNED, AMBIGUOUS (two findings, or one bent), or ECHO; shape (n,).
        in_sight: Whether the map leaves the owner in sight from where the pulse was heard, shape (n,).
        level_db: Level that the owner would have 1 m away by pulses of that time, shape (n,), dB over 1 V.
    """

    owner: NDArray[np.intp]
    in_sight: NDArray[np.bool_]
    level_db: FloatArray


class PulseRecord:
    """All credible pulses so far.

    Args:
        array: The array's data sheet and spread.
        pose_error: How wrong the poses are.
        rules: When a pulse belongs to a finding.
        in_sight: What the map says; None without a map.
    """

    def __init__(
        self, array: ArrayModel, pose_error: PoseError, rules: AssignmentRules, in_sight: InSight | None
    ) -> None:
        self.array = array
        self.pose_error = pose_error
        self.rules = rules
        self._in_sight = in_sight
        self.pulses = PulseBatch.none(array.manifold.n_elements)
        self.pose = np.empty((0, 3))
        self._level_db = np.empty(0)
        self._places_m = np.empty((0, 2))
        self._place = np.empty(0, dtype=np.intp)
        self._aperture_m = float(np.linalg.norm(array.positions_m[:, :2], axis=-1).max())

    def add(self, time_s: float, pose: FloatArray, pulses: PulseBatch) -> None:
        """Credible pulses that were detected at one pose (3,); they get the time of the pose."""
        n = pulses.n_pulses
        norm_v = np.linalg.norm(pulses.strengths_v * pulses.is_usable, axis=-1)
        self.pulses = PulseBatch.join([self.pulses, pulses._replace(time_s=np.full(n, time_s))])
        self.pose = np.concatenate([self.pose, np.tile(pose, (n, 1))])
        self._place = np.concatenate([self._place, np.full(n, len(self._places_m))])
        self._places_m = np.concatenate([self._places_m, pose[np.newaxis, :2]])
        self._level_db = np.concatenate([self._level_db, 20 * np.log10(norm_v)])

    def bearings(self, index: NDArray[np.intp], errors: ElementErrors) -> tuple[FloatArray, FloatArray]:
        """World bearings of some with the array's known errors taken out, and their deviation with what is left."""
        azimuth, manifold = self.pulses.azimuth_rad[index], self.array.manifold
        common = manifold_error_std(manifold, azimuth, self.array.spread)
        variance = self.pulses.std_rad[index] ** 2 + common**2 + self.pose_error.heading_rad**2
        world = azimuth - manifold_error(manifold, azimuth, errors) + self.pose[index, 2]
        return world, np.sqrt(variance)

    def assign(self, findings: Sequence[Finding], errors: ElementErrors) -> Assignment:
        """Who all pulses belong to, with the array's errors as known."""
        n, rules = self.pulses.n_pulses, self.rules
        if not findings or n == 0:
            return Assignment(np.full(n, UNASSIGNED), np.ones(n, dtype=np.bool_), np.full(n, np.nan))
        bearing, std = self.bearings(np.arange(n), errors)
        loudness_db = self._loudness_db(bearing)
        shape = len(findings), n
        off, level_db, in_sight = np.empty(shape), np.empty(shape), np.ones(shape, dtype=np.bool_)
        is_echo, is_bent = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        for k, finding in enumerate(findings):
            sight = finding.position_m - self.pose[:, :2]
            range_m = np.maximum(np.linalg.norm(sight, axis=-1), 0.3)
            across = np.stack([-sight[:, 1], sight[:, 0]], axis=-1) / range_m[:, np.newaxis]
            spread_m2 = np.einsum("ni,ij,nj->n", across, finding.covariance_m2, across)
            spread_m2 += self.pose_error.position_m**2 + (NEAR_FIELD_SHARE * self._aperture_m) ** 2
            allowed = np.sqrt(std**2 + np.minimum(spread_m2 / range_m**2, np.radians(15.0) ** 2))
            past = np.abs(difference(bearing, np.arctan2(sight[:, 1], sight[:, 0])))
            off[k] = past / allowed
            level_db[k] = loudness_db + 20 * np.log10(range_m)
            if self._in_sight is not None:
                in_sight[k] = self._in_sight(self._places_m, finding.position_m, rules.inside_m)[self._place]
            if np.isnan(finding.level_db):
                continue
            louder_db = level_db[k] - finding.level_db
            is_hidden = (off[k] <= rules.gate_sigmas) & (louder_db < -rules.hidden_db)
            off[k, is_hidden] = np.inf
            is_echo |= is_hidden
            if finding.state == "confirmed":
                in_sight[k] |= (off[k] <= rules.gate_sigmas) & (louder_db > -rules.loud_db)
                is_clear = in_sight[k] & self._is_clear_of_edges(finding)
                is_echo |= ~is_clear & (louder_db < rules.echo_db)
                is_bent |= in_sight[k] & (past < rules.blur_rad) & (np.abs(louder_db) < rules.blur_db)
        rows, owner = np.arange(n), off.argmin(axis=0)
        is_owned, is_seen = off.min(axis=0) <= rules.gate_sigmas, in_sight[owner, rows]
        own_level_db = level_db[owner, rows]
        is_fixed = np.array([finding.state == "confirmed" for finding in findings])[owner]
        owner[~is_owned] = np.where(is_bent, AMBIGUOUS, UNASSIGNED)[~is_owned]
        owner[(off <= rules.gate_sigmas).sum(axis=0) > 1] = AMBIGUOUS
        owner[is_echo & ~(is_owned & is_seen & is_fixed)] = ECHO
        return Assignment(owner, is_seen, own_level_db)

    def presence(self, finding: Finding, own: NDArray[np.intp]) -> tuple[float, int]:
        """Whether a finding is heard where it should be: near it and in sight of it.

        Args:
            finding: What is asked about.
            own: Its pulses.

        Returns:
            Of the seconds since it was first heard in which anything was heard there, the share with its pulses, and
            how many they are. Without a map, which tells nothing, 1 and 0.
        """
        if self._in_sight is None:
            return 1.0, 0
        is_near = np.linalg.norm(self._places_m - finding.position_m, axis=-1) < self.rules.near_m
        is_near[is_near] = self._in_sight(self._places_m[is_near], finding.position_m, self.rules.inside_m)
        second = np.floor(self.pulses.time_s)
        heard = np.unique(second[is_near[self._place] & (self.pulses.time_s >= finding.first_heard_s)])
        return np.intersect1d(heard, second[own]).size / max(heard.size, 1), heard.size

    def _is_clear_of_edges(self, finding: Finding) -> NDArray[np.bool_]:
        """Whether a finding a little to either side would be in sight too, for each pulse, shape (n,)."""
        if self._in_sight is None:
            return np.ones(self._place.size, dtype=np.bool_)
        clear = np.ones(len(self._places_m), dtype=np.bool_)
        for aside_m in np.array([[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]]) * self.rules.edge_m:
            clear &= self._in_sight(
                self._places_m, finding.position_m + aside_m, self.rules.inside_m + self.rules.edge_m
            )
        return clear[self._place]

    def _loudness_db(self, bearing: FloatArray) -> FloatArray:
        """Median strength of the pulses of one time and one direction, shape (n,), dB over 1 V."""
        time = np.floor(self.pulses.time_s / self.rules.level_s)
        sector = np.floor(np.mod(bearing, 2 * np.pi) / self.rules.level_arc_rad)
        order = np.lexsort((self._level_db, sector, time))
        is_new = np.diff(time[order], prepend=-np.inf) + np.abs(np.diff(sector[order], prepend=-1.0)) > 0
        starts = np.flatnonzero(is_new)
        counts = np.diff(np.append(starts, order.size))
        loudness = np.empty(order.size)
        loudness[order] = np.repeat(self._level_db[order[starts + counts // 2]], counts)
        return loudness
