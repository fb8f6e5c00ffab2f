"""One run on disk: resolved scenario, MJCF, trajectory, summary and replay in a folder of its own."""

from __future__ import annotations

import contextlib
import importlib.metadata
import itertools
import json
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np

from feeder_sim import __version__
from feeder_sim.engines import choose_engine
from feeder_sim.errors import InputError
from feeder_sim.measures import Cell, check_stop_rule, transport_cell
from feeder_sim.mjcf import build_mjcf
from feeder_sim.scenario import Scenario
from feeder_sim.scene import Scene, build_scene
from feeder_sim.simulation import Result, simulate_scene
from feeder_sim.trajectory import PartRecord, PlateRecord, Recording, TrajectoryWriter, read_recording

TRAJECTORY, REPLAY, SUMMARY, RESOLVED, MJCF = (
    "trajectory.h5",
    "replay.rrd",
    "summary.json",
    "scenario.toml",
    "scene.xml",
)
LIBRARIES = ("mujoco-core", "mujoco", "numpy", "scipy", "numba", "h5py")
DISPLAY_POINTS = 121  # per axis of the plate: enough for the shortest wave of the catalogue, small enough to scrub
ENVELOPE_POINTS = 2001


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
    cell = transport_cell(scene)
    check_stop_rule(scene, cell)
    engine = choose_engine(scenario)
    folder.mkdir(parents=True, exist_ok=True)
    check_free(folder)
    (folder / RESOLVED).write_text(scenario_toml(scenario), encoding="utf-8")
    (folder / MJCF).write_text(mjcf_text(scene), encoding="utf-8")
    writer = TrajectoryWriter(
        folder / TRAJECTORY,
        engine=engine.name,
        seed=scenario.run.seed,
        n_seeds=scenario.run.seeds,
        scenario_text=scenario_toml(scenario),
        libraries=library_versions(),
        plate=plate_record(scene, cell),
        parts=[PartRecord(part.name, part.vertices, part.faces) for part in scene.parts],
    )
    try:
        result = simulate_scene(scene, recorder=writer, progress=progress, stop=stop, notify=notify)
    finally:
        writer.close()
    summary = result.summary() | {"version": __version__, "libraries": library_versions()}
    (folder / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
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


def plate_record(scene: Scene, cell: Cell | None) -> PlateRecord:
    """What the trajectory file keeps of the plate, thinned for display."""
    surface = scene.surface
    x = np.linspace(surface.x[0], surface.x[-1], min(len(surface.x), DISPLAY_POINTS))
    y = np.linspace(surface.y[0], surface.y[-1], min(len(surface.y), DISPLAY_POINTS))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    shapes = [surface.deflection(j, points).reshape(len(x), len(y)) for j in range(surface.n_shapes)]
    drive_time = np.linspace(0.0, scene.scenario.run.duration_s, ENVELOPE_POINTS)
    return PlateRecord(
        length=surface.length,
        width=surface.width,
        thickness=surface.thickness,
        x=x,
        y=y,
        mode_shape=np.stack(shapes),
        nodal_lines=cell.lines.lines if cell else (),
        antinode=cell.antinode if cell else np.full(2, np.nan),
        drive_time=drive_time,
        drive_amplitude=np.abs(surface.terms.phasor(drive_time, surface.n_shapes)),
    )
