"""Trace the links of `reference.json` again with Sionna RT: three yards of metal boxes on concrete ground.

Sionna RT is not a dependency of the project. Run this by hand with Python 3.11 in a separate environment:

    pip install sionna-rt==2.2.0            # needs LLVM: apt install libllvm19
    DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM-19.so python make_reference.py

It keeps the boxes, sources and receivers of the file, and writes direct paths, reflections of first and second order,
including the ground, and diffraction at one edge. Two runs write the same bytes. Four seeds with 200 000 to 2 000 000
rays find the same paths, except for two edges of a box that has a face in one plane with the source.

**Boxes** have no lower face, and their faces share corners: Sionna finds edges between adjacent triangles, but not at
the ground, where upright edges end. Of the edges of rotated boxes that are visible from both ends, it omits some behind
which the ray leaves along the face that it arrived on.

**Ground**: a slab. Its lower side is 2 m down, and the wave loses 200 dB on the path there and back, so that the slab
acts as a half-space. With Sionna's default of 0.1 m, the lower side would change the reflection by up to 2 dB.

**Matrices** are in the bases of spherical coordinates, theta (down, for level rays) and phi (counterclockwise from
above), of the direction in which source and receiver see the ray, as for `iso` antennas `V` and `H` of the model
`tr38901_2`. Rows are received components, columns are sent ones: for a direct path, [[1, 0], [0, -1]] over its length.
Waves vary as exp(+j omega t); the phase exp(-2 pi j f delay) of the path is not in the matrix.

**Edges**: this version inverts the sign of the reflections by the faces of a wedge. For a conductor it has
R_0 (D1 - D4) + R_n (D2 - D3), with R = 1 along the edge and -1 across it, and R_n = -1 for a face in the shadow;
Kouyoumjian and Pathak have -(D1 + D2) + R_0 D4 + R_n D3. Steps remain where reflections end, and the field is off
the exact solution of a wedge by up to the incident wave. Its component across an edge is the correct one along it; both
components of ours are compared with exact solutions in `test_diffraction.py`.
"""

import json
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np
import sionna.rt as rt  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

from dirmusic.arrays import FloatArray

FREQUENCY_HZ = 1.75e9
AT_1M = 4 * np.pi * FREQUENCY_HZ / 299_792_458.0
"""Factor from the coefficient of a path to its amplitude relative to that at 1 m."""
GROUND_M = 2.0
N_RAYS, SEED = 1_000_000, 1
DIFFRACTION = 8
"""Value of `rt.constants.InteractionType.DIFFRACTION`."""
DIRECT, REFLECTION, EDGE = "direct", "reflection", "edge"
FACES = ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7))
"""Corners of a box, lower ones first, counterclockwise: its sides, and its top."""

Scene: TypeAlias = Any
Box = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]
Found = tuple[str, tuple[str, ...], tuple[Position, ...], float, tuple[float, ...]]
"""Kind, objects met in order, points, delay in ns and matrix of a path."""


def main() -> None:
    """Trace all links and write the file."""
    file = Path(__file__).with_name("reference.json")
    reference = json.loads(file.read_text(encoding="utf-8"))
    for yard in reference["yards"]:
        with TemporaryDirectory() as folder:
            scene = rt.load_scene(write_scene(Path(folder), yard["boxes"]), merge_shapes=False)
        scene.frequency = FREQUENCY_HZ
        scene.tx_array = scene.rx_array = rt.PlanarArray(
            num_rows=1, num_cols=1, pattern="iso", polarization="VH", polarization_model="tr38901_2"
        )
        for source, of_source in groupby(yard["links"], key=lambda link: link["source_m"]):
            links = list(of_source)
            for link, paths in zip(links, trace(scene, source, [link["receiver_m"] for link in links]), strict=True):
                link["paths"] = paths
    reference["made_with"] = f"sionna-rt {version('sionna-rt')}, make_reference.py"
    file.write_text(json.dumps(reference), encoding="utf-8")


def trace(scene: Scene, source: Position, receivers: list[Position]) -> list[list[Found]]:
    """Return all paths from a source, for each receiver in order of their delays."""
    for name in [*scene.transmitters, *scene.receivers]:
        scene.remove(name)
    scene.add(rt.Transmitter("source", position=list(source)))
    for k, position in enumerate(receivers):
        scene.add(rt.Receiver(f"receiver_{k:02}", position=list(position)))
    reflected = solve(scene, max_depth=2)
    diffracted = solve(scene, max_depth=1, los=False, specular_reflection=False, diffraction=True)
    return [sorted([*some, *more], key=lambda path: path[3]) for some, more in zip(reflected, diffracted, strict=True)]


