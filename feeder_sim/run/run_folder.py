"""One run on disk: resolved scenario, MJCF, trajectory, summary and replay in a folder of its own."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import json
import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from feeder_sim import __version__
from feeder_sim.errors import InputError, cause_of, not_written, shortened
from feeder_sim.measures.picking import has_picks, picks_csv
from feeder_sim.pool.work import Work, silent
from feeder_sim.records.files import INPUTS, LOCK, RUN, SCENE, SEEDS, locked
from feeder_sim.records.recording import DISPLAY_POINTS, FixtureRecord, PartRecord, PlateRecord, Recording
from feeder_sim.records.seed import Seed, Status
from feeder_sim.records.trajectory_file import no_seed, write_scene_file, write_seed_file
from feeder_sim.replay.replay import REPLAY, build_replay, remove_replays
from feeder_sim.run.keep import AllFrames, Retention, check_retention
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import check_libraries, input_hashes, library_versions
from feeder_sim.run.recorded_run import RESOLVED, RecordedRun
from feeder_sim.run.simulation import Result, check_starts, simulate
from feeder_sim.scenario import Scenario, input_files, load_scenario, parse_scenario, with_files, with_run
from feeder_sim.scenario.rules import findings_of_level
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene
from feeder_sim.single_thread import single_threaded
from feeder_sim.whole_files import partial_of, write_whole

# Copies of the files that a scenario reads, in a folder that can then be taken elsewhere.

LARGEST_CARRIED = 100_000_000  # [byte]; larger files stay where they are: a run of them is not for the post
_UNUSUAL = re.compile(r"[^A-Za-z0-9._-]+|^\.+")


def carried_names(scenario: Scenario) -> dict[Path, str]:
    """Names for copies of the files that a scenario reads, by their paths.

    Files of the same content and suffix have the same name, other files names of their own, also where capitals do not
    count. Files above `LARGEST_CARRIED` have none.

    Raises:
        InputError: a file cannot be read.
    """
    names: dict[Path, str] = {}
    name_of: dict[tuple[str, str], str] = {}
    for key, path in input_files(scenario).items():
        if path in names or (path.is_file() and path.stat().st_size > LARGEST_CARRIED):
            continue
        identity = hashlib.sha256(_read(path, key)).hexdigest(), path.suffix
        if identity not in name_of:
            name_of[identity] = _free_name(path, {name.lower() for name in name_of.values()})
        names[path] = name_of[identity]
    return names


def _free_name(path: Path, used_names: set[str]) -> str:
    """A name of plain characters near that of a file: the same, or with a number."""
    plain = Path(_UNUSUAL.sub("_", path.name))
    numbered = (plain.with_stem(f"{plain.stem}_{number}") for number in itertools.count(2))
    return next(name.name for name in itertools.chain([plain], numbered) if name.name.lower() not in used_names)


def copy_files(names: Mapping[Path, str], folder: Path) -> None:
    """Write copies of files into a folder, which is made.

    Raises:
        RecordingFailed: one cannot be written, as when the disk is full.
        InputError: one cannot be read, or the folder cannot be made.
    """
    if not names:
        return
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error
    for name, path in {name: path for path, name in names.items()}.items():
        write_whole(folder / name, _read(path))


def carry_files(scenario: Scenario, run: Path, notify: Callable[[str], None] = silent) -> Scenario:
    """Copy the files that a scenario reads into a run folder; returns the scenario with the names of the copies.

    Names are relative to the run folder. A file above `LARGEST_CARRIED` keeps its own, which is said by `notify`.

    Raises:
        RecordingFailed, InputError: as for `copy_files` and `carried_names`.
    """
    names = carried_names(scenario)
    for path in sorted(set(input_files(scenario).values()) - names.keys()):
        notify(f"{path} is too large to be copied into {run}, which needs it where it is")
    copy_files(names, run / INPUTS)
    return with_files(scenario, lambda path: Path(INPUTS, names[path]) if path in names else path.absolute())


def _read(path: Path, key: str | None = None) -> bytes:
    if not path.is_file():  # a pipe may never end
        raise InputError("no such file", file=path, key=key)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=path, key=key) from error


FORMAT = 1  # of run.json
SUMMARY, PICKS, MJCF = "summary.json", "picks.csv", "scene.xml"
MJCF_PARTS = 200  # that scene.xml is written for; it names every pair of parts, a hundred thousand of 500


@single_threaded
def record_run(
    scenario: Scenario,
    folder: str | Path,
    *,
    replay: bool = True,
    record: Retention = AllFrames(),  # noqa: B008, it cannot be changed
    work: Work | None = None,
) -> Result:
    """Simulate a scenario and write everything about it into `folder`, with the files that it reads.

    Args:
        scenario: what to run.
        folder: made if missing; it must be empty.
        replay: also build the .rrd at the end.
        record: what the result keeps of each seed in memory; the folder always holds all frames.
        work: as for `simulate`.

    Raises:
        InputError: the scenario cannot be built (nothing is written), or the folder is not empty or in use.
        RecordingFailed: a file cannot be written, as when the disk is full.
    """
    folder, work = Path(folder), work or Work()
    check_free(folder)
    prepared = prepare(scenario)
    check_retention(prepared, record)
    check_starts(prepared.scene, work)
    return _begin_folder(folder, prepared, {}, replay=replay, record=record, work=work)


@single_threaded
def record_ended(prepared: Prepared, folder: Path, ended: Sequence[Seed], *, replay: bool = True) -> Result:
    """Write a run folder of seeds that have ended, which nothing is simulated for; errors as for `record_run`.

    Args:
        prepared: what was run, with so many seeds.
        folder: as for `record_run`.
        ended: what there is of them.
        replay: as for `record_run`.
    """
    check_free(folder)
    seeds = dict(enumerate(ended))
    return _begin_folder(folder, prepared, seeds, replay=replay, record=AllFrames(), work=Work())


def _begin_folder(
    folder: Path, prepared: Prepared, ended: Mapping[int, Seed], *, replay: bool, record: Retention, work: Work
) -> Result:
    """Run into a folder that is made; arguments as for `_run_into`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(folder, error) from error
    with locked(folder):
        check_free(folder)  # again: another process may have been faster
        scenario = scenario_toml(with_files(prepared.scenario, Path.absolute))
        run = {"format": FORMAT, "creator": f"feeder_sim {__version__}", "scenario": scenario}
        write_whole(folder / RUN, f"{json.dumps(run, indent=2)}\n".encode())
        _write_scene(folder, prepared, work)
        saved = {index: write_seed_file(folder, index, seed, seed.wall_s) for index, seed in ended.items()}
        before = sum(seed.wall_s for seed in saved.values())
        return _run_into(folder, prepared, saved, before, replay=replay, record=record, work=work)


