"""One run on disk: resolved scenario, MJCF, trajectory, summary and replay in a folder of its own."""

from __future__ import annotations

import contextlib
import itertools
import json
import threading
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.engines.lookup import engine_class
from feeder_sim.engines.mujoco.mjcf import build_mjcf
from feeder_sim.errors import InputError, RecordingFailed, not_written, shortened
from feeder_sim.measures.picks import has_picks, picks_csv
from feeder_sim.records.checkpoint import CheckpointFolder, run_identity
from feeder_sim.records.counts import NOTHING_COUNTED, Counts
from feeder_sim.records.own_files import INPUTS, LOCK, is_own, locked
from feeder_sim.records.trajectory import PartRecord, PlateRecord, Record, Recording, Status, WallTime
from feeder_sim.records.trajectory_file import TRAJECTORY, recording_of
from feeder_sim.records.trajectory_writer import TrajectoryWriter
from feeder_sim.records.whole_file import partial_of, write_whole
from feeder_sim.replay.replay import REPLAY, build_replay, remove_replays
from feeder_sim.run.carried_files import carry_files, left_by_a_kill, relative
from feeder_sim.run.keep import AllFrames, Keep, check_kept
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import check_inputs, check_libraries, input_hashes, library_versions
from feeder_sim.run.recorder import RunRecorder
from feeder_sim.run.seed_record import Begun, Left
from feeder_sim.run.simulation import Result, announced, check_starts, run_ensemble
from feeder_sim.run.watchdog import STALL_AFTER_S
from feeder_sim.scenario import Scenario, load_scenario, parse_scenario
from feeder_sim.scenario.laws import uncovered_laws
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.single_thread import single_threaded

SUMMARY, PICKS, RESOLVED, MJCF = "summary.json", "picks.csv", "scenario.toml", "scene.xml"
DISPLAY_POINTS = 121  # per axis of the plate: enough for the shortest wave of the catalogue, small enough to scrub
MJCF_PARTS = 200  # that scene.xml is written for; it names every pair of parts, a hundred thousand of 500


@single_threaded
def record_run(
    scenario: Scenario,
    folder: str | Path,
    *,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    replay: bool = True,
    record: Keep = AllFrames(),  # noqa: B008, it cannot be changed
    notify: Callable[[str], None] | None = None,
    stall_after: float = STALL_AFTER_S,
) -> Result:
    """Simulate a scenario and write everything about it into `folder`, with the files that it reads.

    Args:
        scenario: what to run.
        folder: made if missing; it must be empty.
        progress: as for `simulate`.
        stop: as for `simulate`.
        replay: also build the .rrd from the finished trajectory file.
        record: what the result keeps of each seed in memory; the folder always holds all frames.
        notify: takes a line for the user, such as that the engine is being compiled.
        stall_after: as for `run_ensemble`.

    Raises:
        InputError: the scenario cannot be built (nothing is written), or the folder is not empty or in use.
        RecordingFailed: a file cannot be written, as when the disk is full.
    """
    folder = Path(folder)
    check_free(folder, scenario)
    prepared = prepare(scenario)
    check_kept(prepared, record)
    check_starts(prepared.scene, notify)
    how: dict[str, Any] = {"progress": progress, "stop": stop, "replay": replay, "notify": notify}
    return _begin_folder(folder, prepared, Left({}, 0.0), record=record, stall_after=stall_after, **how)


@single_threaded
def record_ended(scenario: Scenario, folder: Path, ended: Begun, *, replay: bool = True) -> Result:
    """Write a run folder of one seed that has ended, which nothing is simulated for; errors as for `record_run`.

    Args:
        scenario: what was run, with one seed.
        folder: as for `record_run`.
        ended: what there is of it.
        replay: as for `record_run`.
    """
    check_free(folder)
    how: dict[str, Any] = {"progress": None, "stop": None, "replay": replay, "notify": None}
    return _begin_folder(folder, prepare(scenario), Left({0: ended}, ended.wall_s), record=AllFrames(), **how)


