"""Findings as CSV for spreadsheets, and as GeoJSON (RFC 7946) for maps."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np

from dirmusic.locating.ellipse import outline95
from pdpatrol.envs.scenario.map_section import GeoreferenceConfig
from pdpatrol.missions.export.georeference import longitude_latitude
from pdpatrol.missions.report.records import FindingRecord, Report

OUTLINE_POINTS = 37
DEGREE_DIGITS = 8
"""Of longitudes and latitudes: a millimetre."""


def findings_csv(report: Report) -> str:
    """One line for each finding and candidate, with a header whose names end in units; commas, full stops."""
    rows = [_facts(finding) for finding in (*report.findings, *report.candidates)]
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(FIELDS), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def findings_geojson(report: Report, reference: GeoreferenceConfig) -> str:
    """A point for each finding and candidate, and the outline of its 95 % ellipse."""
    features: list[dict[str, Any]] = []
    for finding in (*report.findings, *report.candidates):
        place, covariance = np.array(finding.position_m), np.array(finding.covariance_m2)
        at = _degrees(longitude_latitude(place, reference))
        point = {"type": "Point", "coordinates": [*at, round(float(place[2]), 3)]}
        outline = _degrees(longitude_latitude(outline95(place[:2], covariance[:2, :2], OUTLINE_POINTS), reference))
        ring = [*outline[:-1], outline[0]]  # the last point is the first one
        facts = _facts(finding)
        features += [
            _feature(f"finding-{finding.id}", point, facts),
            _feature(f"ellipse-{finding.id}", {"type": "Polygon", "coordinates": [ring]}, {"id": finding.id}),
        ]
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1, ensure_ascii=False) + "\n"


def _feature(identifier: str, geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "id": identifier, "geometry": geometry, "properties": properties}


def _degrees(places: Any) -> Any:  # noqa: ANN401 - nested lists as JSON has them
    return np.round(places, DEGREE_DIGITS).tolist()


FIELDS: tuple[str, ...] = (
    "id",
    "state",
    "site",
    "site_probability",
    "kind",
    "kind_confidence",
    "x_m",
    "y_m",
    "z_m",
    "std_x_m",
    "std_y_m",
    "std_z_m",
    "ellipse95_semi_major_m",
    "ellipse95_semi_minor_m",
    "level_db",
    "rate_per_s",
    "n_bearings",
    "first_detected_s",
    "confirmed_s",
)


def _facts(finding: FindingRecord) -> dict[str, Any]:
    """The values of `FIELDS`, rounded as in report.json; None for what is not known."""
    told = finding.model_dump(mode="json")
    site, discharge, strength = next(iter(told["sites"]), {}), told["discharge"] or {}, told["strength"] or {}
    values = (
        told["id"],
        told["state"],
        site.get("name"),
        site.get("probability"),
        discharge.get("kind"),
        discharge.get("confidence"),
        *told["position_m"],
        *told["position_std_m"],
        told["ellipse95"]["semi_major_m"],
        told["ellipse95"]["semi_minor_m"],
        strength.get("level_db"),
        strength.get("rate_per_s"),
        told["n_bearings"],
        told["first_detected_s"],
        told["confirmed_s"],
    )
    return dict(zip(FIELDS, values, strict=True))
