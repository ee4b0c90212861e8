"""Robots from MJCF files: reading, validation and measurement.

A file describes one robot, without a world around it, in the frame of its body `base`: x forward, y left, z up, with
the origin on the floor, midway between the left and the right wheels. It must contain

- the body `base`, a child of the world, with the free joint `floating_base`;
- one or more hinges on each side, about +y, whose names begin with `left_wheel` and `right_wheel`, in bodies with a
  geom that stands on the floor (conaffinity 1); all wheels must have the same radius. Each hinge needs an actuator that
  takes the speed of the wheel in rad/s: `<velocity>`, or `<dcmotor input="vel">`;
- the site `imu`, in the orientation of the base, with the sensor `gyro`, and the site `lidar` above the x axis of the
  base, where the beam that points ahead starts; the other beams start at the same distance from the origin;
- a hull: geoms that collide with obstacles (conaffinity 2) and that cover the wheels as seen from above. The contype of
  all geoms must be 0;
- the custom numerics `max_speed`, m/s, `max_yaw_rate`, rad/s, and `max_acceleration`, m/s^2, each above 0. A robot that
  skids when it turns, and therefore controls its yaw rate with its gyro, also needs `yaw_rate_gain`, 1/s;
- optionally a keyframe `home` in which the robot rests at the origin; without it, a simulation lets the robot settle.

Lidar beams, contact sensors of the hull and antenna elements are added when a world is built: see `world.py`.
"""
# pyright: reportAttributeAccessIssue=false
# The compiled bindings of MuJoCo carry no types for their enums and spec elements.

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from dirmusic.arrays import FloatArray, IntArray
from dirmusic.input_file import InputFileError
from pdpatrol.robot_models.description.robot_description import SHIPPED, RobotDescription, is_path, xml_path
from pdpatrol.robot_models.sensors import FLOOR_CONTYPE, LIDAR_PERIOD_S, MAX_ELEMENTS, OBSTACLE_CONTYPE, AntennaElements
from pdpatrol.robot_models.world import build_spec
from pdpatrol.robot_models.yard.yard import ROBOT_HEIGHT_M, Yard

TOLERANCE_M = 0.005
"""Tolerance of positions in a robot file (assumed)."""

Requirements = Mapping[str, bool | np.bool_]
"""Requirements of a file, as text, and whether each is met."""


def load_robot(model: str | Path) -> RobotDescription:
    """Load the description of a robot.

    Args:
        model: Name of a shipped robot, or path of an MJCF file.

    Raises:
        InputFileError: If the name is unknown, or the file does not describe a robot.
    """
    if is_path(model):
        return read_robot(Path(model))
    if str(model) not in SHIPPED:
        raise InputFileError([f"{model}: must be one of {', '.join(SHIPPED)}, or the path of an MJCF file, in .xml"])
    return _shipped(str(model))


@cache
def _shipped(name: str) -> RobotDescription:
    return read_robot(xml_path(name))


def read_robot(path: Path) -> RobotDescription:
    """Read and measure a robot; the docstring of this module describes the contents of its file.

    Raises:
        InputFileError: If the file cannot be read, or does not describe a robot. All errors of its parts are listed
            together; without any, all errors of its measures are.
    """
    if not path.is_file():
        raise InputFileError([f"{path}: no such file; it must be an MJCF file"])
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)  # otherwise MuJoCo prints them and writes a log file
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        if spec.numeric("yaw_rate_gain") is None:
            spec.add_numeric(name="yaw_rate_gain", data=[0.0])
        model = spec.compile()
        _refuse(path, _part_requirements(model))
        robot = _at_rest(_measure(path, model), has_home=spec.key("home") is not None)
        if not warnings:
            return robot
    except InputFileError:
        raise
    except (ValueError, KeyError) as error:  # a KeyError names the missing part and the existing ones
        warnings.append(str(error.args[0]))
    finally:
        mujoco.set_mju_user_warning(before)
    lines = [" ".join(text.removeprefix("Error: ").split()) for text in warnings]
    raise InputFileError([f"{path}: refused by MuJoCo: {line}" for line in lines])


def _refuse(path: Path, requirements: Requirements) -> None:
    """Raise an error with a line for each requirement that does not hold."""
    if faults := [f"{path}: {requirement}" for requirement, holds in requirements.items() if not holds]:
        raise InputFileError(faults)


def _numeric(model: mujoco.MjModel, name: str) -> float:
    """Return the value of a custom numeric: NaN if it is not a single number."""
    values = model.numeric(name).data
    return float(values[0]) if values.size == 1 else np.nan


