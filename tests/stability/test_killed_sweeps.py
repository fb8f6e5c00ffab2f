"""Sweeps that are killed again and again end with the table of one that was not."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

SCENARIO = Path(__file__).parents[2] / "scenarios" / "drift_4750hz.toml"
KILLS = 20
COMMAND = (sys.executable, "-m", "feeder_sim", "sweep", str(SCENARIO))
ASKED = ("--vary", "drive[0].amplitude_um=0.7:1.6:10", "--vary", "contact.friction=0.2:0.4:5", "--seeds", "10")


def swept(out: Path, *more: str) -> bytes:
    """The table of a sweep that is left alone."""
    subprocess.run([*COMMAND, *ASKED, "--out", str(out), *more], check=True, capture_output=True, timeout=600)
    return (out / "sweep.csv").read_bytes()


def kill_again_and_again(out: Path, *more: str) -> int:
    """Kill a sweep with -9 so many times; returns how many of them had something to lose."""
    draw, hit = random.Random(1), 0
    journal = out / "journal.jsonl"
    for _ in range(KILLS):
        before = journal.stat().st_size if journal.exists() else 0
        process = subprocess.Popen(
            [*COMMAND, *ASKED, "--out", str(out), *more], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        until = time.monotonic() + 60.0
        while process.poll() is None and time.monotonic() < until and _size(journal) <= before:
            time.sleep(0.01)  # until it has begun to write
        time.sleep(draw.uniform(0.0, 0.15))
        hit += process.poll() is None
        process.kill()
        process.wait()
    return hit


def _size(journal: Path) -> int:
    return journal.stat().st_size if journal.exists() else 0


def children(parent: int) -> set[int]:
    """Processes that a process has started and that still run; none where there is no /proc."""
    found = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()  # state, parent, ...
        except OSError:
            continue  # it has just ended
        if int(fields[1]) == parent and fields[0] != "Z":
            found.add(int(entry.parent.name))
    return found


@pytest.mark.slow
def test_processes(tmp_path: Path) -> None:
    expected = swept(tmp_path / "whole")
    hit = kill_again_and_again(tmp_path / "killed")
    assert swept(tmp_path / "killed") == expected
    assert hit >= KILLS // 2  # or nothing was at stake


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="reads /proc")
def test_no_worker_outlives_a_kill(tmp_path: Path) -> None:
    out = tmp_path / "killed"
    process = subprocess.Popen([*COMMAND, *ASKED, "--out", str(out)], stderr=subprocess.DEVNULL)
    while not _size(out / "journal.jsonl"):
        assert process.poll() is None
        time.sleep(0.01)
    workers = children(process.pid)
    process.kill()
    process.wait()
    assert workers
    until = time.monotonic() + 10.0
    while time.monotonic() < until and any(Path(f"/proc/{pid}").exists() for pid in workers):
        time.sleep(0.05)
    assert not any(Path(f"/proc/{pid}").exists() for pid in workers)


@pytest.fixture
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, memory_limit=0, dashboard_address=None
    ) as started:
        yield started


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_dask_with_a_worker_killed_in_between(tmp_path: Path, cluster: Any) -> None:
    expected = swept(tmp_path / "whole")
    at = ("--dask", cluster.scheduler_address)
    hit = kill_again_and_again(tmp_path / "killed", *at)
    process = subprocess.Popen([*COMMAND, *ASKED, "--out", str(tmp_path / "worker"), *at], stdout=subprocess.DEVNULL)
    while not _size(tmp_path / "worker" / "journal.jsonl"):
        assert process.poll() is None
        time.sleep(0.01)
    next(iter(cluster.workers.values())).process.process.kill()
    assert process.wait(300) == 0
    assert (tmp_path / "worker" / "sweep.csv").read_bytes() == expected
    assert swept(tmp_path / "killed", *at) == expected
    assert hit >= KILLS // 2