def _write_scene(folder: Path, prepared: Prepared, work: Work) -> None:
    """Write what a run reads, and what is known of it before its first seed."""
    text = scenario_toml(carry_files(prepared.scenario, folder, work.notify))
    write_whole(folder / RESOLVED, text.encode())
    _write_mjcf(prepared.scene, folder / MJCF, work)
    try:
        (folder / SEEDS).mkdir(exist_ok=True)
    except OSError as error:
        raise not_written(folder / SEEDS, error) from error
    write_scene_file(recording_of(prepared, (), folder / SCENE, text))


@single_threaded
def resume_run(
    folder: str | Path,
    *,
    seeds: int | None = None,
    replay: bool = True,
    record: Retention = AllFrames(),  # noqa: B008
    work: Work | None = None,
) -> Result:
    """Go on with a run that was interrupted or killed, or with more seeds.

    Seeds that have ended stay; the others run from their start. So the result is bit by bit what it would have been
    without the break, or with so many seeds from the start. That takes the same package, libraries and input files,
    which are compared.

    Args:
        folder: of the run.
        seeds: how many there are to be, no fewer than before.
        replay: as for `record_run`.
        record: as for `record_run`.
        work: as for `record_run`.

    Raises:
        InputError: there is no run in the folder, it has ended, it was begun with something else, cannot be read, or is
            still running.
        RecordingFailed: as for `record_run`.
    """
    folder, work = Path(folder), work or Work()
    if not (folder / RUN).is_file():
        raise InputError(f"no run here, must be a folder that holds {RUN}", file=folder)
    with locked(folder):
        if not (folder / SCENE).exists():
            prepared = prepare(_with_seeds(_started_scenario(folder), seeds))
            check_starts(prepared.scene, work)
            _write_scene(folder, prepared, work)
            return _run_into(folder, prepared, {}, replay=replay, record=record, work=work)
        run = RecordedRun.open(folder)
        if run.is_tracked:
            raise InputError("was seen by a camera, there is nothing to resume", file=folder)
        scenario = _with_seeds(run.scenario, seeds)
        more = scenario.run.seeds > run.scenario.run.seeds
        if not more and Status.UNFINISHED not in run.recording.status and (folder / SUMMARY).exists():
            raise InputError("has ended, there is nothing to resume", file=folder)
        check_libraries(run.recording.libraries, folder)
        run.check_inputs()
        prepared = prepare(scenario) if more else run.prepared
        if more:
            check_starts(prepared.scene, work)
            _write_scene(folder, prepared, work)
        ended = {i: seed for i, seed in enumerate(run.recording.records) if seed.status != Status.UNFINISHED}
        before = run.recording.wall_s
        return _run_into(folder, prepared, ended, before, replay=replay, record=record, work=work)


