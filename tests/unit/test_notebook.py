"""The notebook of the docs runs from top to bottom, and is stored without outputs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY

NOTEBOOK = REPOSITORY / "docs/first_steps.ipynb"
# In a process of its own: the libraries around a kernel warn, and here warnings are errors.
RUN = """
import sys, nbclient, nbformat
notebook = nbformat.read(sys.argv[1], 4)
nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
nbformat.write(notebook, sys.argv[2])
"""


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    return [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == kind]


def test_it_is_stored_without_outputs() -> None:
    code = cells(NOTEBOOK, "code")
    assert len(code) > 8 and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.slow  # starts a kernel, and simulates for seconds
def test_it_runs(tmp_path: Path) -> None:
    done = tmp_path / "done.ipynb"
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "IPYTHONDIR": str(tmp_path), "TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", RUN, str(NOTEBOOK), str(done)]
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr[-3000:]
    outputs = [output for cell in cells(done, "code") for output in cell["outputs"]]
    shown = [output["data"] for output in outputs if "data" in output]
    assert sum("image/png" in data for data in shown) == 3
    assert any("Result &#x27;A nut on a standing wave" in "".join(data.get("text/html", "")) for data in shown)
    text = "".join("".join(output.get("text", "")) for output in outputs)
    assert "drive[0].amplitude_um: is -5.0" in text and "100 %" in text and "scene.h5" in text
