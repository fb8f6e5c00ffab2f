"""Commands that are killed at random, again and again, go on to the tables of one that nobody has disturbed."""

from __future__ import annotations

import json
import random
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import feeder_sim
from golden_commands import GOLDEN, lasting

KILLS = 5
AMPLITUDE = "drive[0].amplitude_um"
# Command, the option that goes on with it, and the files that have to be the same at the end.
COMMANDS = {
    "sweep": (f"sweep ball.toml --vary {AMPLITUDE}=200:240:8 --seeds 40", ("sweep.csv",)),
    "uncertainty": ("uncertainty ball.toml --inputs 64 --seeds 4", ("draws.csv", "uncertainty.csv", "inputs.csv")),
    "optimise": (
        f"optimise ball.toml --maximise flight_height_mm --over {AMPLITUDE}=200:260 --trials 24 --seeds 8",
        ("trials.csv", "check.csv", "best.toml"),
    ),
    "map": ("map drift_8775hz --frequency 8000,8775 --amplitude 0.8,1 --seeds 8", ("map.csv",)),
    "run": ("run ball.toml --set run.seeds=400 --set run.duration_s=5 --inputs 2", ()),
}


def begin(words: list[str], folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "feeder_sim", *words]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_killed_goes_on_to_the_same_tables(name: str, tmp_path: Path) -> None:
    shutil.copy(GOLDEN / "ball.toml", tmp_path)
    text, files = COMMANDS[name]
    whole = feeder_sim(*text.split(), "--out", "whole", "--json", cwd=tmp_path)
    assert whole.returncode == 0, whole.stderr
    moments, words = random.Random(name), [*text.split(), "--out", "cut"]
    for _ in range(KILLS):
        process = begin(words, tmp_path)
        time.sleep(moments.uniform(1.5, 6.0))
        process.kill()
        process.wait()
        if name == "run" and (tmp_path / "cut/run.json").exists():
            words = ["run", "--resume", "cut"]
    done = feeder_sim(*words, "--json", cwd=tmp_path)
    if name == "run" and "has ended" in done.stderr:  # before the last kill
        done = feeder_sim("run", "--resume", "cut", "--json", cwd=tmp_path)
    assert done.returncode == 0 or "nothing to resume" in done.stderr, done.stderr
    for file in files:
        assert (tmp_path / "cut" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes(), file
    summaries = [tmp_path / run / "summary.json" for run in ("cut", "whole")]
    if name == "run":
        cut, undisturbed = (lasting(json.loads(path.read_text()), "") for path in summaries)
        assert json.dumps(cut) == json.dumps(undisturbed)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk_ends_a_command_in_one_line(name: str, tmp_path: Path) -> None:
    """No file may be larger than a few blocks."""
    shutil.copy(GOLDEN / "ball.toml", tmp_path)
    words = [*COMMANDS[name][0].replace("--seeds 40", "--seeds 2").split(), "--out", "full"]
    command = [sys.executable, "-m", "feeder_sim", *words]
    full = subprocess.run(
        command,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600)),
    )
    said = [line for line in full.stderr.splitlines() if "compiling" not in line]
    assert full.returncode in (1, 2) and "Traceback" not in full.stderr, full.stderr
    assert len(said) == 1 and "cannot be written" in said[0], full.stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_a_disk_that_cannot_be_written_is_said_in_one_line(name: str, tmp_path: Path) -> None:
    shutil.copy(GOLDEN / "ball.toml", tmp_path)
    done = feeder_sim(*COMMANDS[name][0].split(), "--out", "/proc/feeder_sim/out", cwd=tmp_path)
    assert done.returncode in (1, 2) and done.stderr.count("\n") == 1, done.stderr
    assert "/proc/feeder_sim" in done.stderr and "cannot be" in done.stderr
