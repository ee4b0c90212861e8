"""Add the replays of docs/gallery.md to the pages in site/: three missions, and the web viewer of the installed Rerun.

uv run --group docs python -m zensical build --strict && uv run python docs/make_gallery.py
"""

import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.request import urlopen

from pdpatrol.missions.recording import serve

MISSIONS = {
    "two_sources": "run two_sources --seed 7",
    "switchyard": "run switchyard --seed 2",
    "quiet_yard": "run quiet_yard --policy patrol",
}
"""Arguments of `pdpatrol` by the name of the recording."""

VIEWER = ("index.html", "re_viewer.js", "re_viewer_bg.wasm", "favicon.ico")
"""Files of the web viewer."""


def make_gallery(site: Path) -> None:
    """Write recordings and viewer into `replay` in the folder of the built pages."""
    folder = site / "replay"
    folder.mkdir(exist_ok=True)
    for name, arguments in MISSIONS.items():
        with TemporaryDirectory() as mission:
            command = [str(Path(sys.executable).with_name("pdpatrol")), *arguments.split(), "--out", f"{mission}/it"]
            subprocess.run(command, check=True)
            (folder / f"{name}.rrd").write_bytes(Path(mission, "it", "mission.rrd").read_bytes())

    def copy(url: str) -> None:
        for name in VIEWER:
            with urlopen(f"{url.partition('?')[0]}{name}") as file:
                (folder / name).write_bytes(file.read())
        raise KeyboardInterrupt  # ends the server

    with suppress(KeyboardInterrupt):
        serve([folder / f"{name}.rrd" for name in MISSIONS], copy)


if __name__ == "__main__":
    make_gallery(Path(__file__).parents[1] / "site")
