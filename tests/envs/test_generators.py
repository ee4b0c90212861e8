"""Each subsystem has its own generator, so that more draws in one leave the others unchanged."""

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.episode import Generators
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.missions.runner import Mission
from pdpatrol.sensing import Scene
from pdpatrol.sensing.nature.sources import Emissions


def test_generators_are_independent_and_reproducible() -> None:
    parent, twin = np.random.default_rng(3), np.random.default_rng(3)
    drawn, again = (
        [generator.random() for _ in range(2) for generator in Generators.spawn(rng)] for rng in (parent, twin)
    )
    assert drawn == again
    assert len(set(drawn)) == 2 * len(Generators._fields)


@pytest.mark.parametrize("scenario", ["two_sources", "transformer_bay", "quiet_yard"])
def test_two_policies_meet_the_same_discharges(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    emit, emitted = Scene.draw, list[Emissions]()

    def noted(scene: Scene, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        emitted.append(emit(scene, start_s, duration_s, rng))
        return emitted[-1]

    monkeypatch.setattr(Scene, "draw", noted)
    met: list[tuple[dict, np.ndarray, np.ndarray, np.ndarray]] = []
    for policy in ("seek", "random"):
        emitted.clear()
        mission = Mission(load_scenario(scenario), policy, 11)
        while mission.time_s < 10.0:
            mission.step()
        source, time_s, peak_v = (np.concatenate(column) for column in zip(*emitted, strict=True))
        met.append((mission.log.meta["truth"], source, time_s, peak_v))
    (truth, *first), (same_truth, *second) = met
    assert truth == same_truth
    assert first[1].size > 50
    for column, same in zip(first, second, strict=True):
        np.testing.assert_array_equal(column, same)


def test_size_of_the_array_changes_no_other_draw() -> None:
    truths = []
    for n_elements in (4, 6):
        env = PatrolEnv(load_scenario("two_sources", {"array.n_elements": n_elements}), full_info=True)
        _, info = env.reset(seed=5)
        truths.append((info["truth"]["sources"], info["true_pose"].tolist()))
    assert truths[0] == truths[1]
