"""Each subsystem draws from a generator of its own: what one draws more shifts nothing in the others."""

import pickle

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.episode import Generators
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.missions.runner import Mission
from pdpatrol.sensing import Scene
from pdpatrol.sensing.nature.sources import Emissions


def test_children_are_independent_and_the_same_for_the_same_seed() -> None:
    first, again = (Generators.spawn(np.random.default_rng(3)) for _ in range(2))
    draws = [generator.random(4) for generator in first]
    assert len({tuple(draw) for draw in draws}) == len(Generators._fields)
    for generator, draw in zip(again, draws, strict=True):
        np.testing.assert_array_equal(generator.random(4), draw)


def test_the_next_episode_has_other_children_also_after_pickling() -> None:
    parent = np.random.default_rng(3)
    before = Generators.spawn(parent).episode.random()
    twin = pickle.loads(pickle.dumps(parent))
    after = Generators.spawn(parent).episode.random()
    assert before != after == Generators.spawn(twin).episode.random()


@pytest.mark.parametrize("scenario", ["two_sources", "transformer_bay", "quiet_yard"])
def test_two_policies_on_one_seed_meet_the_same_nature(scenario: str, monkeypatch: pytest.MonkeyPatch) -> None:
    emit, emitted = Scene.draw, list[Emissions]()

    def noted(scene: Scene, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        emitted.append(emit(scene, start_s, duration_s, rng))
        return emitted[-1]

    monkeypatch.setattr(Scene, "draw", noted)
    met: list[tuple[dict, np.ndarray, np.ndarray, np.ndarray]] = []
    for policy in ("seek", "random"):
        emitted.clear()
        mission = Mission(load_scenario(scenario), policy, 11)
        while mission.time_s < 20.0:
            mission.step()
        source, time_s, peak_v = (np.concatenate(column) for column in zip(*emitted, strict=True))
        met.append((mission.log.meta["truth"], source, time_s, peak_v))
    (truth, *first), (same_truth, *second) = met
    assert truth == same_truth
    assert first[1].size > 50
    for column, same in zip(first, second, strict=True):
        np.testing.assert_array_equal(column, same)


def test_another_array_meets_the_same_sources_and_starts_in_the_same_pose() -> None:
    truths = []
    for n_elements in (4, 6):
        scenario = load_scenario("two_sources")
        array = scenario.array.model_copy(update={"n_elements": n_elements})
        env = PatrolEnv(scenario.model_copy(update={"array": array}), full_info=True)
        _, info = env.reset(seed=5)
        truths.append((info["truth"]["sources"], info["true_pose"].tolist()))
    assert truths[0] == truths[1]
