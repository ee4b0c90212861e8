r"""Registration: displacement and rotation of the localisation against the map, estimated from the scans of the lidar.

The localisation gives a place m of the map the coordinates

.. math:: q = c + R(\theta)(m - c) + o + e

with the displacement o and the rotation :math:`\theta` about the dock c, which are constant during a mission, and the
pose error e, a first-order Gauss-Markov process. The end point of a beam lies on the outline of a solid. Its signed
distance from the outline that the map shows is, linearised,

.. math:: r_i = n_i^T (H_i x + G_i e_k - d_j) + \text{noise}

with the normal :math:`n_i`, the frame :math:`x = (o, \theta)`, the pose error :math:`e_k` of the scan, and the
displacement :math:`d_j` on the map of the piece j. The prior of :math:`d_j` is a Student t distribution, so that pieces
that the map shows at a wrong place lose their weight. Its scale, the accuracy of the map, is estimated as well; the
stated accuracy counts as much as one piece. So is the variance of the pose error, if it is larger than believed.

The sum of the information of all scans is kept, without past pose errors, which are marginalised exactly. The scans are
kept as well: when the frame moves, their points are associated with outlines again.

References:
    Thrun, Burgard and Fox, "Probabilistic Robotics", 2005: likelihood fields (6.4), information filter (3.5).
    Lange, Little and Taylor, "Robust statistical modeling using the t distribution", 1989: weights.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import inv
from scipy.ndimage import distance_transform_edt
from scipy.special import logsumexp

from dirmusic.angles import unit_vector
from dirmusic.arrays import FloatArray, IntArray
from dirmusic.frame import FrameEstimate, turned
from pdpatrol.envs import Scenario
from pdpatrol.envs.observation import Observation
from pdpatrol.missions.driving.lidar_stop import BEAM_RAD
from pdpatrol.robot_models.sensors import LIDAR_RANGE_M
from pdpatrol.robot_models.yard.solids import YardSolids
from pdpatrol.robot_models.yard.yard import Yard

SCAN_PERIOD_S = 5.0
"""Time between the scans that are used. Assumed; the default correlation time of the pose error, which makes closer
scans nearly redundant."""

FENCE_STD_M, LEAST_ACCURACY_M = 0.05, 0.01
"""Standard deviation of the displacements of the sides of the fence, and the smallest one of pieces. Assumed; the fence
defines the frame of the map, so only its unevenness counts. Stated deviations at the dock are proportional to it."""

POSE_SCANS = 4.0
"""Weight of the believed variance of the pose error in its estimate, in scans. Assumed; the estimate is used only if it
is larger, so that stated deviations stay honest when poses are worse than believed."""

SURFACE_STD_M = 0.02
"""Standard deviation of end points about a known outline from a known pose, besides the noise of the lidar. Assumed;
together they are 0.024 m in simulated yards (measured)."""

FREEDOM = 4.0
"""Degrees of freedom of the Student t distributions. Assumed; the usual choice of the reference."""

GATE_M = 0.5
"""Largest distance of an end point from an outline; beyond it, it belongs to something that the map does not show.
Assumed; larger than the displacements of pieces that are to be recognised."""

CELL_M, MARGIN_M = 0.2, 3.0
"""Cell of the grid that gives the solid nearest to a point, and its margin around the yard. Assumed; the grid only
selects the solid, and the distance to it is exact."""

SEARCH_M, SEARCH_RAD = 0.3 * np.arange(-6, 7), np.radians(1.5) * np.arange(-3, 4)
"""Displacements and rotations among which the frame is searched. Assumed; one step in rotation moves a point at the
maximum range by one step of the displacement."""

SEARCH_STD_M, SEARCH_SCANS, SEARCH_OUTLIERS = 0.25, 4, 0.05
"""Scale of distances in the search, maximum number of scans in it, and density of outliers relative to that of points
on an outline. Assumed; the search only selects where to linearise."""

SIGNIFICANT = 21.1
"""Squared Mahalanobis distance of the frame from zero at which poses are corrected: the chi-square quantile of three
degrees of freedom that is exceeded with probability 1e-4. In sound missions with a correct map it stays below 12
(measured)."""

DISAGREEMENT_M, DISAGREEMENT_STD_RAD = 0.2, np.radians(0.15)
"""Smallest displacement anywhere in the yard that is reported, and largest standard deviation of the rotation at that
time. Assumed; smaller displacements hardly matter for findings within 0.3 m."""


class LidarScan(NamedTuple):
    """Scan of the lidar in the frame of the localisation.

    Attributes:
        time_s: Time of the scan.
        place_m: Position of the robot, shape (2,).
        arm_m: End points relative to the robot, shape (n, 2).
    """

    time_s: float
    place_m: FloatArray
    arm_m: FloatArray


class Outlines:
    """Outlines of the fence and of all solids that the lidar of a robot on level ground can hit.

    Args:
        yard: Fence and equipment.
        height_m: Height of the lidar.

    Attributes:
        solids: The solids, each with its piece as owner; the last four are the sides of the fence, pieces of their own.
        n_pieces: Number of pieces.
    """

    def __init__(self, yard: Yard, height_m: float) -> None:
        size_m, n = np.array(yard.size_m), len(yard.equipment)
        own = yard.solids.take((yard.solids.bottom_m < height_m) & (yard.solids.top_m > height_m))
        outward = np.array([[0, -1], [0, 1], [-1, 0], [1, 0]])
        middle_m, half_m = 0.5 * size_m * (1 + outward) + MARGIN_M * outward, np.where(outward, MARGIN_M, 0.5 * size_m)
        zeros = np.zeros(4)
        fence = YardSolids(middle_m, zeros, half_m, zeros, zeros, zeros, n + np.arange(4))
        pairs = zip(vars(own).values(), vars(fence).values(), strict=True)
        self.solids, self.n_pieces = YardSolids(*map(np.concatenate, pairs)), n + 4
        points_m, of = self._sample()
        is_visible = ((points_m > -0.01) & (points_m < size_m + 0.01)).all(axis=-1)  # not the outside of the fence
        self._shape = np.ceil((size_m + 2 * MARGIN_M) / CELL_M).astype(int)
        nearest = np.full(self._shape, -1)
        nearest[self._cells(points_m[is_visible])] = of[is_visible]
        distance_m, cells = distance_transform_edt(nearest < 0, CELL_M, return_indices=True)
        # half, because the points of a scan share errors (assumed)
        self._log_likelihood = 0.5 * np.log(np.exp(-0.5 * np.square(distance_m / SEARCH_STD_M)) + SEARCH_OUTLIERS)
        self._nearest = nearest[tuple(cells)]

    def _sample(self) -> tuple[FloatArray, IntArray]:
        """Return points on all outlines, at most a cell apart, shape (n, 2), and the solid of each, shape (n,)."""
        solids = self.solids
        n_points = np.ceil(4.0 * np.pi / CELL_M * (solids.half_size_m.max(axis=-1) + solids.radius_m)).astype(int)
        of = np.repeat(np.arange(n_points.size), n_points)
        number = np.arange(of.size) - (np.cumsum(n_points) - n_points)[of]
        unit = unit_vector(2.0 * np.pi * number / n_points[of])
        square = unit / np.abs(unit).max(axis=-1, keepdims=True)
        points_m = solids.half_size_m[of] * square + solids.radius_m[of, np.newaxis] * unit
        return solids.centre_m[of] + turned(points_m, solids.yaw_rad[of]), of

    def _cells(self, points_m: FloatArray) -> tuple[IntArray, ...]:
        cells = np.clip(((points_m + MARGIN_M) / CELL_M).astype(int), 0, self._shape - 1)
        return tuple(np.moveaxis(cells, -1, 0))

    def log_likelihood(self, points_m: FloatArray) -> FloatArray:
        """Return the sum of the log-likelihoods of end points (..., n, 2), with a bound for outliers; shape (...)."""
        return self._log_likelihood[self._cells(points_m)].sum(axis=-1)

    def meet(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Return signed distance (n,), outward normal (n, 2) and piece (n,) of the solid nearest to points (n, 2)."""
        solids, of = self.solids, self._nearest[self._cells(points_m)]
        own_m = turned(points_m - solids.centre_m[of], -solids.yaw_rad[of])
        beyond_m = np.abs(own_m) - solids.half_size_m[of]
        inside_m = np.minimum(beyond_m.max(axis=-1), 0.0)
        towards = np.where(
            inside_m[:, np.newaxis] < 0.0, beyond_m == inside_m[:, np.newaxis], np.maximum(beyond_m, 0.0)
        )
        length = np.maximum(np.linalg.norm(towards, axis=-1), 1e-9)
        distance_m = np.where(inside_m < 0.0, inside_m, length) - solids.radius_m[of]
        normal = turned(np.copysign(towards / length[:, np.newaxis], own_m), solids.yaw_rad[of])
        return distance_m, normal, solids.owner[of]


