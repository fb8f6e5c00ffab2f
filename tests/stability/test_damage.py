"""Runs that were killed, exchanged or out of date, carried on with or refused in one line."""

from __future__ import annotations

import json
import random
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import REPOSITORY, StopsAfter

from feeder_sim.errors import InputError
from feeder_sim.part.stable_poses import PoseTable
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.plate.mode_file import ModeFile, read_mode_file, write_mode_file
from feeder_sim.records.events import impacts_of
from feeder_sim.records.recording import PartRecord, PlateRecord
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.trajectory import FRAME_FIELDS, Frames
from feeder_sim.records.trajectory_file import TRAJECTORY, read_recording
from feeder_sim.records.trajectory_writer import TrajectoryWriter
from feeder_sim.records.unclosed_file import closed_head, lookup3
from feeder_sim.run import provenance, run_folder
from feeder_sim.run.provenance import library_versions
from feeder_sim.run.run_folder import SUMMARY, record_run, resume_run, scenario_toml
from feeder_sim.scenario import Ball, Drive, MeshPart, PistonPlate, Run, Scenario, Slide, load_scenario

BLOCK = 130  # frames
# Reads every trajectory in a folder; a reader that waits is seen by the test's time limit.
READ_ALL = """
import json, sys
from pathlib import Path
from feeder_sim.errors import InputError
from feeder_sim.records.trajectory_file import read_recording
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        seeds = read_recording(path).records
        found = repr([(len(r.frames), len(r.impacts), r.frames.position.sum(), r.impacts.time.sum()) for r in seeds])
    except InputError as error:
        found = str(error).replace(path.name, "")
    print(json.dumps(found))
"""


def ball(**run: Any) -> Scenario:
    """A ball on a slide, which is simulated in no time."""
    return Scenario(
        plate=PistonPlate(kind="piston"),
        drive=(Drive(frequency_hz=50.0, amplitude_um=150.0),),
        part=(Ball(shape="ball", diameter_mm=3.0, guide=Slide(kind="slide")),),
        run=Run(**({"duration_s": 20.0, "seeds": 2} | run)),
    )


def block(number: int, n_parts: int = 1) -> Seed:
    rng = np.random.default_rng(number)
    tail = {name: (BLOCK, n_parts, *shape) for name, (_, _, shape) in FRAME_FIELDS.items() if name != "time"}
    values: dict[str, Any] = {name: rng.random(shape) for name, shape in tail.items()}
    values["present"] = np.ones((BLOCK, n_parts), bool)
    frames = Frames(time=number + np.arange(BLOCK) / BLOCK, **values)
    return Seed(frames, impacts_of(rng.random((7, 4))))


def sizes(seed: Seed) -> tuple[int, ...]:
    return tuple(map(len, (seed.frames, seed.impacts, seed.removals, seed.stops, seed.arrivals)))


