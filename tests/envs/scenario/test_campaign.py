"""Repeated inspections: the same discharges, which grow over the weeks of the campaign."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.episode import Episode, Generators, ResetOptions
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario import restore_scenario
from pdpatrol.sensing import Surroundings
from pdpatrol.sensing.nature.sources import Emissions

WEST = {"name": "west", "kind": "surface", "sites": ("reactor_west/*", "breaker_west/*", "vt_west/*")}
EAST = {"name": "east", "kind": "floating", "sites": ("transformer_east/*", "breaker_east/*", "vt_east/*")}


def sources_of(seed: int, **campaign: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - as TOML
    """Return the sources drawn for a mission."""
    settings = {f"campaign.{key}": value for key, value in campaign.items()}
    env = PatrolEnv(load_scenario("two_sources", settings), full_info=True)
    return env.reset(seed=seed)[1]["truth"]["sources"]


def emitted_on(day: str) -> Emissions:
    """Return the pulses emitted in 5 s on a day of a campaign that begins on 2026-03-02."""
    sources = ({**WEST, "growth_db_per_week": 3.0}, EAST)
    settings = {"sources": sources, "campaign.begins": "2026-03-02", "campaign.date": day}
    scenario, generators = load_scenario("two_sources", settings), Generators.spawn(np.random.default_rng(11))
    episode = Episode.draw(scenario, Surroundings(), generators, ResetOptions())
    return episode.listener.scene.draw(0.0, 5.0, generators.nature)


def test_pulses_grow_with_the_weeks_of_the_campaign() -> None:
    first, later = (emitted_on(day) for day in ("2026-03-02", "2026-03-30"))
    assert np.bincount(first.source).min() > 50
    np.testing.assert_array_equal(first.time_s, later.time_s)
    by_db = np.where(first.source == 0, 4 * 3.0, 0.0)
    np.testing.assert_allclose(20 * np.log10(later.peak_v / first.peak_v), by_db, atol=1e-9)


def test_rate_grows_from_week_to_week() -> None:
    source = load_scenario("two_sources", {"sources": ({**WEST, "rate_growth_per_week": 0.2},)}).sources[0]
    assert source.after(2.0).pulse_rate_hz == pytest.approx(1.44 * source.pulse_rate_hz)
    assert source.after(0.0) == source


def test_missions_of_one_campaign_have_the_same_discharges() -> None:
    assert sources_of(1, number=7) == sources_of(2, number=7)
    assert sources_of(1, number=7) != sources_of(1, number=8)
    assert sources_of(1) != sources_of(2)


def test_date_without_growth_changes_no_source() -> None:
    assert sources_of(1) == sources_of(1, date="2026-12-24")


def test_date_is_kept_as_text(tmp_path: Path) -> None:
    yard = "[yard]\nsize_m = [10.0, 10.0]\n[route]\ndock_m = [3.0, 3.0]\n[array]\n[campaign]\n"
    for given in ("2026-03-02", '"2026-03-02"', "2026-03-02T08:00:00"):
        file = tmp_path / "yard.toml"
        file.write_text(f"{yard}begins = 2026-02-23\ndate = {given}\n")
        scenario = load_scenario(file)
        assert (scenario.campaign.day, scenario.campaign.weeks) == ("2026-03-02", 1.0)
        assert restore_scenario(json.loads(scenario.model_dump_json())) == scenario
