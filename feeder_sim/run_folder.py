"""One run on disk: resolved scenario, MJCF, trajectory, summary and replay in a folder of its own."""

from __future__ import annotations

import contextlib
import importlib.metadata
import io
import itertools
import json
import threading
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.checkpoint import Checkpoint, CheckpointFolder
from feeder_sim.engines import choose_engine
from feeder_sim.errors import InputError, RecordingFailed, SimulationDiverged
from feeder_sim.measures import check_stop_rule, transport_cell
from feeder_sim.mjcf import build_mjcf
from feeder_sim.scenario import Scenario, parse_scenario
from feeder_sim.scene import Scene, build_scene
from feeder_sim.seed_run import Begun, LastStates
from feeder_sim.simulation import Result, check_starts, simulate_scene
from feeder_sim.trajectory import Frames, PartRecord, PlateRecord, Record, Recording, Status
from feeder_sim.trajectory_file import TrajectoryWriter, read_recording

TRAJECTORY, REPLAY, SUMMARY, RESOLVED, MJCF = (
    "trajectory.h5",
    "replay.rrd",
    "summary.json",
    "scenario.toml",
    "scene.xml",
)
LIBRARIES = ("mujoco-core", "mujoco", "numpy", "scipy", "numba", "h5py")
STATE_PREFIX = "state_"  # of the engine's arrays among the last states of a seed that diverged
DISPLAY_POINTS = 121  # per axis of the plate: enough for the shortest wave of the catalogue, small enough to scrub


def record_run(
    scenario: Scenario,
    folder: str | Path,
    *,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    replay: bool = True,
    notify: Callable[[str], None] | None = None,
) -> Result:
    """Simulate a scenario and write everything about it into `folder`.

    Args:
        scenario: what to run.
        folder: made if missing; it must not hold a run already.
        progress: as for `simulate`.
        stop: as for `simulate`.
        notify: as for `simulate`.
        replay: also build the .rrd from the finished trajectory file.

    Raises:
        InputError: the scenario cannot be built (nothing is written), or the folder holds a run.
    """
    folder = Path(folder)
    check_free(folder)
    scene = build_scene(scenario)
    check_stop_rule(scene, transport_cell(scene))
    choose_engine(scenario)
    check_starts(scene)
    folder.mkdir(parents=True, exist_ok=True)
    check_free(folder)
    (folder / RESOLVED).write_text(scenario_toml(scenario), encoding="utf-8")
    (folder / MJCF).write_text(mjcf_text(scene), encoding="utf-8")
    return _run_into(folder, scene, {}, progress=progress, stop=stop, replay=replay, notify=notify)


def resume_run(
    folder: str | Path,
    *,
    progress: Callable[[float], None] | None = None,
    stop: threading.Event | None = None,
    replay: bool = True,
    notify: Callable[[str], None] | None = None,
) -> Result:
    """Go on with a run that was interrupted or killed, from its last checkpoints; arguments as for `record_run`.

    The result is bit by bit what it would have been without the break, given the same libraries.

    Raises:
        InputError: there is no run in the folder, it has ended, it was made with other libraries, or it cannot be read.
    """
    folder = Path(folder)
    recording = recording_of(folder)
    if all(status != Status.UNFINISHED for status in recording.status) and (folder / SUMMARY).exists():
        raise InputError("has ended, there is nothing to resume", file=folder, key="--resume")
    if recording.libraries != library_versions():
        changed = sorted(set(recording.libraries.items()) ^ set(library_versions().items()))
        raise InputError(
            f"was begun with other libraries ({changed[0][0]}), allowed are the same ones", file=folder, key="--resume"
        )
    scene = build_scene(parse_scenario(recording.scenario_text, file=folder / RESOLVED))
    checkpoints = CheckpointFolder(folder)
    begun = {}
    for index, status in enumerate(recording.status):
        held = checkpoints.load(index)
        if status in (Status.DONE, Status.LEFT_PLATE):
            begun[index] = _begun(recording.records[index], {}, status)
        elif held is not None and held.sizes[0] <= len(recording.seeds[index]):
            # What diverged does so again, and says why.
            begun[index] = _begun(recording.records[index].begin(held.sizes), held.state, Status.UNFINISHED)
    return _run_into(folder, scene, begun, progress=progress, stop=stop, replay=replay, notify=notify)