def _part_requirements(model: mujoco.MjModel) -> Requirements:
    base, free, gyro = model.body("base").id, model.joint("floating_base"), model.sensor("gyro")
    imu, lidar = model.site("imu"), model.site("lidar")
    is_on_floor = model.geom_conaffinity & FLOOR_CONTYPE > 0
    is_hull = model.geom_conaffinity & OBSTACLE_CONTYPE > 0
    (joints, actuators, sides), gain = driven_wheels(model), _numeric(model, "yaw_rate_gain")
    limits = {name: _numeric(model, name) for name in ("max_speed", "max_yaw_rate", "max_acceleration")}
    are_hinges = (model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE).all()
    are_on_floor = np.isin(model.jnt_bodyid[joints], model.geom_bodyid[is_on_floor]).all()
    is_free = free.type[0] == mujoco.mjtJoint.mjJNT_FREE and free.bodyid[0] == base
    is_alone = (model.body_rootid[1:] == base).all() and not (model.geom_bodyid == 0).any()
    is_level = np.allclose(np.abs(imu.quat), [1.0, 0.0, 0.0, 0.0], atol=1e-3)
    is_gyro = gyro.type[0] == mujoco.mjtSensor.mjSENS_GYRO and gyro.objid[0] == imu.id
    is_filtered = not (model.geom_contype.any() or (is_on_floor & is_hull).any())
    are_wheels = np.unique(sides).size == 2 and are_hinges and are_on_floor and (actuators >= 0).all()
    return {
        "base: must have the free joint `floating_base`": is_free,
        "base: must be the only child of the world; leave out floor and obstacles": is_alone,
        "imu: must be a site of `base`, in its orientation": imu.bodyid[0] == base and is_level,
        "lidar: must be a site of `base`": lidar.bodyid[0] == base,
        "gyro: must be a gyro at the site `imu`": is_gyro,
        "geoms: contype must be 0, because a robot does not touch itself, and conaffinity 1 to touch the floor or 2 to "
        "touch obstacles, not both": is_filtered,
        "wheels: must be hinges with names that begin with `left_wheel` and `right_wheel`, each with an actuator, in "
        "bodies with a geom that touches the floor, with conaffinity 1": are_wheels,
        "hull: a geom must touch obstacles, with conaffinity 2": is_hull.any(),
        f"yaw_rate_gain: must be one number of 0 or more, got {gain:g}": 0.0 <= gain < np.inf,
        **{f"{name}: must be one number above 0, got {x:g}": 0.0 < x < np.inf for name, x in limits.items()},
    }


