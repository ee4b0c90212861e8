"""Settings of the measurement in words, and the statements of a survey."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.ticker import EngFormatter

from pdpatrol.missions.field.survey import HEADINGS
from pdpatrol.missions.record.log_contents import survey_of
from pdpatrol.missions.record.mission_log import MissionLog
from pdpatrol.missions.report.records import Survey

PAPER_PATTERN = "eq. (1) of the Dir-MUSIC paper"
"""Pattern of elements without a file."""


def survey_record(log: MissionLog) -> Survey:
    """Return the statements on the survey, and the array that was used."""
    stated = survey_of(log).model_dump(include=set(Survey.model_fields))
    scenario = log.meta.get("scenario", {})
    serial_number = scenario.get("array", {}).get("serial_number")
    return Survey(**stated, serial_number=serial_number, array_state=_array_state(log.meta))


def _array_state(meta: Mapping[str, Any]) -> str:
    """Describe the errors of the array that a survey started from."""
    known = meta.get("settings", {}).get("survey") or meta.get("scenario", {}).get("array")
    calibration = meta.get("scenario", {}).get("locating", {}).get("calibration")
    if calibration is not None:
        n_missions = calibration["n_missions"]
        return f"errors estimated in {n_missions} earlier survey{'s'[: n_missions > 1]}, last {calibration['mission']}"
    if known is None:
        return "not stated"
    if known.get("calibration") is not None:
        return f"errors estimated in earlier surveys: {known['calibration']}"
    return (
        f"as in the data sheet, within {100 * known['gain_error']:g} % of gain and {known['pointing_error_deg']:g}° of "
        "direction (standard deviations); errors estimated together with the findings"
    )


def settings_in_words(log: MissionLog) -> dict[str, str]:
    """Return the settings of the measurement by subject; only those that the operator knew, but for the last row.

    Yard and route are omitted because the plan shows them, and sources because they are the truth.
    """
    if "field_data" in log.meta:
        return _of_field_data(log.meta["settings"]["survey"], log.meta["field_data"])
    return _of_mission(log.meta["scenario"], log.meta["seed"]) if "scenario" in log.meta else {}


def _of_mission(scenario: Mapping[str, Any], seed: int) -> dict[str, str]:
    array, receiver, poses = (scenario[name] for name in ("array", "receiver", "pose_sensor"))
    robot, radio, rules = (scenario[name] for name in ("robot", "radio", "locating"))
    volts, hertz, seconds = EngFormatter("V"), EngFormatter("Hz"), EngFormatter("s")
    n_listed = len(array["elements"])
    band = receiver["band_hz"]
    passed = "no band-pass" if band == "all" else f"band-pass {hertz(band[0])} to {hertz(band[1])}"
    changed = ", ".join(
        f"{key} {value}" for key, value in rules.items() if value is not None and key not in ("locator", "calibration")
    )
    speed = "" if robot["max_speed_mps"] is None else f", at most {robot['max_speed_mps']:g} m/s"
    walls = "one or two walls" if radio["second_order"] else "one wall"
    return {
        "Array": (
            f"{n_listed} elements as listed"
            if n_listed
            else f"{array['n_elements'] or 6} elements in a ring of {array['ring_radius_m']:g} m radius"
        )
        + f", {array['height_m']:g} m above ground; pattern: {array['pattern'] or PAPER_PATTERN}",
        "Receiver": f"{EngFormatter('S/s')(receiver['sample_rate_hz'])}, {receiver['bits']} bits over "
        f"±{volts(receiver['full_scale_v'])}, {passed}, noise {volts(receiver['noise_v'])} before it",
        "Trigger": f"one false alarm in {seconds(1.0 / receiver['false_alarm_rate_hz'])} on average; "
        f"{receiver['gate_samples']} samples are used, {receiver['pretrigger_samples']} of them before the pulse; "
        f"mains of {hertz(receiver['mains_hz'])}",
        "Direction finding": scenario["estimator"]["method"].replace("_", " ")
        + (f", strengths in {receiver['n_bands']} sub-bands" if receiver["n_bands"] else ""),
        "Positions": (rules["locator"] or "built-in Locator") + (f"; changed rules: {changed}" if changed else ""),
        "Poses": f"errors of {poses['position_std_m']:g} m along each axis and {poses['heading_std_deg']:g}° "
        f"(standard deviations), correlated over {seconds(poses['correlation_s'])}",
        "Robot": robot["model"] + speed,
        "Simulation": f"seed {seed}; ground of {radio['ground'].replace('_', ' ')}; reflections by the ground and "
        f"{walls}",
    }


def _of_field_data(survey: Mapping[str, Any], field: Mapping[str, Any]) -> dict[str, str]:
    n, live, volts = field["n_channels"], field["channels"], EngFormatter("V")
    boresights = survey["boresights_deg"]
    directions = "a ring" if boresights is None else ", ".join(f"{each:g}°" for each in boresights)
    noise = "as stated in the table or in the records" if survey["noise_v"] is None else volts(survey["noise_v"])
    return {
        "Data": f"{field['file']}, {n} channels" + ("" if len(live) == n else f", of which live: {live}"),
        "Array": f"boresights: {directions}; radius {survey['ring_radius_m']:g} m, {survey['height_m']:g} m above "
        f"ground; pattern: {survey['pattern'] or PAPER_PATTERN}",
        "Receiver": f"noise {noise}; waveforms are cut to {survey['gate_ns']:g} ns",
        "Poses": f"errors of {survey['position_std_m']:g} m along each axis and {survey['heading_std_deg']:g}° "
        f"(standard deviations), correlated over {survey['pose_correlation_s']:g} s; headings are "
        f"{HEADINGS[survey['heading']].text}",
    }
