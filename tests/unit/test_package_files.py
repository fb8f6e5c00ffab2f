"""What the build takes for the package: hatch leaves out every file that .gitignore names, tracked or not."""

from __future__ import annotations

import subprocess

import pytest
from conftest import REPOSITORY


@pytest.mark.skipif(not (REPOSITORY / ".git").exists(), reason="no git checkout")
def test_no_file_of_the_package_is_left_out_of_a_wheel() -> None:
    held = (REPOSITORY / "feeder_sim").rglob("*")
    files = [str(path.relative_to(REPOSITORY)) for path in held if path.suffix in (".py", ".typed", ".j2")]
    command = ["git", "check-ignore", "--no-index", "--stdin"]
    found = subprocess.run(command, input="\n".join(files), capture_output=True, text=True, cwd=REPOSITORY, check=False)
    assert len(files) > 100 and "feeder_sim/py.typed" in files and found.stderr == "" and found.stdout == ""
