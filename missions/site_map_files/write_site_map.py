"""Write the yard of a scenario as GeoJSON that `pdpatrol import` and geographic information systems read."""

from typing import Any

import numpy as np

from pdpatrol.envs.scenario import Scenario
from pdpatrol.envs.scenario.map import GeoreferenceConfig
from pdpatrol.missions.site_map_files.geodesy import longitude_latitude
from pdpatrol.missions.site_map_files.site_pieces import ANY, OWN, RULES


def site_map(scenario: Scenario, reference: GeoreferenceConfig) -> dict[str, Any]:
    """Return a FeatureCollection: the outline of the yard, and a point for each piece of equipment.

    The points have tags of OpenStreetMap where these exist for their kind, and their keys in the scenario file.
    """
    fence_m = scenario.yard.fence.corners_m
    corners_m = np.concatenate([fence_m, fence_m[:1]])
    outline = {"type": "Polygon", "coordinates": [longitude_latitude(corners_m, reference).tolist()]}
    tags = {"power": "substation", "barrier": "fence", "heading_deg": reference.heading_deg}
    features = [{"type": "Feature", "properties": tags, "geometry": outline}]
    for piece in scenario.yard.equipment:
        keys = piece.model_dump(mode="json", exclude_none=True, exclude={"position_m"})
        known = next((tags for tags, kind in RULES if kind == piece.kind), {})
        tags = {key: "yes" if value == ANY else value for key, value in known.items()}
        tags |= {"voltage": f"{1000 * keys['kv']:.0f}"} if "kv" in keys else {}
        place = longitude_latitude(np.array(piece.position_m), reference).tolist()
        properties = {"name": piece.name, **tags, OWN: keys}
        features.append(
            {"type": "Feature", "properties": properties, "geometry": {"type": "Point", "coordinates": place}}
        )
    return {"type": "FeatureCollection", "features": features}