def _begin_folder(folder: Path, prepared: Prepared, left: Left, **how: Any) -> Result:
    """Run into a folder that is made; `how` as for `_run_into`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error
    with locked(folder):
        check_free(folder, prepared.scenario)  # again: another process may have been faster
        text = scenario_toml(carry_files(prepared.scenario, folder, how["notify"]))
        write_whole(folder / RESOLVED, text.encode())
        _write_mjcf(prepared.scene, folder / MJCF, how["notify"])
        return _run_into(folder, prepared, text, left, **how)


@single_threaded
def resume_run(
    folder: str | Path,
    *,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    replay: bool = True,
    notify: Callable[[str], None] | None = None,
    stall_after: float = STALL_AFTER_S,
) -> Result:
    """Go on with a run that was interrupted or killed, from its last checkpoints; arguments as for `record_run`.

    The result is bit by bit what it would have been without the break. That takes the same package, libraries and input
    files, which are compared. A run that was killed before it had recorded anything begins anew.

    Raises:
        InputError: there is no run in the folder, it has ended, it was begun with something else, cannot be read, or is
            still running.
        RecordingFailed: as for `record_run`.
    """
    folder = Path(folder)
    if not _is_begun(folder):
        raise InputError(f"no run here, allowed is a folder that holds {TRAJECTORY}", file=folder, key="--resume")
    with locked(folder):
        how: dict[str, Any] = {"progress": progress, "stop": stop, "replay": replay, "notify": notify}
        return _resume(folder, stall_after=stall_after, **how)


def _is_begun(folder: Path) -> bool:
    """Whether a run has begun in a folder: its trajectory is there, or its lock and scenario and no file of others.

    A scenario alone does not tell: sweeps, folders to start from and those of users have one, too.
    """
    if (folder / TRAJECTORY).is_file():
        return True
    held = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    return {LOCK, RESOLVED} <= held and all(is_own(name) for name in held)


def _resume(folder: Path, **how: Any) -> Result:
    """Go on with the run of a locked folder; `how` as for `_run_into`."""
    if not (folder / TRAJECTORY).exists():
        scenario = load_scenario(folder / RESOLVED)
        prepared = prepare(scenario)
        check_starts(prepared.scene, how["notify"])
        _write_mjcf(prepared.scene, folder / MJCF, how["notify"])
        return _run_into(folder, prepared, scenario_toml(relative(scenario, folder)), Left({}, 0.0), **how)
    recording = recording_of(folder)
    if all(status != Status.UNFINISHED for status in recording.status) and (folder / SUMMARY).exists():
        raise InputError("has ended, there is nothing to resume", file=folder, key="--resume")
    check_libraries(recording.libraries, folder, "--resume")
    scenario = parse_scenario(recording.scenario_text, file=folder / RESOLVED)
    check_inputs(recording.inputs, scenario, folder, "--resume")
    prepared = prepare(scenario)
    begun = _all_begun(recording, prepared, folder)
    before = max((wall_time.ensemble for wall_time in recording.wall_times), default=0.0)
    return _run_into(folder, prepared, recording.scenario_text, Left(begun, before), **how)


def _all_begun(recording: Recording, prepared: Prepared, folder: Path) -> dict[int, Begun]:
    """The seeds that have ended or can go on from a checkpoint; the others begin anew."""
    checkpoints = CheckpointFolder(folder, _identity(recording.scenario_text, prepared.scenario))
    fresh: dict[str, NDArray[np.float64]] = {}
    begun = {}
    for index, (record, status, wall_time) in enumerate(
        zip(recording.records, recording.status, recording.wall_times, strict=True)
    ):
        if status in (Status.DONE, Status.LEFT_PLATE):
            begun[index] = _begun(record, status, {}, wall_time, recording.counts[index])
            continue
        checkpoint = checkpoints.load(index)
        if checkpoint is None:
            continue
        fresh = fresh or engine_class(prepared.engine)(prepared.scene, np.random.default_rng(0)).state()
        checkpoints.check_fits(index, checkpoint.state, fresh)
        if all(size <= held for size, held in zip(checkpoint.sizes, record.sizes, strict=True)):
            # What diverged does so again, and says why.
            begun[index] = _begun(record.begin(checkpoint.sizes), Status.UNFINISHED, checkpoint.state, wall_time)
    return begun


def _identity(text: str, scenario: Scenario) -> str:
    return run_identity(text, library_versions(), input_hashes(scenario))


def _begun(
    record: Record,
    status: Status,
    state: dict[str, NDArray[np.float64]],
    wall_time: WallTime,
    counts: Counts = NOTHING_COUNTED,
) -> Begun:
    held = {entry.name: getattr(record, entry.name) for entry in fields(Record)}
    return Begun(**held, status=status, state=state, wall_s=wall_time.seed, counts=counts)


def _run_into(
    folder: Path,
    prepared: Prepared,
    text: str,
    left: Left,
    *,
    progress: Callable[[float], None] | None,
    stop: threading.Event | None,
    replay: bool,
    notify: Callable[[str], None] | None,
    record: Keep = AllFrames(),  # noqa: B008
    stall_after: float = STALL_AFTER_S,
) -> Result:
    """Simulate a scene into a folder; what has begun is copied into the new trajectory file first."""
    scenario, scene, new = prepared.scenario, prepared.scene, folder / f"{TRAJECTORY}.new"
    new.unlink(missing_ok=True)
    with announced(f"making the file for {scenario.run.seeds} seeds", notify):
        writer = TrajectoryWriter(
            new,
            engine=prepared.engine.name,
            seed=scenario.run.seed,
            n_seeds=scenario.run.seeds,
            scenario_text=text,
            libraries=library_versions(),
            inputs=input_hashes(scenario),
            plate=plate_record(prepared),
            parts=[
                PartRecord(part.name, part.vertices, part.faces, part.centre, part.principal_axes, scene.poses[kind])
                for part, kind in zip(scene.parts, scene.kind_of, strict=True)
            ],
        )
    checkpoints = CheckpointFolder(folder, _identity(text, scenario))
    recorder = RunRecorder(folder, writer, checkpoints, wall_s_before=left.wall_s)
    try:
        for index, seed in left.begun.items():
            recorder.append(index, seed)
            recorder.write(index)
            writer.note_wall_time(index, WallTime(seed.wall_s, left.wall_s))
            if seed.status != Status.UNFINISHED:
                writer.finish(index, seed.status, seed.counts)
        writer.move_to(folder / TRAJECTORY)  # only now, when a kill leaves it readable and loses nothing
        remove_replays(folder)  # built from the file that was here before
        how: dict[str, Any] = {"progress": progress, "stop": stop, "notify": notify, "stall_after": stall_after}
        result = run_ensemble(prepared, recorder=recorder, left=left, record=record, **how)
    except BaseException:
        with contextlib.suppress(RecordingFailed):  # the first failure is the one to hear of
            writer.close()
        raise
    writer.close()
    summary = result.summary() | {"version": __version__, "libraries": library_versions()}
    write_whole(folder / SUMMARY, f"{json.dumps(summary, indent=2)}\n".encode())
    if not result.interrupted:
        if has_picks(prepared.scene):
            write_whole(folder / PICKS, picks_csv(prepared.scene, result.seeds).encode())
        checkpoints.clear(scenario.run.seeds)
    if replay and not result.interrupted and result.seeds[0].reached is not None:
        build_replay(folder / TRAJECTORY, folder / REPLAY)
    return result


def check_free(folder: Path, scenario: Scenario | None = None) -> None:
    """Refuse a folder that is not empty, or a path that is not a folder.

    What a process that was killed before it had begun a run of the scenario has left does not count.

    Raises:
        InputError: as said.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is not a folder", file=folder, argument="folder")
    held = {path.name for path in folder.iterdir()} if folder.exists() else set()
    held -= {LOCK, partial_of(folder / RESOLVED).name}
    if INPUTS in held and scenario is not None and left_by_a_kill(folder / INPUTS, scenario):
        held -= {INPUTS}
    if held & {TRAJECTORY, REPLAY, SUMMARY, PICKS, RESOLVED, MJCF}:
        raise InputError("already holds a run, allowed is a new or an empty folder", file=folder, argument="folder")
    if held:
        name = shortened(min(held), 40)
        raise InputError(f"is not empty ({name}), allowed is a new or an empty folder", file=folder, argument="folder")