class Registration:
    """Estimator of displacement and rotation of the localisation against the map.

    Poses are corrected once the estimate is significant (`SIGNIFICANT`), and from then on always. Before that, the
    error is at most a few of its standard deviations, and the stated covariance includes it; so the correction changes
    nothing in missions whose frames agree.

    Args:
        scenario: Scenario of the mission: dock, and beliefs about lidar, poses and frames.
        yard: The yard as the map shows it.

    Attributes:
        frame: Current estimate.
    """

    def __init__(self, scenario: Scenario, yard: Yard) -> None:
        sensor, self._size_m = scenario.pose_sensor, yard.size_m
        self._outlines = Outlines(yard, scenario.robot.description.lidar_height_m)
        self._noise_variance = scenario.lidar.range_std_m**2 + SURFACE_STD_M**2
        self._pose_variance = self._believed_variance = np.square(np.maximum(sensor.std, 1e-4))
        self._pose_square = POSE_SCANS * self._believed_variance
        self._correlation = sensor.correlation
        # offset, rotation and each piece have a Student t prior: state variables, squared scale, and mean square
        n_pieces, self._accuracy_m2 = self._outlines.n_pieces, max(scenario.map.accuracy_m, LEAST_ACCURACY_M) ** 2
        self._group = np.append([0, 0, 1], np.repeat(2 + np.arange(n_pieces), 2))
        self._scale2 = np.append(np.square(sensor.frame_std[1:]), np.full(n_pieces, self._accuracy_m2))
        self._scale2[-4:] = FENCE_STD_M**2
        self._square = np.bincount(self._group) * self._scale2
        self._unknown: FloatArray = np.diag(np.square(sensor.frame_std))
        self._mean: FloatArray = np.zeros(3)
        self._covariance: FloatArray = self._unknown
        self._scans: list[LidarScan] = []
        self._is_found = False
        self.frame = FrameEstimate(np.array(scenario.route.dock_m), self._mean, self._covariance)
        self._linearise_at(self._mean)

    @property
    def disagreement(self) -> str:
        """One sentence for people if the frames disagree so much that it matters; empty if not, or not yet known."""
        frame, std = self.frame, np.sqrt(np.diag(self.frame.covariance))
        corners_m = np.array([(0, 0), (0, 1), (1, 0), (1, 1)]) * self._size_m
        if frame.displacement_at(corners_m).max() < DISAGREEMENT_M or std[2] > DISAGREEMENT_STD_RAD:
            return ""
        turn_deg, turn_std_deg = np.degrees([abs(frame.offset[2]), std[2]])
        return (
            f"localisation and map disagree by {turn_deg:.1f} +- {turn_std_deg:.1f} degrees and "
            f"{np.hypot(*frame.offset[:2]):.2f} +- {np.hypot(*std[:2]):.2f} m at the dock: poses are corrected"
        )

    def corrected(self, observation: Observation, localised: FloatArray) -> tuple[Observation, FloatArray]:
        """Return an observation and its pose (3,) on the map; the same objects while poses are not corrected.

        Args:
            observation: Observation of the environment.
            localised: Its pose as the localisation gives it, x m, y m, yaw rad, shape (3,).
        """
        frame = self.frame
        if not frame.is_applied:
            return observation, localised
        pose = frame.on_map(localised)
        on_map = {
            "pose": np.array([*pose[:2], np.cos(pose[2]), np.sin(pose[2])], dtype=np.float32),
            "bearing": turned(observation["bearing"].astype(np.float64), -frame.offset[2]).astype(np.float32),
        }
        return observation | on_map, pose

    def update(self, time_s: float, pose: FloatArray, lidar_m: NDArray[np.floating]) -> bool:
        """Add a scan if at least `SCAN_PERIOD_S` have passed since the last one, and return whether it was added.

        Args:
            time_s: Time of the scan.
            pose: Pose of the localisation, x m, y m, yaw rad, shape (3,).
            lidar_m: Ranges from the robot's middle, shape (n_beams,).
        """
        if self._scans and time_s < self._scans[-1].time_s + SCAN_PERIOD_S - 1e-6:
            return False
        hit = lidar_m < LIDAR_RANGE_M
        arm_m = lidar_m[hit, np.newaxis].astype(np.float64) * unit_vector(pose[2] + BEAM_RAD[hit])
        self._scans.append(LidarScan(time_s, pose[:2].copy(), arm_m))
        n_scans = len(self._scans)
        if n_scans.bit_count() == 1 or (not self._is_found and n_scans < 32):  # so that the total time is linear
            self._search()
            self._relinearise()
        else:
            self._add(self._scans[-1])
            self._solve()
            if self._has_moved():
                self._relinearise()
        self._pose_square = self._pose_square + self._latest_square
        expected = self._pose_square / (POSE_SCANS + n_scans)
        expected[:2] = expected[:2].mean()
        self._pose_variance = np.maximum(expected, self._believed_variance)
        self._decide()
        return True

    def _decide(self) -> None:
        """Set the frame from mean and covariance."""
        mean, covariance = self._mean, self._covariance
        if not self._is_found:
            mean, covariance = np.zeros(3), self._unknown
        if not self.frame.is_applied and mean @ np.linalg.inv(covariance) @ mean < SIGNIFICANT:
            column = mean[:, np.newaxis]
            mean, covariance = np.zeros(3), covariance + column @ column.T
        self.frame = FrameEstimate(self.frame.pivot_m, mean, covariance)

    def _on_map(self, scan: LidarScan, frames: FloatArray) -> FloatArray:
        """Return the end points of a scan on the map for frames (..., 3), shape (..., n, 2)."""
        pivot_m, frame = self.frame.pivot_m, frames[..., np.newaxis, :]
        return pivot_m + turned(scan.place_m + scan.arm_m - pivot_m - frame[..., :2], -frame[..., 2])

    def _search(self) -> None:
        """Linearise at the best frame of a grid if it is better than the present one; note whether it stands out."""
        grid = np.stack(np.meshgrid(SEARCH_M, SEARCH_M, SEARCH_RAD), axis=-1).reshape(-1, 3)
        frames = np.vstack([self._mean, grid])
        square = np.stack([np.square(frames[:, :2]).sum(axis=-1), np.square(frames[:, 2])], axis=-1)
        score = -0.5 * np.log1p(square / (FREEDOM * self._scale2[:2])) @ (FREEDOM + np.array([2.0, 1.0]))
        for k in np.unique(np.linspace(0, len(self._scans) - 1, SEARCH_SCANS).astype(int)):
            score += self._outlines.log_likelihood(self._on_map(self._scans[k], frames))
        best = score.argmax() if score.max() > score[0] + 2.0 else 0  # the grid is coarse (assumed)
        self._mean = frames[best]
        off = np.abs(frames - self._mean)
        is_near = (off[:, :2].max(axis=-1) < 0.75) & (off[:, 2] < np.radians(4.0))  # within 2 steps of the grid
        self._is_found = bool(logsumexp(score[~is_near]) < logsumexp(score) + np.log(0.05))

    def _relinearise(self) -> None:
        """Associate the points of all scans at the estimate, until it no longer moves."""
        for _ in range(8):
            self._linearise_at(self._mean)
            for scan in self._scans:
                self._add(scan)
            self._solve()
            if not self._has_moved():
                break

    def _has_moved(self) -> bool:
        """Return True if the estimate is too far from where it was linearised: 3 cm or 0.2 degrees (assumed)."""
        return bool((np.abs(self._mean - self._at) > [0.03, 0.03, np.radians(0.2)]).any())

    def _linearise_at(self, frame: FloatArray) -> None:
        """Discard all information and linearise at a frame (3,).

        The state is the frame, 0 to 2, the present pose error, 3 to 5, and x and y of each piece.
        """
        n = 6 + 2 * self._outlines.n_pieces
        self._at, self._time_s = frame, -np.inf
        self._information, self._vector = np.zeros((n, n)), np.zeros(n)
        self._information[range(3, 6), range(3, 6)] = 1.0 / self._pose_variance

    def _add(self, scan: LidarScan) -> None:
        """Add the information of a scan later than all others."""
        self._predict(scan.time_s)
        distance_m, normal, piece = self._outlines.meet(place_m := self._on_map(scan, self._at))
        arm_m = turned(scan.arm_m, -self._at[2])
        is_facing = (normal * arm_m).sum(axis=-1) < -0.1 * np.linalg.norm(arm_m, axis=-1)  # 6 degrees (assumed)
        kept = np.flatnonzero(is_facing & (np.abs(distance_m) < GATE_M))
        piece = piece[kept]
        distance_m, normal, place_m, arm_m = (values[kept] for values in (distance_m, normal, place_m, arm_m))
        # derivative of the distance by the state
        rows, row = np.zeros((kept.size, self._vector.size)), np.arange(kept.size)
        rows[:, :2] = rows[:, 3:5] = -turned(normal, self._at[2])
        rows[:, 2] = -(normal * turned(place_m - self.frame.pivot_m)).sum(axis=-1)
        rows[:, 5] = -(normal * turned(arm_m)).sum(axis=-1)
        rows[row, 6 + 2 * piece], rows[row, 7 + 2 * piece] = -normal.T
        expected_m2 = self._noise_variance + self._scale2[2 + piece] + np.square(rows[:, 3:6]) @ self._pose_variance
        weight = (FREEDOM + 1.0) / (FREEDOM + np.square(distance_m) / expected_m2) / self._noise_variance
        information, vector = self._information, self._vector
        information += rows.T @ (weight[:, np.newaxis] * rows)
        vector -= rows.T @ (weight * distance_m)

    def _predict(self, time_s: float) -> None:
        """Replace the pose error in the state by that at a later time, and marginalise the former."""
        past, own, information, vector = self._time_s, slice(3, 6), self._information, self._vector
        self._time_s = time_s
        if past == -np.inf:
            return
        rho = self._correlation(time_s - past)
        gain = 1.0 / ((1.0 - rho * rho) * self._pose_variance)
        inverse = np.linalg.inv(information[own, own] + np.diag(rho * rho * gain))
        cross, pull = information[:, own].copy(), vector[own].copy()
        cross[own] = -rho * np.diag(gain)
        information[own, :], information[:, own], vector[own] = 0.0, 0.0, 0.0
        information[own, own] = np.diag(gain)
        information -= cross @ inverse @ cross.T
        vector -= cross @ inverse @ pull

    def _solve(self) -> None:
        """Solve for mean and covariance of the frame, and take a step of expectation maximisation for the scales."""
        is_known = self._information.diagonal() > 0.0
        is_known[:3] = True
        known, with_prior = np.flatnonzero(is_known), np.delete(np.arange(is_known.size), [3, 4, 5])
        base, precision, variance, change = np.zeros((4, is_known.size))
        base[:3], precision[with_prior] = self._at, (self._weights() / self._scale2)[self._group]
        covariance = inv((self._information + np.diag(precision))[np.ix_(known, known)])
        change[known] = covariance @ (self._vector - precision * base)[known]
        variance[with_prior], variance[known] = self._scale2[self._group], covariance.diagonal()
        self._mean, self._covariance = self._at + change[:3], covariance[:3, :3]
        self._latest_square = np.square(change[3:6]) + covariance.diagonal()[3:6]
        self._square = np.bincount(self._group, (np.square(base + change) + variance)[with_prior])
        is_seen = is_known[6:-8:2]  # without the fence
        seen_m2 = 0.5 * (self._weights() * self._square)[2:-4][is_seen].sum()
        self._scale2[2:-4] = (self._accuracy_m2 + seen_m2) / (1 + is_seen.sum())

    def _weights(self) -> FloatArray:
        """Return the mean precisions of the variables with a prior, relative to their scale."""
        return (FREEDOM + np.bincount(self._group)) / (FREEDOM + self._square / self._scale2)
