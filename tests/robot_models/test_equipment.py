"""Every kind of equipment in the catalogue: its shape, its sites, and how it stands in the model."""
# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.equipment.catalogue import CATALOGUE, KIND_COLOURS
from pdpatrol.robot_models.equipment.voltages import VOLTAGES, Kv
from pdpatrol.robot_models.readings import LIDAR
from pdpatrol.robot_models.robots import Robots
from pdpatrol.robot_models.yard.clearances import clearance_errors
from pdpatrol.robot_models.yard.pieces import BoxEquipment, CatalogueEquipment, CylinderEquipment
from pdpatrol.robot_models.yard.yard import Yard
from pdpatrol.sensing.radio.materials import KIND_MATERIALS
from tests.robot_models.one_robot import ONE_ELEMENT

SIZES: tuple[tuple[str, Kv | None], ...] = (
    *((kind, None) for kind in CATALOGUE),
    *((kind, kv) for kind, shape in CATALOGUE.items() if shape.build_for for kv in VOLTAGES),
)
"""Every kind in every size."""


def yard_with(kind: str, yaw_deg: float = 30.0, length_m: float | None = None, kv: Kv | None = None) -> Yard:
    it = CatalogueEquipment(name="it", kind=kind, position_m=(20.0, 20.0), yaw_deg=yaw_deg, length_m=length_m, kv=kv)
    return Yard(size_m=(40.0, 40.0), equipment=(it,))


def test_kinds_are_those_of_the_radio_model() -> None:
    assert KIND_COLOURS.keys() == KIND_MATERIALS.keys() >= CATALOGUE.keys()
    assert all(0.0 <= share <= 1.0 for colour in KIND_COLOURS.values() for share in colour)


@pytest.mark.parametrize(("kind", "kv"), SIZES)
def test_sites_of_a_kind_lie_on_its_surface(kind: str, kv: Kv | None) -> None:
    yard = yard_with(kind, kv=kv)
    assert yard.solids.bottom_m.min() == 0.0
    assert (yard.solids.top_m > yard.solids.bottom_m).all()
    for name in yard.site_names():
        site = yard.site_position(name)
        assert yard.solids.distance(site).min() == pytest.approx(0.02, abs=1e-3)
        assert 0.3 < site[2] < yard.solids.top_m.max() + 0.03


SIMPLE = (
    BoxEquipment(
        name="box",
        kind="reactor",
        position_m=(18.0, 15.0),
        footprint_m=(4.0, 2.0),
        height_m=3.0,
        shape="box",
        yaw_deg=30,
    ),
    CylinderEquipment(
        name="post", kind="of_no_known_kind", position_m=(23.0, 15.0), radius_m=0.3, height_m=2.5, shape="cylinder"
    ),
)


@pytest.mark.parametrize(("kind", "kv"), [size for size in SIZES if size[1]])
def test_a_kind_keeps_its_own_clearances(kind: str, kv: Kv) -> None:
    """Live parts and insulators are high enough above ground, and phases far enough apart (IEC 61936-1)."""
    yard = yard_with(kind, kv=kv)
    assert clearance_errors(yard, kv) == []
    assembly = yard.equipment[0].assembly
    assert assembly.live | assembly.insulators <= assembly.parts.keys()


def test_model_has_the_surface_of_the_map() -> None:
    """Rays to each piece, of all kinds in all sizes and of no kind, end on solids of the map."""
    kinds = [
        CatalogueEquipment(
            name=f"piece_{k}",
            kind=kind,
            position_m=(25.0 * (k % 9) + 20.0, 25.0 * (k // 9) + 40.0),
            yaw_deg=30.0,
            kv=kv,
        )
        for k, (kind, kv) in enumerate(SIZES)
    ]
    yard = Yard(size_m=(240.0, 260.0), equipment=(*SIMPLE, *kinds))
    inspector = Robots(load_robot("inspector"), yard, ONE_ELEMENT)
    groups = (np.arange(6) == 1).astype(np.uint8)
    rng, data, met = np.random.default_rng(2), inspector.data(), np.zeros(1, dtype=np.int32)
    for number, item in enumerate(yard.equipment):
        solids, hits = yard.solids.take(yard.owner == number), 0
        centre_m, top_m = np.append(item.position_m, 0.0), solids.top_m.max()
        for _ in range(300):
            start = centre_m + rng.uniform([-8.0, -8.0, 0.05], [8.0, 8.0, 5.0])
            end = centre_m + [0.0, 0.0, rng.uniform(0.0, top_m)] + rng.normal(0.0, 1.0, 3) * (1.0, 1.0, 0.1)
            range_m = mujoco.mj_ray(inspector.model, data, start, end - start, groups, True, -1, met, None)
            if range_m > 0:
                place_m = start + range_m * (end - start)
                hits += bool(abs(solids.distance(place_m)).min() < 1e-6)
                assert np.abs(yard.solids.distance(place_m)).min() < 1e-6
        assert hits > 5, item.name


def test_contact_with_any_part_names_the_piece() -> None:
    inspector = Robots(load_robot("inspector"), yard_with("power_transformer", yaw_deg=0.0), ONE_ELEMENT)
    inspector.reset([0], [(20.0, 17.4, np.pi / 2)])
    inspector.drive([0.5], [0.0], 2.0)
    assert inspector.touched[0] == ("equipment/it",)


def test_robot_passes_below_a_busbar_but_not_over_a_kerb() -> None:
    busbar, kerb = yard_with("busbar", yaw_deg=0.0), yard_with("kerb", yaw_deg=0.0)
    assert busbar.clearance(np.array([22.0, 20.0])) > 1.0
    assert kerb.clearance(np.array([20.0, 20.0])) < 0
    inspector = Robots(load_robot("inspector"), kerb, ONE_ELEMENT)
    inspector.reset([0], [(20.0, 19.0, np.pi / 2)])
    assert inspector.readings.values[0, LIDAR][0] == pytest.approx(1.0 - 0.075, abs=0.01)  # at the height of the lidar
    inspector.drive([0.5], [0.0], 3.0)
    assert inspector.touched[0] == ("equipment/it",)
    assert inspector.readings.pose[0, 1] < 20.0


def test_length_is_used_or_refused() -> None:
    assert yard_with("fence", length_m=9.0).solids.half_size_m[0, 0] == 4.5
    with pytest.raises(ValidationError, match="left out for a circuit_breaker, which has one size"):
        yard_with("circuit_breaker", length_m=9.0)
    with pytest.raises(ValidationError, match=r"kind: must be one of building, .*got `pump`"):
        yard_with("pump")


def test_voltage_is_used_or_refused() -> None:
    tops_m = [yard_with("surge_arrester", kv=kv).solids.top_m.max() for kv in VOLTAGES]
    assert tops_m == sorted(set(tops_m))
    with pytest.raises(ValidationError, match="kv: must be left out for a kerb"):
        yard_with("kerb", kv=220)
    with pytest.raises(ValidationError, match="should be 110, 220 or 400"):
        CatalogueEquipment.model_validate({"name": "it", "kind": "gantry", "position_m": (1.0, 1.0), "kv": 132})
