"""What the build takes for the package: hatch leaves out every file that .gitignore names, tracked or not."""

from __future__ import annotations

import subprocess

import pytest
from conftest import REPOSITORY


@pytest.mark.skipif(not (REPOSITORY / ".git").exists(), reason="no git checkout")
def test_no_file_of_the_package_is_left_out_of_a_wheel() -> None:
    paths = (path for kind in ("*.py", "*.j2") for path in (REPOSITORY / "feeder_sim").rglob(kind))
    files = [str(path.relative_to(REPOSITORY)) for path in paths]
    command = ["git", "check-ignore", "--no-index", "--stdin"]
    found = subprocess.run(command, input="\n".join(files), capture_output=True, text=True, cwd=REPOSITORY, check=False)
    assert len(files) > 100 and found.stderr == "" and found.stdout == ""
