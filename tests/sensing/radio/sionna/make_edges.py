"""Make `edges.json` with an older Sionna: diffraction at one edge, for the links of `reference.json`.

Not a dependency of the project. By hand, with Python 3.11, in an environment of its own:

    pip install sionna==0.19.2              # brings TensorFlow; wants LLVM: apt install libllvm19
    DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM-19.so python make_edges.py

This one tries all edges, so it leaves out none but what a ray grazes, and has the coefficients of Luebbers 1984; later
ones turn the sign of what faces mirror. Two things are not as Kouyoumjian and Pathak have them: the sine of the angle
between ray and edge is left out, in the coefficients and in the distance parameter, and what a face mirrors is turned
into the basis of the ray that leaves instead of that of the mirrored one, which mixes polarisations. Both are small for
rays about at right angles to the edge, and large at edges on top.

A line for each link of `reference.json`, in its order, with its edges: point, delay and matrix as there.
"""

import json
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np
import sionna.rt as rt  # pyright: ignore[reportMissingImports]
from make_reference import AT_1M, FREQUENCY_HZ, YARDS, flat, to_mm, write_scene

HERE = Path(__file__).parent
Scene: TypeAlias = Any
MATERIAL = '<bsdf type="diffuse" id="mat-itu_{name}"/>'


def main() -> None:
    """Trace all links and write the file."""
    lines = []
    for yard in json.loads((HERE / "reference.json").read_text(encoding="utf-8"))["yards"]:
        with TemporaryDirectory() as folder:
            scene = rt.load_scene(write_scene(Path(folder), YARDS[yard["name"]]["boxes"], MATERIAL))
        scene.frequency = FREQUENCY_HZ
        scene.tx_array = scene.rx_array = rt.PlanarArray(1, 1, 0.5, 0.5, "iso", "VH", polarization_model=2)
        for link in yard["links"]:
            lines.append(json.dumps(edges_between(scene, link["source_m"], link["receiver_m"]), separators=(",", ":")))
    head = json.dumps({"made_with": f"sionna {version('sionna')}, make_edges.py"}, indent=1)
    joined = ",\n".join(lines)
    (HERE / "edges.json").write_text(f'{head[:-2]},\n "links":[\n{joined}]}}\n', encoding="utf-8")


def edges_between(scene: Scene, source_m: list[float], receiver_m: list[float]) -> list[Any]:
    """Return point, delay and matrix of each ray around an edge, the shortest first."""
    for name in [*scene.transmitters, *scene.receivers]:
        scene.remove(name)
    scene.add(rt.Transmitter("source", position=source_m))
    scene.add(rt.Receiver("receiver", position=receiver_m))
    ways = {"los": False, "reflection": False, "diffraction": True, "scattering": False, "edge_diffraction": False}
    paths = scene.compute_paths(max_depth=1, method="exhaustive", **ways)
    paths.normalize_delays = False
    if paths.tau.shape[-1] == 0:
        return []
    matrix = AT_1M * paths.a.numpy()[0, 0, :, 0, :, :, 0]  # (2 received, 2 sent, n_paths)
    delay_s, points_m = paths.tau.numpy()[0, 0, 0], paths.vertices.numpy()[0, 0, 0]
    there = np.flatnonzero((delay_s > 0.0) & (np.abs(matrix).max(axis=(0, 1)) > 0.0))
    found = [(to_mm(points_m[i]), round(1e9 * float(delay_s[i]), 5), flat(matrix[:, :, i])) for i in there]
    return sorted(found, key=lambda edge: edge[1])


if __name__ == "__main__":
    main()
