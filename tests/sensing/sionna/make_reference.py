"""Make `reference.json` with Sionna RT: one scene with ground, a wall and a box, all of metal.

Not a dependency of the project. By hand, with Python 3.11, in an environment of its own:

    pip install sionna-rt==2.2.0            # wants LLVM: apt install libllvm19
    DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM-19.so python make_reference.py
"""

import json
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import sionna.rt as rt  # pyright: ignore[reportMissingImports]

HERE = Path(__file__).parent
FREQUENCY_HZ = 1.75e9
AT_1M = 4 * np.pi * FREQUENCY_HZ / 299_792_458.0
"""Turns a path's coefficient into its amplitude over that at 1 m."""
BOXES = {  # lowest and highest corner, metres; also the yard of the test
    "wall": ((2.0, 16.0, 0.0), (22.0, 16.4, 4.0)),
    "box": ((11.0, 4.0, 0.0), (13.0, 6.0, 2.0)),
}
SOURCE_M = (6.0, 10.0, 1.5)
RECEIVERS_M = ((14.0, 11.0, 0.6), (17.0, 8.0, 0.6), (20.0, 1.5, 0.6), (9.0, 7.0, 0.6), (15.5, 13.0, 0.6))


def main() -> None:
    """Trace and write."""
    with TemporaryDirectory() as folder:
        scene = rt.load_scene(write_scene(Path(folder)), merge_shapes=False)
    scene.frequency = FREQUENCY_HZ
    scene.tx_array = scene.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    scene.add(rt.Transmitter("source", position=list(SOURCE_M)))
    for k, position in enumerate(RECEIVERS_M):
        scene.add(rt.Receiver(f"receiver_{k}", position=list(position)))
    paths = rt.PathSolver()(
        scene, max_depth=1, los=True, specular_reflection=True, diffuse_reflection=False, refraction=False
    )
    real, imaginary = (np.asarray(part) for part in paths.a)
    amplitude = np.abs(real + 1j * imaginary)[:, 0, 0, 0]  # (n_receivers, n_paths)
    delay_s = np.asarray(paths.tau)
    delay_s = delay_s.reshape(amplitude.shape)
    rows = []
    for k, position in enumerate(RECEIVERS_M):
        there = (delay_s[k] >= 0) & (amplitude[k] > 0)
        order = np.argsort(delay_s[k][there])
        rows.append(
            {
                "position_m": position,
                "delay_ns": [round(1e9 * float(value), 4) for value in delay_s[k][there][order]],
                "amplitude_1m": [round(float(value) * AT_1M, 5) for value in amplitude[k][there][order]],
            }
        )
    reference = {
        "made_with": f"sionna-rt {version('sionna-rt')}, make_reference.py",
        "frequency_hz": FREQUENCY_HZ,
        "reflection": -1.0,
        "boxes": BOXES,
        "source_m": SOURCE_M,
        "receivers": rows,
    }
    (HERE / "reference.json").write_text(json.dumps(reference, indent=1) + "\n", encoding="utf-8")


def write_scene(folder: Path) -> str:
    """A Mitsuba scene of the ground and the boxes."""
    quads = {"ground": [[(-40.0, -40.0, 0.0), (60.0, -40.0, 0.0), (60.0, 60.0, 0.0), (-40.0, 60.0, 0.0)]]}
    for name, ((x0, y0, z0), (x1, y1, z1)) in BOXES.items():
        quads[name] = [
            [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
            [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
            [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
            [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
            [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        ]
    shapes = []
    for name, faces in quads.items():
        corners = [corner for face in faces for corner in face]
        triangles = [
            f"3 {4 * i + a} {4 * i + b} {4 * i + c}" for i in range(len(faces)) for a, b, c in ((0, 1, 2), (0, 2, 3))
        ]
        header = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
        header += [f"property float {axis}" for axis in "xyz"]
        header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
        lines = [*header, *(" ".join(str(v) for v in corner) for corner in corners), *triangles]
        (folder / f"{name}.ply").write_text("\n".join(lines) + "\n", encoding="utf-8")
        shapes.append(
            f'<shape type="ply" id="mesh-{name}"><string name="filename" value="{folder}/{name}.ply"/>'
            f'<boolean name="face_normals" value="true"/><ref id="mat-itu_metal" name="bsdf"/></shape>'
        )
    material = (
        '<bsdf type="itu-radio-material" id="mat-itu_metal"><string name="type" value="metal"/>'
        '<float name="thickness" value="0.1"/></bsdf>'
    )
    path = folder / "scene.xml"
    path.write_text(f'<scene version="2.1.0">{material}{"".join(shapes)}</scene>', encoding="utf-8")
    return str(path)


if __name__ == "__main__":
    main()
