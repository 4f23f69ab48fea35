"""Each example runs, as its first lines say."""

import json
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from conftest import DATA, ROOT

EXAMPLES = ROOT / "python" / "examples"

ARGUMENTS = {
    "training_views.py": [DATA / "bunny.obj", DATA / "cameras" / "transforms.json", "views.npz"],
    "orthophoto.py": [DATA / "autzen.laz", 10, "photo.png"],
    "swapped_kernel.py": [DATA / "autzen.laz"],
    "turntable.py": [DATA / "bunny.obj", 3, "around"],
    "from_arrays.py": [],
    "several_processes.py": [DATA / "autzen.laz", 3],
}


def test_no_example_is_left_out():
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(ARGUMENTS)


@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_example_runs(name, tmp_path):
    line = [sys.executable, EXAMPLES / name, *ARGUMENTS[name]]
    done = subprocess.run([str(word) for word in line], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout
    if name == "training_views.py":
        with np.load(tmp_path / "views.npz") as arrays:
            assert arrays["depth"].shape == (12, 400, 400) and arrays["normal"].shape == (12, 400, 400, 3)
            assert np.isfinite(arrays["depth"]).mean() > 0.05
    if name == "several_processes.py":
        assert "the bits of one process: True" in done.stdout
    if name == "turntable.py":
        assert len(list((tmp_path / "around").glob("*.png"))) == 3


def test_the_cells_of_the_notebook_run():
    """Runs the code of the cells; with nbclient installed, in a kernel too."""
    cells = json.loads((EXAMPLES / "tour.ipynb").read_text())["cells"]
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert names["frames"].depth.shape == (4, 240, 320)


def test_the_notebook_runs_in_a_kernel():
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(EXAMPLES / "tour.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=120).execute()
    pictures = [output for cell in notebook.cells for output in cell.get("outputs", []) if "image/png" in output.get("data", {})]
    assert pictures


def test_the_readmes_lines_run(tmp_path):
    text = (ROOT / "python" / "README.md").read_text()
    code = text.split("```python\n")[1].split("```")[0].replace("scan.laz", str(pathlib.Path(DATA / "autzen.laz")))
    names = {}
    exec(code, names)
    assert names["frames"].depth.shape == (1, 1080, 1920)
