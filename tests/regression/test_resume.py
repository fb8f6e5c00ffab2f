"""A run that is interrupted or killed and resumed gives, bit by bit, what it would have given without the break."""

from __future__ import annotations

import contextlib
import functools
import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any
from unittest import mock

import h5py
import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import StopsAfter, each_seed_stops_after
from failing import check_runs_again, fail_at

from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.errors import InputError
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.run_folder import record_run, resume_run, scenario_toml
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.changes import changed_values
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import build_scene

WALL_TIMES = ("wall_s", "real_time_factor", "wall_s_per_simulated_s_one_core")
# One seed after the other, so that a kill finds one that has ended and one that has not.
ONE_CORE = (
    "import feeder_sim.pool.work as w; w.available_cores = lambda: 1; from feeder_sim.cli.main import main; main()"
)


@pytest.fixture(autouse=True, scope="module")
def short_blocks() -> Iterator[None]:
    """So that a short run has several."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ImpulseEngine, "frames_per_block", 100)
        yield


NUTS: dict[str, Any] = {
    "plate": {"kind": "piston", "length_mm": 60.0, "width_mm": 60.0},
    "part": [{"shape": "hex_nut", "size": "M2.5", "count": 6, "start": {"kind": "scattered"}}],
    "run": {"seeds": 2, "seed": 3, "frames_per_second": 500.0},
}


def nuts(changes: dict[str, Any] | None = None, *, cycles: int = 2, **stage: Any) -> Scenario:
    """Nuts thrown about by a piston, with a pick after every cycle; with other values at dotted keys."""
    drive = {"frequency_hz": 500.0, "amplitude_um": 20.0}
    stage = {"drive": [drive], "duration_s": 0.2, "pause_s": 0.05, "pick": {"clearance_mm": 14.0}} | stage
    document = NUTS | {"schedule": {"cycles": cycles, "stage": [stage]}}
    return validated(changed_values(document, changes or {}, Path("nuts")), Scenario, Path("nuts"))


def held(folder: Path) -> dict[str, Any]:
    """All datasets of a run, as bytes, and the attributes of its files."""
    found: dict[str, Any] = {}

    def take(place: str, name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found[f"{place}/{name}"] = (item.shape, str(item.dtype), item[()].tobytes(), dict(item.attrs))

    for path in (folder / "scene.h5", *sorted((folder / "seeds").iterdir())):
        with h5py.File(path, "r") as file:
            file.visititems(functools.partial(take, path.stem))
            found[path.stem] = {name: str(value) for name, value in file.attrs.items() if name != "wall_time"}
    return found


def check_same(folder: Path, expected: Path) -> None:
    got, wanted = held(folder), held(expected)
    assert got.keys() == wanted.keys()
    assert [name for name in wanted if got[name] != wanted[name]] == []
    summaries = [json.loads((run / "summary.json").read_text()) for run in (folder, expected)]
    for summary in summaries:
        for name in WALL_TIMES:
            del summary[name]
    # As text: NaN is not equal to itself.
    assert json.dumps(summaries[0], sort_keys=True) == json.dumps(summaries[1], sort_keys=True)


def lengths(folder: Path, name: str) -> list[int]:
    """Of a dataset of the two seeds; 0 of one that has not begun."""
    found = []
    for index in range(2):
        path = folder / f"seeds/{index:03d}.h5"
        with h5py.File(path) if path.exists() else contextlib.nullcontext({}) as file:
            found.append(len(file.get(name, ())))
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "run"
    result = record_run(nuts(), folder, replay=False)
    summary = json.loads((folder / "summary.json").read_text())
    # Something is picked in the first cycle, and something is left for the second one.
    assert not result.interrupted and 0 < summary["stages"][0]["picked"]["mean"] < 6
    assert summary["stages"][1]["on_plate"]["mean"] > 0
    return folder


@contextmanager
def second_seed_stops(looks: int = 1) -> Iterator[None]:
    """The first seed runs to its end, the second one until it has looked so many times."""
    run = SeedRun.run
    with pytest.MonkeyPatch.context() as patch:

        def stopped(self: SeedRun, stop: Any) -> Any:
            return run(self, stop if self._index == 0 else StopsAfter(looks))

        patch.setattr(SeedRun, "run", stopped)
        yield


def test_a_run_with_more_seeds_later_is_that_of_all_of_them(whole: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    record_run(nuts({"run.seeds": 1}), folder, replay=False)
    result = resume_run(folder, seeds=2, replay=False)
    assert len(result.seeds) == 2 and not result.interrupted
    check_same(folder, whole)
    with pytest.raises(InputError, match="has ended, there is nothing to resume"):
        resume_run(folder, seeds=2)
    check_refused(feeder_sim("resume", folder, "--seeds", "1"), "--seeds: is 1, must be at least the 2 of the run")
    (folder / "scene.h5").unlink()  # as a kill leaves it that comes before anything is recorded
    shutil.rmtree(folder / "seeds")
    assert len(resume_run(folder, seeds=3, replay=False).seeds) == 3


def test_seeds_are_run_until_the_standard_error_is_small_enough(tmp_path: Path) -> None:
    words: tuple[Any, ...] = ("run", "drift_8775hz", "--seeds", "4", "--until-se", "2%", "--json")
    words += ("--measure", "transport_speed_mm_s", "--out")
    summary = json.loads(feeder_sim(*words, tmp_path / "run").stdout)
    speed = summary["transport_speed_mm_s"]
    assert 8 < summary["seeds"] == speed["n"] < 100 and speed["se"] <= 0.02 * speed["mean"]
    few = feeder_sim(*words, tmp_path / "few", "--most-seeds", "8")
    assert json.loads(few.stdout)["seeds"] == 8 and "8 seeds, and not the standard error" in few.stderr
    first, same = (read_recording(tmp_path / name).seeds[7] for name in ("run", "few"))
    assert np.array_equal(first.position, same.position)


def test_a_standard_error_needs_a_measure_that_there_is(tmp_path: Path) -> None:
    words = ("run", "drift_8775hz", "--out", tmp_path / "run", "--until-se", "5%")
    check_refused(feeder_sim(*words), "--until-se, --measure: is given alone, must be with the other one of the two")
    check_refused(feeder_sim(*words, "--measure", "speed"), "--measure: is 'speed', must be transport_speed_mm_s")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("looks", [0, 1])
def test_interrupted_run_goes_on_to_the_same_bits(looks: int, whole: Path, tmp_path: Path) -> None:
    """Seeds that have ended are kept: the second time nothing of them is computed."""
    folder = tmp_path / "run"
    with each_seed_stops_after(looks):
        begun = record_run(nuts(), folder, replay=False)
    assert begun.interrupted and sum(lengths(folder, "time")) < sum(lengths(whole, "time"))
    with second_seed_stops():
        assert resume_run(folder, replay=False).interrupted
    frames, complete = lengths(folder, "time"), lengths(whole, "time")
    assert frames[0] == complete[0] and frames[1] < complete[1]
    with mock.patch.object(SeedRun, "_open", autospec=True, side_effect=SeedRun._open) as opened:
        result = resume_run(folder, replay=False)
    assert not result.interrupted and [call.args[0]._index for call in opened.call_args_list] == [1]
    check_same(folder, whole)


SMALL = {"plate.length_mm": 16.0, "plate.width_mm": 16.0, "part[0].count": 12}
POURED, DROPPED = {"kind": "heap", "diameter_mm": 25.0}, {"kind": "scattered", "drop_height_mm": 3.0}
OFTEN: dict[str, Any] = {"cycles": 3, "duration_s": 0.1, "pick": {"clearance_mm": 8.0}}


@pytest.mark.parametrize(
    ("scenario", "events", "least"),
    [
        # From a heap on a small plate parts fall off, in all blocks.
        (nuts(SMALL | {"part[0].start": POURED | {"diameter_mm": 8.0}}, pick={"clearance_mm": 100.0}), "removals", 2),
        (nuts({"refill": {"to": 5, "start": POURED}}, **OFTEN), "arrivals", 1),
        (nuts({"refill": {"to": 5, "start": DROPPED}, "run.engine": "mujoco"}, **OFTEN), "arrivals", 1),
    ],
)
def test_what_comes_and_goes_is_the_same_after_a_break(
    scenario: Scenario, events: str, least: int, tmp_path: Path
) -> None:
    record_run(scenario, tmp_path / "whole", replay=False)
    found = lengths(tmp_path / "whole", f"{events}/part")
    assert min(found) >= least
    with second_seed_stops():
        assert record_run(scenario, tmp_path / "run", replay=False).interrupted
    assert lengths(tmp_path / "run", f"{events}/part")[1] < found[1] or events == "arrivals"
    resume_run(tmp_path / "run", replay=False)
    check_same(tmp_path / "run", tmp_path / "whole")
    assert (tmp_path / "run/picks.csv").read_bytes() == (tmp_path / "whole/picks.csv").read_bytes()


def test_a_seed_that_diverged_before_the_break_is_still_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What an unbroken run tells about failures, that of a resumed one tells too, with the last states it had."""
    fail_at(monkeypatch, 0.01, seed=1)
    assert len(record_run(nuts(), tmp_path / "whole", replay=False).failures) == 1
    with each_seed_stops_after(2):  # seed 1 ends in its first block
        begun = record_run(nuts(), tmp_path / "run", replay=False)
    assert begun.interrupted and len(begun.failures) == 1
    before = (tmp_path / "run/seeds/001.h5").read_bytes()
    result = resume_run(tmp_path / "run", replay=False)
    assert len(result.failures) == 1 and "seeds/001.h5" in str(result.failures[0])
    check_same(tmp_path / "run", tmp_path / "whole")
    assert (tmp_path / "run/seeds/001.h5").read_bytes() == before
    check_runs_again(nuts(), result.seeds[1], 1)


