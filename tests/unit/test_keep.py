"""What is recorded of a seed and kept in memory; measures do not depend on it."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import in_new_process, said
from conftest import strip_scenario

import feeder_sim
from feeder_sim import AllFrames, EveryNth, ImpactsOnly, Result, StatisticsOnly
from feeder_sim.errors import InputError
from feeder_sim.measures.catalogue import names_of_measures, values_of_seed
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Status
from feeder_sim.records.trajectory import Frames
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.run.keep import Retention
from feeder_sim.run.run_folder import PICKS, record_run
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import (
    Drive,
    HexNut,
    Pick,
    RigidPlate,
    Run,
    Scenario,
    Schedule,
    Slide,
    Stage,
    Start,
    Strip,
    parse_scenario,
)

DRIVE = Drive(frequency_hz=4750.0, amplitude_um=2.0)


def picking() -> Scenario:
    """A nut that is shaken and then picked."""
    stage = Stage(name="shake", drive=(DRIVE,), duration_s=0.2, pick=Pick(clearance_mm=1.0))
    return Scenario(
        plate=Strip(thickness_mm=3.0),
        schedule=Schedule(stage=(stage,)),
        part=(HexNut(size="M2.5", start=Start(position_mm=(1.95, 0.0))),),
        run=Run(seeds=2, frames_per_second=200.0),
    )


def bouncing() -> Scenario:
    """A nut in a guide, long enough for batches of bounces."""
    return Scenario(
        plate=RigidPlate(kind="piston"),
        drive=(Drive(frequency_hz=558.0, amplitude_um=30.0),),
        part=(HexNut(size="M2.5", start=Start(drop_height_mm=(0.1, 0.9)), guide=Slide(kind="slide", tilt_deg=8.0)),),
        run=Run(duration_s=0.8, seeds=2),
    )


def measured(result: Result) -> str:
    """Everything that is measured, bit by bit."""
    each = [values_of_seed(result.prepared, seed) for seed in result.seeds]
    summary = {key: value for key, value in result.summary().items() if "wall_s" not in key and "real" not in key}
    return json.dumps(summary) + repr(each) + "\n".join(result.lines())


@pytest.mark.parametrize("make", [lambda: strip_scenario(seeds=2, duration_s=0.3), picking, bouncing])
def test_measures_do_not_depend_on_what_is_kept(make: object) -> None:
    scenario = make()  # type: ignore[operator]
    whole = feeder_sim.simulate(scenario)
    assert names_of_measures(whole.prepared) == list(values_of_seed(whole.prepared, whole.seeds[0]))
    choices: list[Retention] = [EveryNth(7), StatisticsOnly()]
    choices += [ImpactsOnly()] if scenario.guide else []
    for record in choices:
        kept = feeder_sim.simulate(whole.prepared, record=record)
        assert measured(kept) == measured(whole)
        assert kept.seeds[0].reached == whole.seeds[0].frames.time[-1]
        n_frames = -(-len(whole.trajectories[0]) // 7) if record == EveryNth(7) else 0
        for seed, full in zip(kept.seeds, whole.seeds, strict=True):
            assert seed.frames.position.shape == (n_frames, *full.frames.position.shape[1:])
            assert np.array_equal(seed.frames.velocity, full.frames.velocity[::7][:n_frames])
            assert seed.frames.position.base is None  # a view would keep all frames in memory
            assert len(seed.impacts) == (0 if record == StatisticsOnly() else len(full.impacts))
            assert len(seed.removals) == len(full.removals)
    assert len(whole.seeds[0].impacts) > 50 or not scenario.guide
    assert len(whole.seeds[0].removals) == (scenario.schedule is not None)


def test_run_folder_holds_all_frames_whatever_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replayed: list[Path] = []
    monkeypatch.setattr("feeder_sim.run.run_folder.build_replay", lambda trajectory, _: replayed.append(trajectory))
    kept = feeder_sim.record_run(picking(), tmp_path / "kept", record=StatisticsOnly())
    whole = feeder_sim.record_run(picking(), tmp_path / "whole", replay=False)
    assert len(kept.trajectories[0]) == 0 and len(replayed) == 1
    opened = feeder_sim.open(tmp_path / "kept")
    assert np.array_equal(opened.trajectories[1].position, whole.trajectories[1].position)
    assert measured(opened) == measured(kept) == measured(whole)
    assert (tmp_path / "kept" / PICKS).read_text() == (tmp_path / "whole" / PICKS).read_text()


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    scenario = strip_scenario()
    with pytest.raises(InputError, match=r"^record: is ImpactsOnly\(\), .* impacts are recorded of a part in a guide"):
        feeder_sim.record_run(scenario, tmp_path / "run", record=ImpactsOnly())
    assert not (tmp_path / "run").exists()
    with pytest.raises(InputError, match=r"^record: is 'all', must be AllFrames\(\), EveryNth\(n\)"):
        feeder_sim.simulate(scenario, record="all")  # type: ignore[arg-type]
    for n in (0, -1, 2.0, True):
        with pytest.raises(InputError, match=r"^EveryNth\(n\): is .*, must be a whole number of at least 1"):
            EveryNth(n)  # type: ignore[arg-type]
    assert EveryNth(3) == EveryNth(3) != AllFrames()  # type: ignore[comparison-overlap]


def test_dropped_frames_are_said_not_to_be_there() -> None:
    dropped = feeder_sim.simulate(bouncing(), record=StatisticsOnly())
    for ask in (dropped.to_xarray, lambda: dropped.to_frame("frames"), dropped.plot.path):
        with pytest.raises(InputError, match=r"^frames: were not kept, must be record="):
            ask()
    with pytest.raises(InputError, match=r"^impacts: were not kept"):
        dropped.to_frame("impacts")
    assert dropped.plot.bounces() is not None  # its readings are there


def same(a: Frames, b: Frames) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in vars(a))


def test_file_holds_what_was_simulated(tmp_path: Path) -> None:
    scenario = strip_scenario(seeds=2, duration_s=0.5)
    result = record_run(scenario, tmp_path / "run", replay=False)
    recording = read_recording(tmp_path / "run")
    assert recording.status == (Status.DONE, Status.DONE)
    for written, computed in zip(recording.seeds, result.trajectories, strict=True):
        assert len(written) == result.scene.n_frames
        assert np.array_equal(written.time, computed.time)
        assert np.array_equal(written.position, computed.position)
        assert written.quaternion == pytest.approx(computed.quaternion, abs=1e-7)
        assert written.velocity == pytest.approx(computed.velocity, abs=1e-7)
    with h5py.File(tmp_path / "run/seeds/000.h5") as file:
        for name, unit in (("time", b"s"), ("position", b"m"), ("velocity", b"m/s")):
            assert file[name].attrs["unit"] == unit
    with h5py.File(tmp_path / "run/scene.h5") as file:
        again = parse_scenario(file.attrs["scenario"].decode(), file=Path("resolved.toml"))
    assert again == scenario


def test_frames_lie_on_the_solver_steps(tmp_path: Path) -> None:
    result = simulate(strip_scenario(duration_s=0.3, frames_per_second=1000.0))
    time = result.trajectories[0].time
    assert time[0] == 0.0
    assert np.diff(time) == pytest.approx(result.scene.frame_interval, rel=1e-9)
    assert time[-1] == pytest.approx(0.3, abs=result.scene.frame_interval)


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_same_seed_gives_the_same_bits_whatever_the_workers(engine: str) -> None:
    scenario = strip_scenario(seeds=3, duration_s=0.4, engine=engine)
    one, two = (simulate(scenario, work=Work(n)).trajectories for n in (1, 3))
    assert all(same(a, b) for a, b in zip(one, two, strict=True))
    assert not same(one[0], one[1])
    (alone,) = simulate(scenario.changed({"run.seeds": 1})).trajectories  # whatever seeds follow
    assert same(alone, one[0])


def test_full_disk_ends_the_run_with_one_line(tmp_path: Path, repository: Path) -> None:
    scenario = repository / "scenarios/drift_4750hz.toml"
    done = in_new_process("run", scenario, "--seeds", 4, "--out", tmp_path / "run", largest_file=150_000)
    assert done.returncode == 1
    assert len(said(done)) == 1 and "disk full" in said(done)[0], done.stderr


def test_truncated_and_foreign_files_are_refused(tmp_path: Path) -> None:
    record_run(strip_scenario(), tmp_path / "run", replay=False)
    for cut in (tmp_path / "run/seeds/000.h5", tmp_path / "run/scene.h5"):
        whole = cut.read_bytes()
        cut.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(InputError, match=rf"{cut.name}: not a readable recording"):
            read_recording(tmp_path / "run")
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = 1.0
    with pytest.raises(InputError, match=r"foreign\.h5: schema: is None"):
        read_recording(tmp_path / "foreign.h5")
