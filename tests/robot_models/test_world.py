"""Laws of the built world: robot, array, floor, fence and equipment in one model."""
# pyright: reportAttributeAccessIssue=false

from pathlib import Path

import mujoco
import numpy as np
import pytest

from pdpatrol.robot_models.description.robot_description import xml_path
from pdpatrol.robot_models.description.robot_file import load_robot
from pdpatrol.robot_models.sensors import MAX_ELEMENTS, AntennaElements
from pdpatrol.robot_models.world import CHASE, build_spec
from tests.robot_models.one_robot import AZIMUTHS_RAD, RING_M, YARD


def with_elements(
    positions_m: np.ndarray, azimuths_rad: np.ndarray, elevations_rad: np.ndarray | float = 0.0
) -> mujoco.MjModel:
    elements = AntennaElements(positions_m, azimuths_rad, np.broadcast_to(elevations_rad, azimuths_rad.shape))
    return build_spec(load_robot("inspector"), YARD, elements).compile()


def test_element_sites_have_the_given_poses() -> None:
    rng = np.random.default_rng(1)
    positions, azimuths = rng.uniform(0.0, 0.7, size=(MAX_ELEMENTS, 3)), rng.uniform(-np.pi, np.pi, size=MAX_ELEMENTS)
    elevations = rng.uniform(-0.5, 0.5, size=MAX_ELEMENTS) * np.pi
    elevations[0] = 0.0
    model = with_elements(positions, azimuths, elevations)
    for k in range(MAX_ELEMENTS):
        site = model.site(f"element_{k + 1}")
        assert site.bodyid[0] == model.body("base").id
        np.testing.assert_allclose(site.pos, positions[k], atol=1e-12)
        axes, level = np.zeros(9), np.cos(elevations[k])
        mujoco.mju_quat2Mat(axes, site.quat)
        look = [level * np.cos(azimuths[k]), level * np.sin(azimuths[k]), np.sin(elevations[k])]
        np.testing.assert_allclose(axes[0::3], look, atol=1e-12)
        np.testing.assert_allclose(axes[7], 0.0, atol=1e-12)  # y stays level


@pytest.mark.parametrize("n_elements", [1, 4])
def test_array_has_its_elements_and_no_mass(n_elements: int) -> None:
    few, many = with_elements(RING_M[:n_elements], AZIMUTHS_RAD[:n_elements]), with_elements(RING_M, AZIMUTHS_RAD)
    names = [few.site(index).name for index in range(few.nsite)]
    assert [n for n in names if n.startswith("element_")] == [f"element_{k}" for k in range(1, n_elements + 1)]
    assert many.ngeom - few.ngeom == (6 - n_elements) * 5
    assert np.array_equal(few.body_mass, many.body_mass)
    assert np.array_equal(few.body_inertia, many.body_inertia)


def test_defaults_of_a_robot_do_not_change_the_yard(tmp_path: Path) -> None:
    text = xml_path("inspector").read_text(encoding="utf-8")
    plain, changed = tmp_path / "plain.xml", tmp_path / "changed.xml"
    plain.write_text(text, encoding="utf-8")
    changed.write_text(
        text.replace("<default>", '<default><geom rgba="1 0 0 1" friction="0.1" solref="0.1 1" margin="0.05"/>', 1),
        encoding="utf-8",
    )
    one, other = (build_spec(load_robot(path), YARD).compile() for path in (plain, changed))
    around = np.flatnonzero(one.geom_bodyid == 0)
    assert around.size == 1 + 4 + 2
    for field in ("geom_rgba", "geom_friction", "geom_solref", "geom_margin", "geom_solimp", "geom_contype"):
        assert np.array_equal(getattr(one, field)[around], getattr(other, field)[around]), field
    assert not np.array_equal(one.geom_friction, other.geom_friction)


def test_robot_without_camera_gets_one(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    text = xml_path("inspector").read_text(encoding="utf-8")
    path.write_text("\n".join(line for line in text.splitlines() if "<camera" not in line), encoding="utf-8")
    camera = build_spec(load_robot(path), YARD).compile().camera(CHASE)
    assert camera.pos[0] < -1.0
    assert camera.mode[0] == mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM


def test_fence_faces_are_the_boundary_of_the_yard():
    model = with_elements(RING_M, AZIMUTHS_RAD)
    faces = {}
    for side, axis, inward in (("west", 0, 1), ("south", 1, 1), ("east", 0, -1), ("north", 1, -1)):
        geom = model.geom(f"fence/{side}")
        faces[side] = geom.pos[axis] + inward * geom.size[axis]
        assert geom.pos[2] - geom.size[2] == pytest.approx(0.0)
        assert geom.size[1 - axis] >= 0.5 * YARD.size_m[1 - axis]
    assert faces == pytest.approx({"west": 0.0, "south": 0.0, "east": YARD.size_m[0], "north": YARD.size_m[1]})
