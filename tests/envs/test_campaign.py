"""Repeated inspections: the same discharges, older by the weeks between, and a date that no clock has a say in."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpatrol.envs import load_scenario
from pdpatrol.envs.patrol_env import PatrolEnv
from pdpatrol.envs.scenario import ScenarioError, restore_scenario
from pdpatrol.missions.runner import Mission
from pdpatrol.sensing import Scene
from pdpatrol.sensing.nature.scene import Emissions

WEST = {"name": "west", "kind": "surface", "sites": ("reactor_west/*", "breaker_west/*", "vt_west/*")}
EAST = {"name": "east", "kind": "floating", "sites": ("transformer_east/*", "breaker_east/*", "vt_east/*")}


def sources_of(seed: int, **campaign: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - as TOML
    """What discharges in a mission, as nature has it."""
    settings = {f"campaign.{key}": value for key, value in campaign.items()}
    env = PatrolEnv(load_scenario("two_sources", settings), full_info=True)
    return env.reset(seed=seed)[1]["truth"]["sources"]


def emitted_on(day: str, growth_db: float, monkeypatch: pytest.MonkeyPatch) -> Emissions:
    """The pulses of the first seconds of a mission on a day."""
    emit, emitted = Scene.draw, list[Emissions]()

    def noted(scene: Scene, start_s: float, duration_s: float, rng: np.random.Generator) -> Emissions:
        emitted.append(emit(scene, start_s, duration_s, rng))
        return emitted[-1]

    settings = {
        "sources": ({**WEST, "growth_db_per_week": growth_db}, EAST),
        "campaign.begins": "2026-03-02",
        "campaign.date": day,
    }
    with monkeypatch.context() as patched:
        patched.setattr(Scene, "draw", noted)
        mission = Mission(load_scenario("two_sources", settings), "patrol", 11)
        while mission.time_s < 5.0:
            mission.step()
    assert mission.log.meta["date"] == day
    return Emissions(*(np.concatenate(column) for column in zip(*emitted, strict=True)))


def test_every_pulse_is_louder_by_the_growth_of_the_weeks_since_the_campaign_began(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, later = (emitted_on(day, 3.0, monkeypatch) for day in ("2026-03-02", "2026-03-30"))
    assert np.bincount(first.source).min() > 50
    np.testing.assert_array_equal(first.time_s, later.time_s)
    by_db = np.where(first.source == 0, 4 * 3.0, 0.0)
    np.testing.assert_allclose(20 * np.log10(later.peak_v / first.peak_v), by_db, atol=1e-9)


def test_a_rate_grows_by_its_share_from_week_to_week() -> None:
    source = load_scenario("two_sources", {"sources": ({**WEST, "rate_growth_per_week": 0.2},)}).sources[0]
    assert source.after(2.0).pulse_rate_hz == pytest.approx(1.44 * source.pulse_rate_hz)
    assert source.after(0.0) == source


def test_missions_of_one_campaign_have_the_same_discharges_and_those_of_none_others() -> None:
    assert sources_of(1, number=7) == sources_of(2, number=7)
    assert sources_of(1, number=7) != sources_of(1, number=8)
    assert sources_of(1) != sources_of(2)


def test_without_growth_a_date_changes_nothing_but_the_date() -> None:
    assert sources_of(1) == sources_of(1, date="2026-12-24")


def test_a_date_is_one_of_toml_or_text_and_is_kept_as_text(tmp_path: Path) -> None:
    yard = "[yard]\nsize_m = [10.0, 10.0]\n[route]\ndock_m = [3.0, 3.0]\n[array]\n[campaign]\n"
    for given in ("2026-03-02", '"2026-03-02"', "2026-03-02T08:00:00"):
        file = tmp_path / "yard.toml"
        file.write_text(f"{yard}begins = 2026-02-23\ndate = {given}\n")
        scenario = load_scenario(file)
        assert (scenario.campaign.day, scenario.campaign.weeks) == ("2026-03-02", 1.0)
        assert restore_scenario(json.loads(scenario.model_dump_json())) == scenario


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"campaign.date": "2026-02-30"}, "campaign.date: got 2026-02-30; allowed is a day of the calendar"),
        ({"campaign.date": "soon"}, "campaign.date: got 'soon'; allowed is a day of this century as 2026-03-02"),
        ({"campaign.date": "2026-01-04"}, "campaign.date: got 2026-01-04, before campaign.begins; allowed is 2026-01"),
        ({"campaign.number": -1}, "campaign.number: got -1"),
        ({"campaign.date": "2027-01-04", "sources": ({**WEST, "growth_db_per_week": 3.0},)},
         "sources.0.growth_db_per_week: got 3, 156 dB in the 52 weeks of the campaign; allowed are 120 dB"),
        ({"campaign.date": "2027-01-04", "sources": ({**WEST, "rate_growth_per_week": -0.9},)},
         "sources.0.rate_growth_per_week: got -0.9, 10^-52 times the pulses in the 52 weeks"),
        ({"campaign.date": "2026-01-26", "sources": ({**WEST, "rate_growth_per_week": 9.0},)},
         "sources.0.rate_growth_per_week: got 9, 10^3 times the pulses in the 3 weeks of the campaign; allowed are"),
    ],
)  # fmt: skip
def test_what_no_campaign_has_is_one_clear_line(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("two_sources", settings)
    (fault,) = caught.value.faults
    assert told in fault
