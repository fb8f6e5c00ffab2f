"""The commands `sweep` and `merge`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY
from swept import AMPLITUDE, Pretended

from feeder_sim.jobs.workers import given_workers

ASKED = ("sweep", REPOSITORY / "scenarios/drift_4750hz.toml")


@pytest.fixture(autouse=True)
def pretended_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("feeder_sim.jobs.workers.workers_of", lambda count, dask: given_workers(Pretended(), 2))


def test_command(tmp_path: Path) -> None:
    scenario, out = ASKED[1], tmp_path / "out"
    asked = (*ASKED, "--vary", f"{AMPLITUDE}=1:4:log3", "--vary", "contact.friction=0.2,0.3", "--out", out)
    done = feeder_sim(*asked, "--seeds", 3)
    assert done.returncode == 0, done.stderr
    assert "speed" in done.stdout and "6 points" in done.stdout
    assert done.stderr == "feeder-sim: caution: drive[0] is strong (at 2 of 6 points)\n"
    rows = list(csv.DictReader((out / "sweep.csv").read_text().splitlines()))
    assert list(rows[0]) == [AMPLITUDE, "contact.friction", "measure", "mean", "se", "n", "seeds", "failed"]
    assert len(rows) == 6 and rows[0]["n"] == rows[0]["seeds"] == "3"
    assert (out / "sweep.png").stat().st_size > 1000
    import pyarrow.parquet

    assert pyarrow.parquet.read_table(out / "sweep.parquet").to_pylist()[0]["measure"] == "speed"
    told = json.loads(feeder_sim(*asked, "--json").stdout)
    assert told["complete"] and len(told["rows"]) == 6
    assert told["cautions"] == [{"caution": "drive[0] is strong", "at": 2, "of": 6, "numbers_differ": False}]
    assert feeder_sim("merge", out).returncode == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    for refused in (feeder_sim(*asked, "--measure", "sped"), feeder_sim("merge", out, "--measure", "sped")):
        check_refused(refused, "--measure: is sped", "allowed are speed")
    (out / "journal.jsonl").unlink()
    check_refused(feeder_sim("merge", out), str(out), "holds no seed of the sweep")
    left = {file.name: file.read_bytes() for file in out.iterdir()}
    assert left == {name: content for name, content in before.items() if name != "journal.jsonl"}
    for options, said in (
        (f"--vary {AMPLITUDE}=-1,2", "drive[0].amplitude_um: is -1"),
        (f"--vary {AMPLITUDE}=1,1", f"{scenario}: --vary {AMPLITUDE}: "),
        (f"--vary {AMPLITUDE}=1,2 --until-se x", "--until-se: "),
        (f"--vary {AMPLITUDE}=1,2 --until-se 3%", "--measure: is missing"),
        (f"--vary {AMPLITUDE}=1,2 --task 3/2", "--task ... I/N"),
        (f"--vary {AMPLITUDE}=1,2 --out {scenario.parent}", "--out: holds"),
        (f"--vary {AMPLITUDE}=1,2 --zip --sobol 4", "--zip, --sobol: "),
    ):
        check_refused(feeder_sim("sweep", scenario, *options.split(), cwd=tmp_path), said)
    check_refused(feeder_sim("merge", tmp_path), "sweep.toml", "no such file")


def test_command_says_what_its_means_are_of(tmp_path: Path) -> None:
    vary = f"{AMPLITUDE}=0.5,0.7,2"
    asked = (*ASKED, "--out", tmp_path / "s", "--vary", vary, "--measure", "speed")
    done = feeder_sim(*asked, "--seeds", 4)
    assert [line.split()[0] for line in done.stdout.splitlines()[1:4]] == ["0.5", "0.7", "2"]
    assert "speed: at 2 of 3 points 8 of 8 seeds have no value" in done.stderr
    fewer = feeder_sim(*asked, "--seeds", 2)
    assert "3 points keep the seeds that they had" in fewer.stderr
    never = feeder_sim(*asked, "--until-se", "0.1%", "--most-seeds", 20)
    assert never.returncode == 0 and "1 of 3 points have as many seeds as --most-seeds allows" in never.stderr
    assert "--most-seeds allows, 20" in never.stderr


def test_tasks_of_a_job_array_are_merged(tmp_path: Path) -> None:
    """A task that is missing is no interruption: what was asked of `merge` is done, and not whole."""
    asked = (*ASKED, "--vary", f"{AMPLITUDE}=1,2", "--out", tmp_path / "s")
    assert feeder_sim(*asked, "--task", "2/2").returncode == 0
    check_refused(feeder_sim("report", tmp_path / "s"), "sweep.csv: is missing", f"feeder-sim merge {tmp_path / 's'}")
    half = feeder_sim("merge", tmp_path / "s")
    assert half.returncode == 1 and "the tasks that are missing can be run again" in half.stderr
    assert feeder_sim(*asked, "--task", "1/2").returncode == 0
    assert feeder_sim("merge", tmp_path / "s").returncode == 0


def test_command_says_what_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    line = "seeds in the folder do not count: they are of other"
    asked = (*ASKED, "--out", tmp_path / "s", "--vary", f"{AMPLITUDE}=1,2,3", "--seeds", 2)
    for task in ("1/2", "2/2"):
        assert feeder_sim(*asked, "--task", task).stderr == ""  # what the other task has done is of this sweep
    monkeypatch.setattr("feeder_sim.run.identity.library_versions", lambda: {"numpy": "another"})
    assert f"6 {line}" in feeder_sim(*asked).stderr
    assert feeder_sim(*asked).stderr == ""  # nothing is run anew