def _measure(path: Path, model: mujoco.MjModel) -> RobotDescription:
    r"""Measure a robot that has all required parts, and check its measures.

    The effective track of a skid-steered robot is computed as follows. A wheel at a distance x ahead of the centre
    slips sideways at x times the yaw rate. Friction is along the slip, and all wheels are assumed to carry the same
    load. The moments of longitudinal and lateral friction then cancel for

    .. math:: b' = b + 4 \overline{x^2} / b

    where b is the track, the distance between left and right wheels. If all wheels are on one axle, b' equals b.
    """
    data = mujoco.MjData(model)
    data.joint("floating_base").qpos = [
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        0.0,
    ]  # so that the world frame is that of the base
    mujoco.mj_kinematics(model, data)
    (joints, actuators, sides), up = driven_wheels(model), np.array([[0.0, 0.0, 1.0]])
    is_on_floor = model.geom_conaffinity & FLOOR_CONTYPE > 0
    rolling = [np.flatnonzero(is_on_floor & (model.geom_bodyid == body))[0] for body in model.jnt_bodyid[joints]]
    place_m = data.geom_xpos[rolling]
    radius_m = extents(model, data, rolling, -up)[:, 0] + place_m[:, 2]
    left_m, right_m = (place_m[sides == side, :2].mean(axis=0) for side in (0, 1))
    track_m = float(left_m[1] - right_m[1])
    angle_rad = np.radians(np.arange(0.0, 360.0, 1.0))  # outlines have a relative error below 4e-5
    level = np.column_stack([np.cos(angle_rad), np.sin(angle_rad), np.zeros(360)])
    touching, hull = (
        np.flatnonzero(bits) for bits in (model.geom_conaffinity, model.geom_conaffinity & OBSTACLE_CONTYPE)
    )
    outline_m, hull_m = (extents(model, data, geoms, level).max(axis=0) for geoms in (touching, hull))
    x, y, z = model.site("lidar").pos.tolist()
    robot = RobotDescription(
        name=path.stem,
        xml_path=path,
        home_qpos=tuple(model.qpos0.tolist()),
        wheel_radius_m=float(radius_m[0]),
        turning_track_m=track_m + 4.0 * float(place_m[:, 0].var()) / track_m if track_m > 0 else np.nan,
        footprint_radius_m=float(outline_m.max()),
        inner_radius_m=float(hull_m.min()),
        height_m=float(extents(model, data, touching, up).max()),
        max_speed_mps=_numeric(model, "max_speed"),
        max_yaw_rate_radps=_numeric(model, "max_yaw_rate"),
        max_acceleration_mps2=_numeric(model, "max_acceleration"),
        yaw_rate_gain=_numeric(model, "yaw_rate_gain"),
        lidar_start_m=x,
        lidar_height_m=z,
    )
    (middle_x, middle_y), above_m = 0.5 * (left_m + right_m), place_m[:, 2] - radius_m
    excess_m = float((outline_m - hull_m).max())
    needed_mps = robot.max_speed_mps + 0.5 * robot.turning_track_m * robot.max_yaw_rate_radps
    needed_radps = needed_mps / robot.wheel_radius_m
    low, high = model.actuator_ctrlrange[actuators].T
    is_wide = (low <= -needed_radps) & (high >= needed_radps) | (model.actuator_ctrllimited[actuators] == 0)
    spin_radps, is_stable = _spin(model, joints, actuators)
    is_fast = not is_stable or np.allclose(spin_radps, 1.0, atol=0.05)
    steps = LIDAR_PERIOD_S / model.opt.timestep
    is_inside = 0.0 <= x <= robot.inner_radius_m + 1e-6 and abs(y) <= 1e-6 and 0.0 < z <= robot.height_m
    is_round = np.ptp(radius_m) <= TOLERANCE_M and np.abs(above_m).max() <= TOLERANCE_M
    is_centred = track_m > 0 and max(abs(middle_x), abs(middle_y)) <= TOLERANCE_M
    requirements = {
        "wheels: axes must be 0 1 0, so that a positive speed drives forward": np.allclose(
            data.xaxis[joints], [0.0, 1.0, 0.0], atol=1e-3
        ),
        "wheels: must have one radius, and stand at the height of the base's origin; "
        f"radii {radius_m.round(3)} m, above it {above_m.round(3)} m": is_round,
        "wheels: those on the left must have a larger y, and the middle between them must be the base's origin; "
        f"track {track_m:.3f} m, middle {middle_x:.3f} {middle_y:.3f} m": is_centred,
        f"hull: must cover wheels and casters, which extend {excess_m:.3f} m beyond it": excess_m <= TOLERANCE_M,
        f"hull: must be at most {ROBOT_HEIGHT_M} m high, because paths are planned below equipment that begins higher, "
        f"got {robot.height_m:.2f} m": robot.height_m <= ROBOT_HEIGHT_M,
        f"lidar: must have x from 0 to {robot.inner_radius_m:.3f}, within the hull, y 0, and z from the floor to "
        f"{robot.height_m:.2f}, got {x:g} {y:g} {z:g}": is_inside,
        'actuators: must take the speed of the wheel, <velocity> or <dcmotor input="vel">; in the air, the wheels turn '
        f"at {spin_radps.round(3)} rad/s, 1 s after 1 rad/s was commanded": is_fast,
        "actuators: the servos of the wheels must be stable, but in the air MuJoCo warns that they are not; lower the "
        f"gain (kv), shorten the timestep of {model.opt.timestep:g} s, or add armature": is_stable,
        f"actuators: ctrlrange must hold {-needed_radps:.3g} to {needed_radps:.3g}, which max_speed and max_yaw_rate "
        f"need together, got {low.max():g} to {high.min():g}": is_wide.all(),
        f"option: timestep must be a whole fraction of {LIDAR_PERIOD_S} s, the time between two commands, got "
        f"{model.opt.timestep:g} s": steps >= 1 and abs(steps - round(steps)) <= 1e-6,
    }
    _refuse(path, requirements)
    return robot


def _spin(model: mujoco.MjModel, joints: IntArray, actuators: IntArray) -> tuple[FloatArray, bool]:
    """Command 1 rad/s for 1 s to the wheels, lifted off the floor.

    Returns:
        Their speeds at the end, shape (n_wheels,); and False if MuJoCo warned of an unstable simulation, in which it
        starts again from speed 0.
    """
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0.0
    data.ctrl[actuators] = 1.0
    mujoco.mj_step(model, data, nstep=round(1.0 / model.opt.timestep))
    return data.qvel[model.jnt_dofadr[joints]], not any(warning.number for warning in data.warning)