def solve(scene: Scene, **options: int) -> list[list[Found]]:
    """Return the paths that one run of the solver finds, for each receiver."""
    paths = rt.PathSolver(deterministic=True)(
        scene,
        samples_per_src=N_RAYS,
        diffuse_reflection=False,
        refraction=False,
        edge_diffraction=False,
        diffraction_lit_region=True,
        seed=SEED,
        **options,
    )
    names = {thing.object_id: name for name, thing in scene.objects.items()}
    real, imaginary = (np.asarray(part) for part in paths.a)
    matrix = AT_1M * (real + 1j * imaginary)[:, :, 0]  # (n_receivers, 2 received, 2 sent, n_paths)
    delay_s, valid = (np.asarray(part)[:, 0] for part in (paths.tau, paths.valid))
    kinds, objects = (np.asarray(part)[:, :, 0] for part in (paths.interactions, paths.objects))
    points_m = np.asarray(paths.vertices)[:, :, 0]
    answer: list[list[Found]] = []
    for k in range(delay_s.shape[0]):
        answer.append([])
        for i in np.flatnonzero(valid[k]):
            there = kinds[:, k, i] != 0
            kind = EDGE if (kinds[:, k, i] == DIFFRACTION).any() else REFLECTION if there.any() else DIRECT
            met = tuple(names[int(thing)].removeprefix("mesh-") for thing in objects[there, k, i])
            at = tuple(to_mm(point) for point in points_m[there, k, i])
            answer[-1].append((kind, met, at, round(1e9 * float(delay_s[k, i]), 5), flat(matrix[k, :, :, i])))
    return answer


def to_mm(point: FloatArray) -> Position:
    """Round to millimetres, without a minus before 0."""
    x, y, z = (round(float(value), 3) + 0.0 for value in point)
    return x, y, z


def flat(matrix: NDArray[np.complex128]) -> tuple[float, ...]:
    """Return real and imaginary parts row by row, to six digits of the largest."""
    parts = np.stack([matrix.real, matrix.imag], axis=-1).ravel()
    digits = 6 - int(np.ceil(np.log10(np.abs(parts).max())))
    return tuple(round(float(value), digits) + 0.0 for value in parts)


SLAB = (
    '<bsdf type="itu-radio-material" id="mat-itu_{name}"><string name="type" value="{name}"/>'
    f'<float name="thickness" value="{GROUND_M}"/></bsdf>'
)


def write_scene(folder: Path, boxes: dict[str, Box]) -> str:
    """Write a Mitsuba scene of the ground and the boxes."""
    ground = [(x, y, 0.0) for x, y in ((-60.0, -60.0), (90.0, -60.0), (90.0, 80.0), (-60.0, 80.0))]
    meshes: dict[str, Any] = {"ground": (ground, ((0, 1, 2, 3),))}
    for name, (x, y, length, width, height, yaw_deg) in boxes.items():
        cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
        sides = [(p * length, q * width) for p, q in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))]
        corners = [(x + cos * p - sin * q, y + sin * p + cos * q, z) for z in (0.0, height) for p, q in sides]
        meshes[name] = (corners, FACES)
    shapes = []
    for name, (corners, faces) in meshes.items():
        triangles = [f"3 {face[a]} {face[b]} {face[c]}" for face in faces for a, b, c in ((0, 1, 2), (0, 2, 3))]
        header = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
        header += [f"property float {axis}" for axis in "xyz"]
        header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
        lines = [*header, *(" ".join(str(float(v)) for v in corner) for corner in corners), *triangles]
        (folder / f"{name}.ply").write_text("\n".join(lines) + "\n", encoding="utf-8")
        substance = "concrete" if name == "ground" else "metal"
        shapes.append(
            f'<shape type="ply" id="mesh-{name}"><string name="filename" value="{folder}/{name}.ply"/>'
            f'<boolean name="face_normals" value="true"/><ref id="mat-itu_{substance}" name="bsdf"/></shape>'
        )
    materials = "".join(SLAB.format(name=name) for name in ("metal", "concrete"))
    path = folder / "scene.xml"
    path.write_text(f'<scene version="2.1.0">{materials}{"".join(shapes)}</scene>', encoding="utf-8")
    return str(path)


if __name__ == "__main__":
    main()