def _begun(record: Record, state: dict[str, NDArray[np.float64]], status: Status) -> Begun:
    return Begun(record.frames, record.impacts, record.removals, record.stops, state, status)


class RunRecorder:
    """Puts blocks into the trajectory file and keeps checkpoints that match it."""

    def __init__(self, folder: Path, writer: TrajectoryWriter) -> None:
        self._folder, self._checkpoints, self._writer = folder, CheckpointFolder(folder), writer
        self._recorded: dict[int, NDArray[np.int64]] = {}

    def append(self, seed_index: int, block: Record) -> None:
        self._writer.append(seed_index, block)
        new = np.array(block.sizes)
        self._recorded[seed_index] = self._recorded.get(seed_index, np.zeros_like(new)) + new

    def checkpoint(self, seed_index: int, state: dict[str, NDArray[np.float64]]) -> None:
        self._checkpoints.save(seed_index, Checkpoint(tuple(self._recorded[seed_index].tolist()), state))

    def keep_last(self, failure: SimulationDiverged, last: LastStates) -> str:
        return save_last_states(self._folder, failure, last)

    def finish(self, seed_index: int, status: Status) -> None:
        self._writer.finish(seed_index, status)


def save_last_states(folder: Path, failure: SimulationDiverged, last: LastStates) -> str:
    """Write the last states of a seed that diverged into a run folder, as NumPy's .npz; returns the file's name.

    Arrays: those of `Frames` [SI units], `state_NAME` of the engine, `stops`, `skipped` and `valid` (see `LastStates`),
    `cause`, `part`, `time_s`. A run that is resumed may come here again: a file that holds anything else stays, and
    this one gets the next free number.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
    """
    arrays = {field.name: getattr(last.frames, field.name) for field in fields(Frames)}
    arrays |= {f"{STATE_PREFIX}{name}": values for name, values in last.state.items()}
    arrays |= {"stops": last.stops, "skipped": np.array(last.skipped), "valid": np.array(last.valid)}
    arrays |= {"cause": np.array(failure.cause), "part": np.array(failure.part), "time_s": np.array(failure.time_s)}
    held = io.BytesIO()
    np.savez(held, allow_pickle=False, **arrays)
    stem = f"failure_seed_{failure.seed}"
    for name in itertools.chain([f"{stem}.npz"], (f"{stem}_{number}.npz" for number in itertools.count(2))):
        path = folder / name
        if path.exists() and path.read_bytes() != held.getvalue():
            continue
        partial = path.with_suffix(".partial")
        try:
            partial.write_bytes(held.getvalue())
            partial.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)
            raise RecordingFailed(f"{path}: cannot be written, is the disk full? ({error})") from error
        return name
    raise AssertionError("unreachable")


