"""The notebook runs from top to bottom and gives its stored output."""

from pathlib import Path

import pytest

from tests.docs.site import ROOT

nbformat = pytest.importorskip("nbformat", reason="uv run --group docs")
nbclient = pytest.importorskip("nbclient", reason="uv run --group docs")

NOTEBOOK = ROOT / "docs" / "notebook" / "strengths_to_position.ipynb"


def code_cells(notebook: dict) -> list[dict]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def printed(cell: dict) -> str:
    return "".join(output["text"] for output in cell["outputs"] if output["output_type"] == "stream")


def n_pictures(cell: dict) -> int:
    return sum("image/png" in output.get("data", {}) for output in cell["outputs"])


def test_stored_notebook_has_pictures_and_no_local_paths() -> None:
    stored = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(stored)
    assert sum(n_pictures(cell) for cell in code_cells(stored)) >= 5
    assert not any(output["output_type"] == "error" for cell in code_cells(stored) for output in cell["outputs"])
    assert str(Path.home()) not in NOTEBOOK.read_text(encoding="utf-8")


@pytest.mark.whole
@pytest.mark.filterwarnings("default")  # the kernel's own sockets
def test_notebook_gives_its_stored_output(tmp_path: Path) -> None:
    stored, run = (nbformat.read(NOTEBOOK, as_version=4) for _ in range(2))
    nbclient.NotebookClient(run, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    for before, after in zip(code_cells(stored), code_cells(run), strict=True):
        assert printed(after) == printed(before)
        assert n_pictures(after) == n_pictures(before)
    (replay,) = [cell for cell in code_cells(run) if "notebook_viewer(" in cell["source"]]
    assert any("application/vnd.jupyter.widget-view+json" in output["data"] for output in replay["outputs"])