def ended_seeds(folder: Path) -> int:
    try:
        return sum(status != Status.UNFINISHED for status in read_recording(folder).status)
    except InputError:  # not there yet
        return 0


@pytest.mark.parametrize("ended", [1, pytest.param(0, marks=pytest.mark.slow)])
def test_killed_run_goes_on_to_the_same_bits(ended: int, tmp_path: Path) -> None:
    """Killed after one seed of two, and before there is any."""
    scenario, folder = nuts({"run.frames_per_second": 200.0}, cycles=1, duration_s=4.0), tmp_path / "run"
    path = tmp_path / "long.toml"
    path.write_text(scenario_toml(scenario))
    command = [sys.executable, "-c", ONE_CORE, "run", str(path), "--out", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 300
    try:
        while not (folder / "scene.h5").exists() or ended_seeds(folder) < ended:
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.005)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert not (folder / "summary.json").exists() and ended_seeds(folder) == ended
    done = feeder_sim("resume", folder, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["interrupted"] is False
    record_run(scenario, tmp_path / "whole", replay=False)
    check_same(folder, tmp_path / "whole")


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_what_cannot_be_resumed_is_refused_in_one_line(whole: Path, tmp_path: Path) -> None:
    before = contents(whole)
    check_refused(feeder_sim("resume", whole), str(whole), "has ended")
    assert contents(whole) == before
    for folder in (tmp_path, tmp_path / "nowhere"):
        check_refused(feeder_sim("resume", folder), str(folder), "no run here")
    check_refused(feeder_sim("run", "--resume", whole), "No such option: --resume")


def test_result_does_not_depend_on_threads() -> None:
    """Six islands or so, and their number changes; removals in between."""
    scene = build_scene(nuts({"part[0].count": 30}))
    frames = []
    for threads in (1, 2, 3):
        engine = ImpulseEngine(scene, np.random.default_rng(2), threads=threads)
        first = engine.advance(60)
        engine.remove(np.array([4, 17]))
        frames.append(Frames.joined([first, engine.advance(60)]))
    for field in fields(Frames):
        one, *others = (getattr(f, field.name).tobytes() for f in frames)
        assert all(other == one for other in others), field.name
    assert np.abs(frames[0].velocity[60:, :, :2]).max() > 0.01
