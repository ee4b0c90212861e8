r"""Registration: displacement and rotation of the localisation against the map, estimated from the scans of the lidar.

The localisation gives a place m of the map the coordinates

.. math:: q = c + R(\theta)(m - c) + o + e

with the displacement o and the rotation :math:`\theta` about the dock c, which are constant during a mission, and the
pose error e, a first-order Gauss-Markov process. The end point of a beam lies on the outline of a solid. Its signed
distance from the outline that the map shows is, linearised,

.. math:: r_i = n_i^T (H_i x + G_i e_k - d_j) + \text{noise}

with the normal :math:`n_i`, the frame :math:`x = (o, \theta)`, the pose error :math:`e_k` of the scan, and the
displacement :math:`d_j` on the map of the piece j, which is normally distributed with the stated accuracy of the map.
End points far from an outline have less weight. The variance of the pose error is estimated as well, and used if it is
larger than believed; the Locator uses it if it is much larger (`WORSE`).

The sum of the information of all scans is kept, without past pose errors, which are marginalised exactly. The scans are
kept as well: when the frame moves, their points are associated with outlines again.

References:
    Thrun, Burgard and Fox, "Probabilistic Robotics", 2005: likelihood fields (6.4), information filter (3.5).
    Lange, Little and Taylor, "Robust statistical modeling using the t distribution", 1989: weights.
"""

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
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

FENCE_STD_M, LEAST_ACCURACY_M = 0.02, 0.01
"""Standard deviation of the displacements of the sides of the fence, and the smallest one of pieces. Assumed; the fence
defines the frame of the map, so only its unevenness counts, of which the scans see the mean over each side. Stated
deviations at the dock are 0.022 to 0.027 m with it, and errors 0.016 to 0.021 m (measured in simulated yards)."""

POSE_SCANS = 4.0
"""Weight of the believed variance of the pose error in its estimate, in scans. Assumed; the estimate is used only if it
is larger, so that stated deviations stay honest when poses are worse than believed."""

WORSE = 1.5
"""Ratio of estimated to believed deviation of positions or headings from which on the Locator is given the estimate.
Assumed; in sound missions it is at most 1.34 at the end, and about 2 where errors are doubled or headings have a bias
of a degree (measured in simulated yards, where estimates for headings follow their errors within about 15 %)."""

SURFACE_STD_M = 0.02
"""Standard deviation of end points about a known outline from a known pose, besides the noise of the lidar. Assumed;
together they are 0.024 m in simulated yards (measured)."""

FREEDOM = 4.0
"""Degrees of freedom of the Student t distributions, of distances and of the frame in the search. Assumed; the usual
choice of the reference."""

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