def _at_rest(robot: RobotDescription, has_home: bool) -> RobotDescription:
    """Let a robot settle in an empty yard for 3 s (assumed), and return it with its joint positions at rest.

    If the file has a keyframe, the joint positions come from the keyframe.

    Raises:
        ValueError: If no world can be built around the robot, for example because of a name that the world needs.
    """
    elements = AntennaElements(np.zeros((MAX_ELEMENTS, 3)), *np.zeros((2, MAX_ELEMENTS)))
    world = build_spec(robot, Yard(size_m=(5.0, 5.0)), elements).compile()
    data = mujoco.MjData(world)
    mujoco.mj_resetDataKeyframe(world, data, world.key("home").id)
    home_qpos, base = data.qpos.copy(), data.joint("floating_base")
    base.qpos[:2] += 2.5
    mujoco.mj_step(world, data, nstep=round(3.0 / world.opt.timestep))
    moved_m = np.abs(base.qpos[:2] - 2.5).max()
    stands = data.body("base").xmat[8] >= np.cos(np.radians(10.0)) and np.abs(data.qvel).max() <= 0.05
    if not has_home:
        home_qpos, moved_m = data.qpos, 0.0
        base.qpos[:2], base.qpos[6] = 0.0, 0.0
        base.qpos[3:7] /= np.linalg.norm(base.qpos[3:7])
    is_home = stands and moved_m <= TOLERANCE_M
    _refuse(robot.xml_path, {"home: the robot must stand by itself, upright and at rest at the origin": is_home})
    return replace(robot, home_qpos=tuple(home_qpos.tolist()))


def driven_wheels(model: mujoco.MjModel) -> tuple[IntArray, IntArray, IntArray]:
    """Find the driven wheels: hinges whose names begin with `left_wheel` or `right_wheel`, the left ones first.

    Returns:
        Index of the joint of each wheel, index of the first actuator of that joint (-1 if it has none), and side of the
        wheel (0 for left, 1 for right), each of shape (n_wheels,).
    """
    found = [
        (joint, side)
        for side, prefix in enumerate(("left_wheel", "right_wheel"))
        for joint in range(model.njnt)
        if model.joint(joint).name.startswith(prefix)
    ]
    joint, side = np.array(found, dtype=np.intp).reshape(-1, 2).T
    driven = np.where(model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT, model.actuator_trnid[:, 0], -1).tolist()
    actuator = [driven.index(number) if number in driven else -1 for number in joint.tolist()]
    return joint, np.array(actuator, dtype=np.intp), side


def extents(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int] | IntArray, directions: FloatArray
) -> FloatArray:
    r"""Compute the extent of each geom in each direction, from the origin of the world (support function).

    .. math:: h(d) = \max_{p} d \cdot p

    The maximum is over the points p of the geom. Other geoms than primitives and meshes are replaced by their bounding
    spheres.

    Args:
        model: Model of the geoms.
        data: Data of the model after `mj_kinematics`.
        geoms: Indices of the geoms.
        directions: Unit vectors, world frame, shape (n_directions, 3).

    Returns:
        Extents, shape (n_geoms, n_directions), metres.
    """
    return np.array(
        [
            directions @ data.geom_xpos[geom] + _support(model, geom, directions @ data.geom_xmat[geom].reshape(3, 3))
            for geom in geoms
        ]
    )


def _support(model: mujoco.MjModel, geom: int, directions: FloatArray) -> FloatArray:
    """Compute the extents, shape (n,), of a geom from its centre, in directions of its frame, shape (n, 3)."""
    size_m, along = model.geom_size[geom], np.abs(directions[:, 2])
    match mujoco.mjtGeom(int(model.geom_type[geom])):
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return size_m[0] + size_m[1] * along
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return size_m[0] * np.sqrt(np.maximum(1.0 - along**2, 0.0)) + size_m[1] * along
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return np.sqrt(np.square(directions * size_m).sum(axis=-1))
        case mujoco.mjtGeom.mjGEOM_BOX:
            return np.abs(directions) @ size_m
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = int(model.geom_dataid[geom])
            first, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            return (directions @ model.mesh_vert[first : first + n].T.astype(np.float64)).max(axis=-1)
        case _:
            return np.full(len(directions), model.geom_rbound[geom])