def _with_seeds(scenario: Scenario, seeds: int | None) -> Scenario:
    """The scenario of a run with more seeds, if a number is given.

    Raises:
        InputError: it is one of fewer.
    """
    if seeds is None or seeds == scenario.run.seeds:
        return scenario
    if seeds < scenario.run.seeds:
        raise InputError(f"is {seeds}, must be at least the {scenario.run.seeds} of the run", argument="seeds")
    return with_run(scenario, seeds=seeds)


def _started_scenario(folder: Path) -> Scenario:
    """The scenario of a run that has recorded nothing: with copies of what it reads, or from the first file of all.

    Raises:
        InputError: the file cannot be read, or is of a later version.
    """
    path = folder / RUN
    if (folder / RESOLVED).is_file():
        return load_scenario(folder / RESOLVED)
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        version, text = record["format"], str(record["scenario"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError("is not the readable begin of a run", file=path) from error
    if version != FORMAT:
        raise InputError(f"is {shortened(repr(version), 20)}, must be {FORMAT}", file=path, key="format")
    return parse_scenario(text, file=path)


def _run_into(
    folder: Path,
    prepared: Prepared,
    ended: Mapping[int, Seed],
    wall_s_before: float = 0.0,
    *,
    replay: bool,
    record: Retention,
    work: Work,
) -> Result:
    """Simulate a scene into a folder; ended: seeds that have files there. Other arguments as for `simulate`."""
    for partial in (folder / SEEDS).glob(partial_of(Path("*")).name):  # of seeds under way in a kill
        partial.unlink(missing_ok=True)
    remove_replays(folder)
    for warning in prepared.warnings:
        work.notify(f"warning: {warning}")
    began = time.perf_counter() - wall_s_before
    result = simulate(
        prepared,
        record=record,
        work=work,
        save=lambda index, seed: write_seed_file(folder, index, seed, time.perf_counter() - began),
        ended=ended,
        wall_s_before=wall_s_before,
    )
    summary = result.summary() | {"version": __version__, "libraries": library_versions()}
    write_whole(folder / SUMMARY, f"{json.dumps(summary, indent=2)}\n".encode())
    if not result.interrupted and has_picks(prepared.scene):
        write_whole(folder / PICKS, picks_csv(prepared.scene, result.seeds).encode())
    if replay and not result.interrupted and result.seeds[0].reached is not None:
        build_replay(folder, folder / REPLAY)
    return result


def check_free(folder: Path) -> None:
    """Refuse a folder that is not empty, or a path that is not a folder.

    Raises:
        InputError: as said.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is not a folder", file=folder, argument="folder")
    # A process that was killed before it had begun may have left these.
    names = (
        {path.name for path in folder.iterdir()} - {LOCK, partial_of(folder / RUN).name} if folder.exists() else set()
    )
    if names & {RUN, SCENE}:
        raise InputError("already holds a run, must be a new or an empty folder", file=folder, argument="folder")
    if names:
        name = shortened(min(names), 40)
        raise InputError(f"is not empty ({name}), must be a new or an empty folder", file=folder, argument="folder")


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
    from feeder_sim.engines.mujoco.mjcf import build_mjcf

    spec = build_mjcf(scene)
    spec.compile()
    return str(spec.to_xml())


def _write_mjcf(scene: Scene, path: Path, work: Work) -> None:
    """Write the scene as MJCF, unless its parts make too many pairs or MuJoCo does not have its law of impact."""
    of_mujoco = findings_of_level(scene.scenario, "refused", engine="mujoco")
    refused = next((line for line in of_mujoco if line.startswith("contact.")), None)
    if refused is None and len(scene.parts) <= MJCF_PARTS:
        write_whole(path, mjcf_text(scene).encode())
    else:
        why = refused or f"it is written for up to {MJCF_PARTS} parts, here are {len(scene.parts)}"
        work.notify(f"{path.name} is left out: {why}")


def recording_of(
    prepared: Prepared, seeds: Sequence[Seed], path: Path, text: str = "", wall_s: float = 0.0
) -> Recording:
    """What is recorded of a run.

    Args:
        prepared: what is run.
        seeds: that there are; those that are missing have not begun.
        path: of the file that it goes into.
        text: the scenario as TOML. Default: with absolute paths of its files.
        wall_s: elapsed wall time of the ensemble [s].
    """
    scene, scenario = prepared.scene, prepared.scenario
    parts = (
        PartRecord(part.name, part.vertices, part.faces, part.centre, part.principal_axes, scene.poses[kind])
        for part, kind in zip(scene.parts, scene.kind_of, strict=True)
    )
    missing = [no_seed(len(scene.parts))] * (scenario.run.seeds - len(seeds))
    return Recording(
        path=path,
        engine=prepared.engine.name,
        scenario_text=text or scenario_toml(with_files(scenario, Path.absolute)),
        libraries=library_versions(),
        inputs=input_hashes(scenario),
        plate=plate_record(prepared),
        parts=tuple(parts),
        records=(*seeds, *missing),
        wall_s=wall_s,
    )


def plate_record(prepared: Prepared) -> PlateRecord:
    """What a recording keeps of the plate, thinned for display."""
    surface, cell = prepared.scene.surface, prepared.cell
    x = np.linspace(surface.x[0], surface.x[-1], min(len(surface.x), DISPLAY_POINTS))
    y = np.linspace(surface.y[0], surface.y[-1], min(len(surface.y), DISPLAY_POINTS))
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    n_drawn = 1 + max((drive.shape for drive in prepared.scene.drives), default=0)  # no modes that only follow
    shapes = np.stack([surface.deflection(j, points) for j in range(n_drawn)])
    if surface.outline is not None:  # beyond its edge shapes go on to values that no place of the plate has
        most = np.abs(shapes[:, surface.outline.holds(points)]).max(axis=1, keepdims=True)
        shapes = np.clip(shapes, -most, most)
    return PlateRecord(
        length=surface.length,
        width=surface.width,
        thickness=surface.thickness,
        x=x,
        y=y,
        mode_shape=shapes.reshape(n_drawn, len(x), len(y)),
        nodal_lines=cell.lines.lines if cell else (),
        antinode=cell.antinode if cell else np.full(2, np.nan),
        drives=prepared.scene.drives,
        outline=surface.outline,
        fixtures=tuple(
            FixtureRecord(each.name, *each.mesh, each.centre, each.axis) for each in prepared.scene.fixtures
        ),
        outlets={outlet.name: outlet.outline for outlet in prepared.scene.outlets},
    )