POSE, FRAME = slice(0, 3), slice(3, 6)
"""Present pose error and frame in the state."""


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
        solids: The solids, each with its piece as owner. The last ones are the sides of the fence, each a
            separate piece.
        n_pieces: Number of pieces.
        n_sides: Number of sides of the fence.
    """

    def __init__(self, yard: Yard, height_m: float) -> None:
        size_m, n, n_sides = np.array(yard.size_m), len(yard.equipment), len(yard.side_names)
        own = yard.solids.take((yard.solids.bottom_m < height_m) & (yard.solids.top_m > height_m))
        fence = yard.fence_solids(2.0 * MARGIN_M, height_m)
        fence = replace(fence, owner=n + fence.owner)
        pairs = zip(vars(own).values(), vars(fence).values(), strict=True)
        self.solids, self.n_pieces, self.n_sides = YardSolids(*map(np.concatenate, pairs)), n + n_sides, n_sides
        points_m = self._sample()
        inside_m = yard.fence.signed_distance(points_m)
        inside_m[-n_sides:] = -np.abs(inside_m[-n_sides:])  # of the fence, only the inner faces are visible
        solid, point = np.nonzero(inside_m > -0.01)
        self._shape = np.ceil((size_m + 2 * MARGIN_M) / CELL_M).astype(int)
        nearest = np.full(self._shape, -1)
        nearest[self._cells(points_m[solid, point])] = solid
        distance_m, cells = distance_transform_edt(nearest < 0, CELL_M, return_indices=True)
        # half, because the points of a scan share errors (assumed)
        self._log_likelihood = 0.5 * np.log(np.exp(-0.5 * np.square(distance_m / SEARCH_STD_M)) + SEARCH_OUTLIERS)
        self._nearest = nearest[tuple(cells)]

    def _sample(self) -> FloatArray:
        """Return points on the outlines of all solids, at most a cell apart, shape (n_solids, n_points, 2)."""
        solids = self.solids
        longest_m = 4.0 * np.pi * (solids.half_size_m.max(axis=-1) + solids.radius_m).max()
        unit = unit_vector(np.linspace(0.0, 2.0 * np.pi, int(longest_m / CELL_M) + 1))
        square = unit / np.abs(unit).max(axis=-1, keepdims=True)
        half_m, radius_m = solids.half_size_m[:, np.newaxis], solids.radius_m[:, np.newaxis, np.newaxis]
        points_m = turned(half_m * square + radius_m * unit, solids.yaw_rad[:, np.newaxis])
        return solids.centre_m[:, np.newaxis] + points_m

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
        most_m = beyond_m.max(axis=-1, keepdims=True)
        towards = np.maximum(beyond_m, 1e-9 * (beyond_m == most_m))  # inside, the nearest face
        length_m = np.linalg.norm(towards, axis=-1, keepdims=True)
        distance_m = (length_m + np.minimum(most_m, 0.0))[:, 0] - solids.radius_m[of]
        return distance_m, turned(np.copysign(towards / length_m, own_m), solids.yaw_rad[of]), solids.owner[of]


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
        self._pose_sensor = sensor
        self._pose_variance = self._believed_variance = np.square(np.maximum(sensor.std, 1e-4))
        self._pose_square = POSE_SCANS * self._believed_variance
        self._correlation = sensor.correlation
        accuracy_m = np.full(2 * self._outlines.n_pieces, max(scenario.map.accuracy_m, LEAST_ACCURACY_M))
        accuracy_m[-2 * self._outlines.n_sides :] = FENCE_STD_M
        self._variance = np.square(np.concatenate([np.ones(3), sensor.frame_std, accuracy_m]))
        self._unknown: FloatArray = np.diag(self._variance[FRAME])
        self._scans: list[LidarScan] = []
        self._is_found = False
        self.frame = FrameEstimate(np.array(scenario.route.dock_m), np.zeros(3), self._unknown, sensor.pose_error)
        self._linearise_at(np.zeros(3))

    @property
    def disagreement(self) -> str:
        """Describe a disagreement of the frames that matters in one sentence; empty if none is known."""
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
            self._linearise_at(self._search())
        self._fit()
        self._pose_square = self._pose_square + self._latest_square
        expected = self._pose_square / (POSE_SCANS + n_scans)
        expected[:2] = expected[:2].mean()
        self._pose_variance = np.maximum(expected, self._believed_variance)
        self._decide()
        return True

    def _decide(self) -> None:
        """Set the frame from mean and covariance, and its pose error."""
        mean, covariance = self._mean[FRAME], self._covariance
        if not self._is_found:
            mean, covariance = np.zeros(3), self._unknown
        if not self.frame.is_applied and mean @ np.linalg.inv(covariance) @ mean < SIGNIFICANT:
            column = mean[:, np.newaxis]
            mean, covariance = np.zeros(3), covariance + column @ column.T
        is_worse = self._pose_variance > WORSE**2 * self._believed_variance
        position_m, _, heading_rad = np.where(is_worse, np.sqrt(self._pose_variance), self._pose_sensor.std).tolist()
        pose_error = replace(self._pose_sensor.pose_error, position_m=position_m, heading_rad=heading_rad)
        self.frame = FrameEstimate(self.frame.pivot_m, mean, covariance, pose_error)

    def _on_map(self, scan: LidarScan, frames: FloatArray) -> FloatArray:
        """Return the end points of a scan on the map for frames (..., 3), shape (..., n, 2)."""
        pivot_m, frame = self.frame.pivot_m, frames[..., np.newaxis, :]
        return pivot_m + turned(scan.place_m + scan.arm_m - pivot_m - frame[..., :2], -frame[..., 2])

    def _search(self) -> FloatArray:
        """Return the best frame of a grid, or the present one unless it is worse; note whether the best stands out."""
        frames = np.array([self._mean[FRAME], *product(SEARCH_M, SEARCH_M, SEARCH_RAD)])
        off = np.square(frames) / (FREEDOM * self._variance[FRAME])
        score = -0.5 * (FREEDOM + 1.0) * np.log1p(off).sum(axis=-1)
        for k in np.unique(np.linspace(0, len(self._scans) - 1, SEARCH_SCANS).astype(int)):
            score += self._outlines.log_likelihood(self._on_map(self._scans[k], frames))
        best = frames[score.argmax() if score.max() > score[0] + 2.0 else 0]  # the grid is coarse (assumed)
        is_far = (np.abs(frames - best) > [0.75, 0.75, np.radians(4.0)]).any(axis=-1)  # beyond 2 steps of the grid
        self._is_found = bool(logsumexp(score[is_far]) < logsumexp(score) + np.log(0.05))
        return best

    def _fit(self) -> None:
        """Estimate the state; associate all points anew while it moves by 3 cm or 0.2 degrees (assumed)."""
        for _ in range(8):
            for scan in self._scans[self._n_added :]:
                self._add(scan)
            self._n_added = len(self._scans)
            self._solve()
            if (np.abs(self._mean - self._at)[FRAME] <= [0.03, 0.03, np.radians(0.2)]).all():
                break
            self._linearise_at(self._mean[FRAME])

    def _linearise_at(self, frame: FloatArray) -> None:
        """Discard all information and linearise at a frame (3,), without displacements.

        The state is the present pose error, 0 to 2, the frame, 3 to 5, and x and y of each piece.
        """
        self._n_added, self._time_s, self._at = 0, -np.inf, np.zeros(self._variance.size)
        self._at[FRAME], self._mean = frame, self._at
        self._information, self._vector = np.diag(1.0 / self._variance), -self._at / self._variance

    def _add(self, scan: LidarScan) -> None:
        """Add the information of a scan later than all others."""
        self._predict(scan.time_s)
        frame = self._at[FRAME]
        distance_m, normal, piece = self._outlines.meet(place_m := self._on_map(scan, frame))
        arm_m = turned(scan.arm_m, -frame[2])
        is_facing = (normal * arm_m).sum(axis=-1) < -0.1 * np.linalg.norm(arm_m, axis=-1)  # 6 degrees (assumed)
        states, column = np.unique([6 + 2 * piece, 7 + 2 * piece], return_inverse=True)
        states, column = np.concatenate([np.arange(6), states]), 6 + column.reshape(2, -1)
        # derivative of the distance by these states; it does not depend on others
        rows, row = np.zeros((piece.size, states.size)), np.arange(piece.size)
        rows[:, :2] = rows[:, 3:5] = -turned(normal, frame[2])
        rows[:, 2] = -(normal * turned(arm_m)).sum(axis=-1)
        rows[:, 5] = -(normal * turned(place_m - self.frame.pivot_m)).sum(axis=-1)
        rows[row, column] = -normal.T
        expected_m2 = self._variance[6 + 2 * piece] + np.square(rows[:, POSE]) @ self._pose_variance
        expected_m2 += self._noise_variance
        weight = (FREEDOM + 1.0) / (FREEDOM + np.square(distance_m) / expected_m2) / self._noise_variance
        weighted = rows.T * (weight * (is_facing & (np.abs(distance_m) < GATE_M)))
        self._information[np.ix_(states, states)] += weighted @ rows
        self._vector[states] -= weighted @ distance_m

    def _predict(self, time_s: float) -> None:
        """Replace the pose error in the state by that at a later time, and marginalise the former."""
        rho, self._time_s = self._correlation(time_s - self._time_s), time_s
        information, vector = self._information, self._vector
        gain = np.diag(1.0 / ((1.0 - rho * rho) * self._pose_variance))
        inverse = np.linalg.inv(information[POSE, POSE] + rho * rho * gain)
        cross, pull = information[:, POSE].copy(), vector[POSE].copy()
        cross[POSE] = -rho * gain
        information[POSE], information[:, POSE], vector[POSE] = 0.0, 0.0, 0.0
        information[POSE, POSE] = gain
        linked = np.flatnonzero(cross.any(axis=-1))  # pieces that were scanned
        cross = cross[linked]
        information[np.ix_(linked, linked)] -= cross @ inverse @ cross.T
        vector[linked] -= cross @ inverse @ pull

    def _solve(self) -> None:
        """Solve for mean of the state, covariance of the frame, and mean square of the present pose error."""
        is_linked = np.count_nonzero(self._information, axis=0) > 1
        is_linked[:6] = True
        linked = np.flatnonzero(is_linked)  # the displacements of other pieces have their prior, and so a mean of 0
        factor = cho_factor(self._information[np.ix_(linked, linked)])
        solved = cho_solve(factor, np.column_stack([self._vector[linked], np.eye(linked.size, 6)]))
        self._mean, covariance = self._at.copy(), solved[:6, 1:]
        self._mean[linked] += solved[:, 0]
        self._covariance = covariance[FRAME, FRAME]
        self._latest_square = (np.square(self._mean[:6]) + covariance.diagonal())[POSE]
