"""Commands that are killed again and again go on to the tables of one that nobody has disturbed."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import feeder_sim, in_new_process, said
from golden_commands import GOLDEN, lasting

KILLS = 10  # of each command
AMPLITUDE = "drive[0].amplitude_um"
# Command, and the files that have to be the same at the end.
COMMANDS = {
    "sweep": (
        f"sweep drift_4750hz --vary {AMPLITUDE}=0.7:1.6:10 --vary contact.friction=0.2:0.4:5 --seeds 10",
        ("sweep.csv",),
    ),
    "uncertainty": ("uncertainty ball.toml --inputs 64 --seeds 4", ("draws.csv", "uncertainty.csv", "inputs.csv")),
    "optimise": (
        f"optimise ball.toml --maximise flight_height_mm --over {AMPLITUDE}=200:260 --trials 24 --seeds 8",
        ("trials.csv", "check.csv", "best.toml"),
    ),
    "map": ("map drift_8775hz --frequency 8000,8775 --amplitude 0.8,1 --seeds 8", ("map.csv",)),
    "run": ("run ball.toml --set run.seeds=400 --set run.duration_s=5", ()),
}


def size(folder: Path) -> int:
    """Of a file, or of the journals, trajectories and beginnings in a folder [bytes]."""
    files = [folder] if folder.is_file() else [*folder.glob("*.jsonl"), *folder.glob("*.h5"), *folder.glob("run.json")]
    return sum(file.stat().st_size for file in files)


def ended(process: subprocess.Popen[bytes], then: Callable[[], bool], patience_s: float = 60.0) -> bool:
    """Wait until something holds, or the process has ended: whether it has."""
    until = time.monotonic() + patience_s
    while process.poll() is None and time.monotonic() < until and not then():
        time.sleep(0.01)
    return process.poll() is not None


def begin(words: list[str], folder: Path) -> subprocess.Popen[bytes]:
    """A command that has begun to write into the folder of its last word, or has ended."""
    out = folder / words[-1]
    before = size(out)
    command = [sys.executable, "-m", "feeder_sim", *words]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    ended(process, lambda: size(out) > before)
    return process


def kill_again_and_again(words: list[str], folder: Path) -> list[str]:
    """Kill a command with -9 so many times while it has something to lose; the words with which it goes on."""
    moments, hit = random.Random(words[0]), 0
    for _ in range(KILLS):
        process = begin(words, folder)
        time.sleep(moments.uniform(0.0, 0.3))
        hit += process.poll() is None
        process.kill()
        process.wait()
        if words[0] == "run" and (folder / "cut/run.json").exists():
            words = ["resume", "cut"]
    assert hit >= (KILLS // 2 if words[0] == "sweep" else 1)  # or nothing was at stake
    return words


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_killed_goes_on_to_the_same_tables(name: str, tmp_path: Path) -> None:
    shutil.copy(GOLDEN / "ball.toml", tmp_path)
    text, files = COMMANDS[name]
    whole = feeder_sim(*text.split(), "--out", "whole", "--json", cwd=tmp_path)
    assert whole.returncode == 0, whole.stderr
    words = kill_again_and_again([*text.split(), "--out", "cut"], tmp_path)
    done = feeder_sim(*words, "--json", cwd=tmp_path)
    assert done.returncode == 0 or "nothing to resume" in done.stderr, done.stderr
    for file in files:
        assert (tmp_path / "cut" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes(), file
    if name == "run":
        summaries = [json.loads((tmp_path / run / "summary.json").read_text()) for run in ("cut", "whole")]
        cut, undisturbed = (lasting(summary, "") for summary in summaries)
        assert json.dumps(cut) == json.dumps(undisturbed)


@pytest.mark.slow
@pytest.mark.skipif(not [*Path("/proc/self/task").glob("*/children")], reason="reads /proc")
def test_no_worker_outlives_a_kill(tmp_path: Path) -> None:
    process = begin([*COMMANDS["sweep"][0].split(), "--out", "killed"], tmp_path)
    assert not ended(process, lambda: bool(size(tmp_path / "killed/journal.jsonl")))
    listed = [path.read_text().split() for path in Path(f"/proc/{process.pid}/task").glob("*/children")]
    workers = [Path("/proc", number) for numbers in listed for number in numbers]
    process.kill()
    process.wait()
    assert workers
    until = time.monotonic() + 10.0
    while time.monotonic() < until and any(map(Path.exists, workers)):
        time.sleep(0.05)
    assert not any(map(Path.exists, workers))


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_dask_with_a_worker_killed_in_between(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    text = COMMANDS["sweep"][0]
    local = {"n_workers": 2, "threads_per_worker": 1, "memory_limit": 0, "dashboard_address": None}
    with distributed.LocalCluster(processes=True, **local) as cluster:
        asked = [*text.split(), "--dask", cluster.scheduler_address, "--out"]
        kill_again_and_again([*asked, "killed"], tmp_path)
        process = begin([*asked, "worker"], tmp_path)
        assert not ended(process, lambda: bool(size(tmp_path / "worker/journal.jsonl")))
        next(iter(cluster.workers.values())).process.process.kill()
        assert process.wait(300) == 0
        assert feeder_sim(*asked, "killed", cwd=tmp_path).returncode == 0
    assert feeder_sim(*text.split(), "--out", "whole", cwd=tmp_path).returncode == 0
    tables = [(tmp_path / name / "sweep.csv").read_bytes() for name in ("whole", "killed", "worker")]
    assert tables[1:] == tables[:1] * 2


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in ("map", "optimise") else name for name in COMMANDS]
)
def test_a_full_disk_ends_a_command_in_one_line(name: str, tmp_path: Path) -> None:
    """No file may be larger than a few blocks."""
    shutil.copy(GOLDEN / "ball.toml", tmp_path)
    words = COMMANDS[name][0].replace("--seeds 10", "--seeds 2").split()
    full = in_new_process(*words, "--out", "full", cwd=tmp_path, largest_file=600)
    assert full.returncode in (1, 2) and "Traceback" not in full.stderr, full.stderr
    assert len(said(full)) == 1 and "cannot be written" in said(full)[0], full.stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_a_disk_that_cannot_be_written_is_said_in_one_line(name: str, tmp_path: Path) -> None:
    shutil.copy(GOLDEN / "ball.toml", tmp_path)
    done = feeder_sim(*COMMANDS[name][0].split(), "--out", "/proc/feeder_sim/out", cwd=tmp_path)
    assert done.returncode in (1, 2) and len(said(done)) == 1, done.stderr
    assert "/proc/feeder_sim" in said(done)[0] and "cannot be" in said(done)[0]