def writer(path: Path, scenario: Scenario) -> TrajectoryWriter:
    """Of a file as a run of the scenario writes it."""
    grid = np.linspace(-0.05, 0.05, 30)
    drives = [ModalDrive(0, d.frequency_hz, d.frequency_hz, 1e-6, 0.0, None) for _, d in scenario.excitations]
    return TrajectoryWriter(
        path,
        engine="impulse",
        seed=0,
        n_seeds=2,
        scenario_text=scenario_toml(scenario),
        libraries={},
        inputs={},
        plate=PlateRecord(0.1, 0.1, 3e-3, grid, grid, np.ones((1, 30, 30)), (), np.full(2, np.nan), tuple(drives)),
        parts=[
            PartRecord(f"part_{i}", np.eye(3), np.array([[0, 1, 2]]), np.zeros(3), np.eye(4)[0], PoseTable(()))
            for i in range(scenario.n_parts)
        ],
    )


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a run that was killed after three blocks, and of the same run when it had ended."""
    folder = tmp_path_factory.mktemp("killed")
    file = writer(folder / "closed.h5", ball())
    for number in range(3):
        for seed in range(2):
            file.append(seed, block(number))
    file.finish(1, Seed(block(0).frames, wall_s=2.0), 3.0)
    (folder / "killed.h5").write_bytes((folder / "closed.h5").read_bytes())
    file.append(0, block(3))
    file.finish(0, Seed(block(0).frames, status=Status.DONE), 3.0)
    file.close()
    return folder


def test_killed_run_is_read(killed: Path) -> None:
    recording = read_recording(killed / "killed.h5")
    assert [sizes(record) for record in recording.records] == [(3 * BLOCK, 21, 0, 0, 0)] * 2
    assert recording.status == (Status.UNFINISHED,) * 2 and (recording.records[1].wall_s, recording.wall_s) == (
        2.0,
        3.0,
    )
    assert np.array_equal(recording.seeds[0].position[:BLOCK], block(0).frames.position)
    assert [len(frames) for frames in read_recording(killed / "closed.h5").seeds] == [4 * BLOCK, 3 * BLOCK]


def test_head_of_a_killed_run_is_made_that_of_a_closed_file(killed: Path) -> None:
    assert lookup3(b"Four score and seven years ago") == 0x17770551  # from the author's own test
    for name, flags in (("closed.h5", 0), ("killed.h5", 5)):
        head = (killed / name).read_bytes()[:48]
        assert head[11] == flags and lookup3(head[:44]) == int.from_bytes(head[44:], "little")
        mended = closed_head(head, 10**6)
        assert mended[:11] == head[:11] and mended[11] == 0 and mended[36:44] == head[36:44]
        assert lookup3(mended[:44]) == int.from_bytes(mended[44:], "little")


@pytest.mark.parametrize("name", ["killed.h5", "closed.h5"])
def test_damaged_trajectory_is_read_unchanged_or_refused_and_never_waited_for(
    name: str, killed: Path, tmp_path: Path
) -> None:
    """HDF5's reader beside a living writer waited for damage to mend itself: minutes, then hours."""
    whole, rng = (killed / name).read_bytes(), random.Random(7)
    (tmp_path / "a").write_bytes(whole)
    for i in range(200):
        damaged = bytearray(whole)
        damaged[rng.randrange(4096)] ^= 1 << rng.randrange(8)
        (tmp_path / f"bit_{i:03d}").write_bytes(damaged)
    for i in range(20):
        (tmp_path / f"cut_{i:03d}").write_bytes(whole[: rng.randrange(len(whole))])
    command = [sys.executable, "-c", READ_ALL, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    good, *others = (json.loads(line) for line in done.stdout.splitlines())
    assert len(others) == 220 and good.startswith("[(")
    refused = [text for text in others if "not a readable trajectory file" in text]
    assert set(others) - set(refused) <= {good} and len(refused) > 100


def test_every_dataset_is_under_a_checksum(killed: Path) -> None:
    def check(name: str, item: Any) -> None:
        assert not isinstance(item, h5py.Dataset) or item.fletcher32 or (not item.chunks and not item.size), name

    with h5py.File(killed / "closed.h5") as file:
        file.visititems(check)


def limited(command: list[str], largest_file: int | None) -> subprocess.CompletedProcess[str]:
    """Run on a disk that is full for what is beyond a size in a file."""

    def small_files() -> None:
        if largest_file is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

    return subprocess.run(command, preexec_fn=small_files, capture_output=True, text=True, timeout=100, check=False)


def feeder_sim(*arguments: object, largest_file: int | None = None) -> subprocess.CompletedProcess[str]:
    return limited([sys.executable, "-m", "feeder_sim", *map(str, arguments)], largest_file)


def check_one_line(done: subprocess.CompletedProcess[str], code: int, *expected: str) -> None:
    assert done.returncode == code and done.stderr.count("\n") == 1 and "Traceback" not in done.stderr, done.stderr
    for text in expected:
        assert text in done.stderr


@pytest.mark.slow
def test_commands_refuse_a_damaged_trajectory_at_once(killed: Path, tmp_path: Path) -> None:
    whole = bytearray((killed / "killed.h5").read_bytes())
    at = whole.index(b"OHDR", 1000)
    whole[at + 8] ^= 1
    (tmp_path / TRAJECTORY).write_bytes(whole)
    for command in (["replay"], ["vibrometer", "--picture", tmp_path / "v.png"], ["run", "--resume"]):
        check_one_line(feeder_sim(command[0], *command[1:], tmp_path), 2, "not a readable trajectory file")


def interrupted(scenario: Scenario, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that was stopped before its first step."""

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(run_folder, "run_ensemble", stop)
        with pytest.raises(KeyboardInterrupt):
            record_run(scenario, folder, replay=False)


def test_run_does_not_go_on_with_other_input_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    mode_file, mesh = tmp_path / "modes.h5", tmp_path / "box.stl"
    held = read_mode_file(REPOSITORY / "models/plate_180/modes.h5")
    plate = load_scenario(REPOSITORY / "scenarios/drift_2797hz_plate.toml")
    on_plate = plate.model_copy(update={"plate": plate.plate.model_copy(update={"mode_file": mode_file})})
    of_mesh = ball().model_copy(update={"part": (MeshPart(shape="mesh", file=mesh, guide=Slide(kind="slide")),)})
    write_mode_file(mode_file, held)
    trimesh.creation.box((2.0, 3.0, 4.0)).export(mesh)
    for scenario, name in ((on_plate, "plate"), (of_mesh, "mesh")):
        interrupted(scenario, tmp_path / name, monkeypatch)
    for own in (mode_file, mesh):
        own.unlink()  # the runs have copies
    write_mode_file(tmp_path / "plate/inputs/modes.h5", ModeFile(held.modes))  # without what was measured
    trimesh.creation.box((2.0, 3.0, 5.0)).export(tmp_path / "mesh/inputs/box.stl")
    for name, key in (("plate", r"plate\.mode_file"), ("mesh", r"part\[0\]\.file")):
        with pytest.raises(InputError, match=f"{name}: --resume: was begun with another content of {key}, allowed"):
            resume_run(tmp_path / name, replay=False)


@pytest.mark.parametrize("changed", ["feeder_sim", "numpy"])
def test_run_does_not_go_on_with_another_version(changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the package the sources count, not only the number of the version."""
    versions = library_versions()
    interrupted(ball(), tmp_path, monkeypatch)
    other = versions | {changed: versions[changed] + "0"}
    monkeypatch.setattr(provenance, "library_versions", lambda: other)
    with pytest.raises(InputError, match=f"--resume: was begun with another version of {changed}, allowed is the same"):
        resume_run(tmp_path, replay=False)


def test_cost_of_a_run_that_goes_on_counts_all_stretches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = ball(seeds=1, duration_s=60.0)
    with monkeypatch.context() as patch:  # as if the first stretch had taken hours
        finish = TrajectoryWriter.finish
        patch.setattr(TrajectoryWriter, "finish", lambda file, n, seed, wall_s: finish(file, n, seed, wall_s + 5000.0))
        first = record_run(scenario, tmp_path, stop=StopsAfter(3), replay=False)
    assert first.interrupted and first.wall_s < 1000.0
    stored = read_recording(tmp_path / TRAJECTORY).wall_s
    second = resume_run(tmp_path, stop=StopsAfter(3), replay=False)
    assert second.interrupted and second.wall_s > stored > 5000.0
    result = resume_run(tmp_path, replay=False)
    summary = json.loads((tmp_path / SUMMARY).read_text())
    assert not result.interrupted and summary["wall_s"] == result.wall_s > second.wall_s
    one_core = summary["wall_s_per_simulated_s_one_core"] * summary["simulated_s"]
    assert one_core == pytest.approx(sum(seed.wall_s for seed in result.seeds))