def read_last_states(path: str | Path) -> LastStates:
    """Read the last states of a seed that diverged, to run its last block again.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as held:
            arrays = {name: held[name] for name in held.files}
        frames = Frames(**{field.name: arrays[field.name] for field in fields(Frames)})
        state = {name[len(STATE_PREFIX) :]: arrays[name] for name in arrays if name.startswith(STATE_PREFIX)}
        return LastStates(state, arrays["stops"], int(arrays["skipped"]), frames, int(arrays["valid"]))
    except (OSError, ValueError, EOFError, KeyError, BadZipFile) as error:
        raise InputError("holds no readable last states", file=path) from error


def _run_into(
    folder: Path,
    scene: Scene,
    begun: dict[int, Begun],
    *,
    progress: Callable[[float], None] | None,
    stop: threading.Event | None,
    replay: bool,
    notify: Callable[[str], None] | None,
) -> Result:
    """Simulate a scene into a folder; what has begun is copied into the new trajectory file first."""
    scenario, new = scene.scenario, folder / f"{TRAJECTORY}.new"
    new.unlink(missing_ok=True)
    writer = TrajectoryWriter(
        new,
        engine=choose_engine(scenario).name,
        seed=scenario.run.seed,
        n_seeds=scenario.run.seeds,
        scenario_text=scenario_toml(scenario),
        libraries=library_versions(),
        plate=plate_record(scene),
        parts=[PartRecord(part.name, part.vertices, part.faces) for part in scene.parts],
    )
    recorder = RunRecorder(folder, writer)
    try:
        for index, held in begun.items():
            recorder.append(index, held)
            if held.status != Status.UNFINISHED:
                recorder.finish(index, held.status)
        new.replace(folder / TRAJECTORY)  # only now, when a kill leaves it readable and loses nothing
        result = simulate_scene(scene, recorder=recorder, progress=progress, stop=stop, notify=notify, begun=begun)
    finally:
        writer.close()
    summary = result.summary() | {"version": __version__, "libraries": library_versions()}
    (folder / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    if not result.interrupted:
        CheckpointFolder(folder).clear()
    if replay and len(result.seeds[0].frames):
        from feeder_sim.replay import build_replay

        build_replay(folder / TRAJECTORY, folder / REPLAY)
    return result


def check_free(folder: Path) -> None:
    """Refuse a folder that already holds a run, or a path that is not a folder.

    Raises:
        InputError: as said.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is not a folder", file=folder, key="--out")
    held = [name for name in (TRAJECTORY, REPLAY, SUMMARY, RESOLVED, MJCF) if (folder / name).exists()]
    if held:
        raise InputError(f"already holds a run ({held[0]}), allowed is a folder without one", file=folder, key="--out")


def fresh_folder(stem: str, base: Path = Path("runs")) -> Path:
    """Make and return the first of runs/STEM-001, runs/STEM-002, ... that does not exist."""
    base.mkdir(parents=True, exist_ok=True)
    for number in itertools.count(1):
        folder = base / f"{stem}-{number:03d}"
        with contextlib.suppress(FileExistsError):  # of a run that was started at the same moment
            folder.mkdir()
            return folder
    raise AssertionError("unreachable")


def recording_of(run: Path) -> Recording:
    """Read the trajectory of a run folder, or a trajectory file itself.

    Raises:
        InputError: there is none, or it cannot be read.
    """
    trajectory = run if run.suffix == ".h5" else run / TRAJECTORY
    if not trajectory.is_file():
        raise InputError(f"no run here, allowed is a folder that holds {TRAJECTORY}", file=run)
    return read_recording(trajectory)


def scenario_toml(scenario: Scenario) -> str:
    """The scenario with every default spelled out, as TOML that runs again."""
    import tomli_w

    return tomli_w.dumps(scenario.model_dump(mode="json", exclude_none=True))


def mjcf_text(scene: Scene) -> str:
    """The scene as readable MJCF (six digits); compiles by itself."""
    spec = build_mjcf(scene)
    spec.compile()
    return str(spec.to_xml())


def library_versions() -> dict[str, str]:
    """Versions of the libraries that decide the numbers."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def plate_record(scene: Scene) -> PlateRecord:
    """What the trajectory file keeps of the plate, thinned for display."""
    surface, cell = scene.surface, transport_cell(scene)
    x = np.linspace(surface.x[0], surface.x[-1], min(len(surface.x), DISPLAY_POINTS))
    y = np.linspace(surface.y[0], surface.y[-1], min(len(surface.y), DISPLAY_POINTS))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    shapes = [surface.deflection(j, points).reshape(len(x), len(y)) for j in range(surface.n_shapes)]
    return PlateRecord(
        length=surface.length,
        width=surface.width,
        thickness=surface.thickness,
        x=x,
        y=y,
        mode_shape=np.stack(shapes),
        nodal_lines=cell.lines.lines if cell else (),
        antinode=cell.antinode if cell else np.full(2, np.nan),
        drives=scene.drives,
    )
