"""The mission loop: environment, policy and Locator into a MissionLog; every policy is scored on the same locating."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dirmusic import ArrayModel, Bearings, ElementSpread, Finding, Locator, PoseError
from dirmusic.angles import wrap
from envs import Scenario
from envs.patrol import STEP_S, PatrolEnv, Pulses
from missions.choices import PolicyName
from missions.log import MissionLog
from missions.navigation import SiteMap
from missions.policies import SeesTruth, make_policy
from robot_models.inspector import MAX_SPEED_MPS, MAX_YAW_RATE_RADPS
from robot_models.world import describe_solids
from sensing import HelicalArray

FloatArray = NDArray[np.float64]

PART_S = 30.0
"""Simulated time between parts of the log on disk: what a killed mission loses at most."""


class Mission:
    """One mission, a control step at a time.

    Args:
        scenario: What to run.
        policy: Who drives.
        seed: Fixes all that is drawn: the same seed gives the same mission, bit for bit.
        folder: Where to keep parts of the log while it grows; None keeps it in memory.
    """

    def __init__(self, scenario: Scenario, policy: PolicyName, seed: int, folder: Path | None = None) -> None:
        self.env = PatrolEnv(scenario, terminate_on_approach=False)
        self.policy = make_policy(policy, np.random.default_rng([seed, 1]))
        self.site_map = SiteMap(scenario)
        self.locator = make_locator(scenario)
        self.folder = folder
        self.is_over = False
        self._observation, info = self.env.reset(seed=seed)
        self._touched: frozenset[str] = frozenset()
        self._visited: tuple[int, ...] = ()
        self._logged: tuple[Finding, ...] = ()
        self._true_start = info["truth"].pop("pose")
        self.log = MissionLog(self._meta(scenario, policy, seed, info["truth"]))
        if isinstance(self.policy, SeesTruth):
            self.policy.reveal(info["truth"])

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return STEP_S * self.log.n_rows("step")

    @property
    def n_visited(self) -> int:
        """Waypoints visited so far."""
        return len(self._visited)

    def _meta(self, scenario: Scenario, policy: str, seed: int, truth: dict[str, Any]) -> dict[str, Any]:
        nominal = HelicalArray.nominal(scenario.array)
        return {
            "versions": {name: version(name) for name in ("pdpatrol", "mujoco", "numpy", "scipy")},
            "seed": seed,
            "policy": policy,
            "scenario": scenario.model_dump(mode="json"),
            "n_elements": int(nominal.boresights_rad.size),
            "array": {"boresights_rad": nominal.boresights_rad.tolist(), "positions_m": nominal.positions_m.tolist()},
            "yard_size_m": list(scenario.yard.size_m),
            "route": scenario.route.model_dump(mode="json"),
            "sites": {name: scenario.yard.site_position(name).tolist() for name in scenario.yard.site_names()},
            "solids": describe_solids(self.env.inspector.model),
            "start": {"true_pose": self._true_start.tolist()},
            "truth": truth,
        }

    def step(self) -> None:
        """Decide, drive and listen for one control step, locate, and log all of it."""
        action = self.policy(self._observation, self.locator.findings, self.site_map)
        if action is None:
            self.end("policy done")
            return
        self._observation, _, terminated, truncated, info = self.env.step(action)
        truth = info.pop("truth")
        step = self.log.append(
            "step",
            time_s=info["time_s"],
            pose=info["pose"],
            true_pose=truth["pose"],
            command=np.asarray(action, dtype=np.float64) * (MAX_SPEED_MPS, MAX_YAW_RATE_RADPS),
            phase=self.policy.phase,
        )
        pulses: Pulses = info["pulses"]
        bearings = Bearings(azimuth_rad=pulses.azimuth_rad, std_rad=pulses.std_rad, misfit=pulses.misfit)
        self._log_pulses(step, info["pose"], pulses, bearings)
        findings = self.locator.update(info["time_s"], info["pose"], bearings, pulses.strengths_v, pulses.variance_v2)
        self._log_findings(step, findings)
        self._log_events(step, info)
        if self.folder is not None and (step + 1) % round(PART_S / STEP_S) == 0:
            self.log.write_part(self.folder)
        if terminated:
            self.end("docked")
        elif truncated:
            self.end("time limit")

    def end(self, reason: str) -> None:
        """Close the mission; what was logged stays as it is."""
        self.is_over = True
        self._event("end", reason)

    def _log_pulses(self, step: int, pose: FloatArray, pulses: Pulses, bearings: Bearings) -> None:
        credible = self.locator.is_credible(bearings)
        for i in range(credible.size):
            pulse = self.log.append(
                "pulse",
                step=step,
                strengths_v=pulses.strengths_v[i],
                mains_phase_rad=pulses.mains_phase_rad[i],
                is_credible=credible[i],
            )
            if credible[i]:
                self.log.append(
                    "bearing",
                    pulse=pulse,
                    azimuth_rad=bearings.azimuth_rad[i],
                    bearing_rad=wrap(bearings.azimuth_rad[i] + pose[2]),
                    std_rad=bearings.std_rad[i],
                )

    def _log_findings(self, step: int, findings: Sequence[Finding]) -> None:
        if findings is self._logged:
            return
        before = {finding.id: finding.state for finding in self._logged}
        for finding in findings:
            self._log_finding(step, finding, finding.state)
            x, y = finding.position_m
            if before.pop(finding.id, None) != finding.state:
                told = {
                    "candidate": f"candidate {finding.id} towards ({x:.1f}, {y:.1f}) m",
                    "confirmed": f"finding {finding.id} at ({x:.2f}, {y:.2f}) m, 95 % in {finding.semi_major_m:.2f} m",
                    "outside": f"candidate {finding.id} lies beyond the fence, near ({x:.0f}, {y:.0f}) m",
                }[finding.state]
                self._event(finding.state, told)
        for gone in (finding for finding in self._logged if finding.id in before):
            self._log_finding(step, gone, "dropped")
            self._event("dropped", f"candidate {gone.id} was no source of its own")
        self._logged = tuple(findings)

    def _log_finding(self, step: int, finding: Finding, state: str) -> None:
        self.log.append(
            "finding",
            step=step,
            id=finding.id,
            position_m=finding.position_m,
            covariance_m2=finding.covariance_m2,
            state=state,
            n_bearings=finding.n_bearings,
            first_heard_s=finding.first_heard_s,
            opening_rad=finding.opening_rad,
        )

    def _log_events(self, step: int, info: dict[str, Any]) -> None:
        touched = frozenset(info["touched"])
        for name in sorted(touched - self._touched):
            self._event("contact", name)
        self._touched = touched
        for index in sorted(set(info["waypoints_visited"]) - set(self._visited)):
            self._event("waypoint", str(index + 1))
        self._visited = info["waypoints_visited"]

    def _event(self, kind: str, text: str) -> None:
        self.log.append("event", step=max(self.log.n_rows("step") - 1, 0), kind=kind, text=text)


def make_locator(scenario: Scenario) -> Locator:
    """The robot's own Locator: it knows the data sheet of the array and the fence, and nothing of what is true."""
    nominal = HelicalArray.nominal(scenario.array)
    return Locator(
        ArrayModel(
            manifold=nominal.manifold(),
            positions_m=nominal.positions_m,
            spread=ElementSpread(
                gain=scenario.array.gain_error,
                pointing_rad=float(np.radians(scenario.array.pointing_error_deg)),
                offset=scenario.array.gain_offset / np.sqrt(3),
            ),
        ),
        PoseError(
            position_m=scenario.pose_sensor.position_std_m,
            heading_rad=float(np.radians(scenario.pose_sensor.heading_std_deg)),
            correlation_s=scenario.pose_sensor.correlation_s,
        ),
        fence_m=scenario.yard.size_m,
    )


def run_mission(
    scenario: Scenario,
    policy: PolicyName = "seek",
    seed: int = 0,
    folder: Path | None = None,
    after_step: Callable[[Mission], None] | None = None,
) -> MissionLog:
    """Run a whole mission; `after_step` sees it after each control step, and may end it.

    Linear algebra runs in one thread: the matrices are small, and the result must not depend on the number of cores.
    """
    with threadpool_limits(limits=1):
        mission = Mission(scenario, policy, seed, folder)
        while not mission.is_over:
            mission.step()
            if after_step is not None:
                after_step(mission)
    return mission.log
