"""The notebooks run from their first to their last cell."""

from __future__ import annotations

import shutil
from pathlib import Path

import nbclient
import nbformat
import pytest

REPOSITORY = Path(__file__).parents[2]
NOTEBOOKS = sorted((REPOSITORY / "python" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    # logs are written to the folder of the notebook, which has the cases two folders above
    folder = tmp_path / "python" / "notebooks"
    folder.mkdir(parents=True)
    shutil.copytree(REPOSITORY / "cases" / "welding", tmp_path / "cases" / "welding")
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook, timeout=300, resources={"metadata": {"path": str(folder)}}
    )
    client.execute()
    printed = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in printed)
    assert list(folder.glob("*.mcap"))