def fresh_folder(stem: str, base: Path = Path("runs")) -> Path:
    """Make and return the first of runs/STEM-001, runs/STEM-002, ... that does not exist."""
    try:
        base.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(base, error) from error
    for number in itertools.count(1):
        folder = base / f"{stem}-{number:03d}"
        with contextlib.suppress(FileExistsError):  # of a run that was started at the same moment
            folder.mkdir()
            return folder
    raise AssertionError("unreachable")


def scenario_toml(scenario: Scenario) -> str:
    """The scenario with every default spelled out, as TOML that runs again."""
    import tomli_w

    return tomli_w.dumps(scenario.model_dump(mode="json", exclude_none=True))


def mjcf_text(scene: Scene) -> str:
    """The scene as readable MJCF (six digits); compiles by itself."""
    spec = build_mjcf(scene)
    spec.compile()
    return str(spec.to_xml())


def _write_mjcf(scene: Scene, path: Path, notify: Callable[[str], None] | None) -> None:
    """Write the scene as MJCF, unless its parts make too many pairs or MuJoCo does not have its law of impact."""
    refused = next(uncovered_laws(scene.scenario, in_mujoco=True), None)
    if refused is None and len(scene.parts) <= MJCF_PARTS:
        write_whole(path, mjcf_text(scene).encode())
    elif notify:
        why = refused or f"it is written for up to {MJCF_PARTS} parts, here are {len(scene.parts)}"
        notify(f"{path.name} is left out: {why}")


def plate_record(prepared: Prepared) -> PlateRecord:
    """What the trajectory file keeps of the plate, thinned for display."""
    surface, cell = prepared.scene.surface, prepared.cell
    x = np.linspace(surface.x[0], surface.x[-1], min(len(surface.x), DISPLAY_POINTS))
    y = np.linspace(surface.y[0], surface.y[-1], min(len(surface.y), DISPLAY_POINTS))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    own = 1 + max((drive.shape for drive in prepared.scene.drives), default=0)  # modes that only follow are not drawn
    shapes = [surface.deflection(j, points).reshape(len(x), len(y)) for j in range(own)]
    return PlateRecord(
        length=surface.length,
        width=surface.width,
        thickness=surface.thickness,
        x=x,
        y=y,
        mode_shape=np.stack(shapes),
        nodal_lines=cell.lines.lines if cell else (),
        antinode=cell.antinode if cell else np.full(2, np.nan),
        drives=prepared.scene.drives,
        outline=surface.outline,
    )
