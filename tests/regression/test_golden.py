"""What commands print, and what stored folders hold, is as it was."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command_line import feeder_sim
from golden_commands import FOLDERS, GOLDEN, differences, lasting, outputs

STORED = json.loads((GOLDEN / "commands.json").read_text())


@pytest.mark.slow
def test_every_command_prints_what_it_did(tmp_path: Path) -> None:
    now = outputs(tmp_path)
    assert now.keys() == STORED.keys()
    assert [f"{command}{line}" for command in now for line in differences(now[command], STORED[command])] == []


@pytest.mark.parametrize("name", [name for name in FOLDERS if name != "map"])
def test_a_stored_folder_is_read(name: str, tmp_path: Path) -> None:
    shutil.copytree(GOLDEN / name, tmp_path / name)
    command = f"report {name} --out {name}.html"
    done = feeder_sim(*command.split(), "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert differences(lasting(json.loads(done.stdout), str(tmp_path)), STORED[command]) == []
