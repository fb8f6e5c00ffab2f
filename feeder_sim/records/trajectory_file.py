"""The HDF5 files that are the record of truth of a run: its scene, and one for each seed that has ended.

Layout, schema version 6 (SI units, in the `unit` attribute of every dataset):

    scene.h5              written before the first seed:
    /                     schema, schema_version, creator, engine, seeds (their number), scenario (resolved TOML),
                          libraries (versions), inputs (SHA-256 of mode file and meshes) (JSON)
    /plate                length, width, thickness (attributes)
    /plate/x, y           (nx,), (ny,)        grid of the shapes below
    /plate/mode_shape     (n_shapes, nx, ny)  deflection per unit modal coordinate
    /plate/nodal_point    (k, 2)              points of the nodal lines of the first shape, line after line
    /plate/nodal_line     (k,)                number of the line each point belongs to
    /plate/antinode       (2,)                antinode the part starts from; NaN without nodal lines
    /plate/outline/point, ring   (k, 2), (k,)   of a plate that is no rectangle: ring 0 is its outer edge
    /fixtures/NAME/vertices, faces   (n, 3), (m, 3): of what stands on the plate, where it is at rest
    /fixtures/NAME/centre, axis      (3,): that it turns about
    /outlets/NAME         (n, 2)              corners of each outlet, seen from above
    /drive/shape          (k,)                mode shape that each excitation of the scenario drives
    /drive/drive_frequency, natural_frequency, amplitude, phase, damping_ratio   (k,)  NaN: no ring-up
    /parts/NAME/vertices, faces               drawn mesh from the centre of mass, in the axes of its file
    /parts/NAME/centre, principal_axes        (3,), (4,): of mass in the file; attitude of the principal axes in it
    /parts/NAME/poses/height, chance, yaws    of every stable pose, from A on
    /parts/NAME/poses/pose, down, attitude    (k,), (k, 3), (k, 4): directions that point down in a pose; see PoseTable

    seeds/NNN.h5          written when the seed has ended:
    /                     schema, schema_version, status, wall_time (of the seed, and of the run when it ended [s]),
                          unresolved_impacts, late_contacts, budgets_spent; see feeder_sim.records.seed
    /time, position, quaternion, velocity, angular_velocity, present
    /stops                (s,)                when the drives of the stages stopped; the others keep to the schedule
    /removals/time, part, cause, outlet       of parts taken out; see feeder_sim.records.seed
    /arrivals/time, part, cycle, height       of parts that came with a refill
    /impacts/time, until, approach_speed, departure_velocity   of a part in a guide
    /failure              divergence, cause, part, time, valid (attributes), and frames around it as above, in double
                          precision; of a seed that diverged
                          Of what is empty there is nothing.

`feeder-sim export` puts all of it into one file for other programs: scene.h5 with what a seed's file holds under
/seeds/NNN.

Positions are those of centres of mass, quaternions (w first) attitudes of the axes that a part was drawn in; velocities
are in world axes. Every file is written beside its place and renamed: it is whole, or it is not there. Structure and
data are under checksums.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import Divergence, InputError, SimulationDiverged, path_of_user
from feeder_sim.hdf5 import FileKind, get_text, put_text, read_hdf5, write_hdf5
from feeder_sim.records.files import SCENE, SEEDS, check_no_links
from feeder_sim.records.recording import Recording, read_part, read_plate, write_part, write_plate
from feeder_sim.records.seed import ARRIVALS, IMPACTS, REMOVALS, Columns, Counts, LastStates, Seed, Status, events
from feeder_sim.records.trajectory import FRAME_FIELDS, Frames

SCHEMA_VERSION, AGAIN = 6, "its scenario has to be run again"
RECORDING = FileKind("feeder_sim/trajectory", SCHEMA_VERSION, "recording", AGAIN)
SEED = FileKind("feeder_sim/seed", SCHEMA_VERSION, "recording of a seed", AGAIN)
EVENTS: dict[str, Columns] = {"impacts": IMPACTS, "removals": REMOVALS, "arrivals": ARRIVALS}
CHUNK = 2**18  # [bytes] of frames under one checksum, about
_NAME = re.compile(r"\d{3,}\.h5")


def read_recording(path: str | Path) -> Recording:
    """Read what a run folder has recorded, or a file that `export` has made of it.

    Seeds that have not ended have no frames.

    Raises:
        InputError: missing, truncated, not HDF5, not a recording, another schema version.
    """
    file = recorded_file(path_of_user(path, "read_recording"))
    return read_hdf5(file, RECORDING, lambda root: _recording(file, root))


def recorded_file(path: Path) -> Path:
    """The file of the scene of a run folder, or an exported file itself.

    Raises:
        InputError: there is none, or it is a link in a folder.
    """
    if path.suffix == ".h5" and path.is_file():
        return path
    check_no_links(path)
    if not (path / SCENE).is_file():
        raise InputError(f"no run here, must be a folder that holds {SCENE}", file=path)
    return path / SCENE


def seed_file(folder: Path, index: int) -> Path:
    """Where the file of a seed is in a run folder."""
    return folder / SEEDS / f"{index:03d}.h5"


def last_change(path: Path) -> int:
    """When a run folder got its last seed, or an exported file was written [ns]."""
    file = recorded_file(path)
    return max(each.stat().st_mtime_ns for each in (file, file.parent / SEEDS) if each.exists())


def write_scene_file(recording: Recording) -> None:
    """Write the file of the scene of a run; the recording says where, and how many seeds there will be.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
    """
    write_hdf5(recording.path, RECORDING, lambda file: _write_scene(file, recording))


def write_seed_file(folder: Path, index: int, seed: Seed, wall_s: float) -> Seed:
    """Write the file of a seed that has ended; wall_s: of the ensemble until now [s].

    Returns:
        the seed; of one that diverged with the name of the file that has its last states.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
    """
    path = seed_file(folder, index)
    write_hdf5(path, SEED, lambda file: _write_seed(file, seed, wall_s))
    return _saved_in(seed, path)


def _saved_in(seed: Seed, path: Path) -> Seed:
    """A seed whose failure, if it has one, says which file has its last states."""
    if seed.failure is None or seed.last is None:
        return seed
    return replace(seed, failure=seed.failure.saved_in(f"{SEEDS}/{path.name}"))


def export_recording(recording: Recording, path: Path) -> None:
    """Write a recording as one file; its layout stands above.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
    """

    def write(file: Any) -> None:
        _write_scene(file, recording)
        for index, seed in enumerate(recording.records):
            _write_seed(file.create_group(f"{SEEDS}/{index:03d}"), seed, recording.wall_s)

    write_hdf5(path, RECORDING, write)


def _write_scene(file: Any, recording: Recording) -> None:
    texts = {"creator": f"feeder_sim {__version__}", "engine": recording.engine}
    tables = {"libraries": json.dumps(recording.libraries), "inputs": json.dumps(recording.inputs)}
    put_text(file.attrs, texts | {"scenario": recording.scenario_text} | tables)
    file.attrs["seeds"] = len(recording.records)
    write_plate(file, recording.plate)
    written: dict[int, str] = {}
    for part in recording.parts:  # every mesh once; parts of one kind are links to the same data
        first = written.setdefault(id(part.vertices), part.name)
        if first == part.name:
            write_part(file, part)
        else:
            file[f"parts/{part.name}"] = file[f"parts/{first}"]


def _write_seed(group: Any, seed: Seed, wall_s: float) -> None:
    group.attrs.update(status=int(seed.status), wall_time=(seed.wall_s, wall_s), **seed.counts._asdict())
    for name, (unit, kind, _) in FRAME_FIELDS.items():
        _put_rows(group, name, getattr(seed.frames, name).astype(kind), unit)
    if len(seed.stops):
        _put_rows(group, "stops", seed.stops, "s")
    for event, columns in EVENTS.items():
        rows = getattr(seed, event)
        for name, (unit, _) in columns.items() if len(rows) else ():
            _put_rows(group, f"{event}/{name}", np.ascontiguousarray(rows[name]), unit)
    if seed.failure is None:
        return
    failure = group.create_group("failure")
    texts = {"divergence": seed.failure.divergence.name, "cause": seed.failure.detail, "part": seed.failure.part}
    put_text(failure.attrs, texts)
    failure.attrs["time"] = seed.failure.time_s
    if seed.last is not None:
        failure.attrs["valid"] = seed.last.valid
        for name, (unit, _, _) in FRAME_FIELDS.items():
            _put_rows(failure, name, getattr(seed.last.frames, name), unit)


def _put_rows(group: Any, name: str, values: NDArray[Any], unit: str) -> None:
    """Write rows, not packed: of motion that is noise packing saves a sixth."""
    stored: dict[str, Any] = {}
    if values.size:
        rows = max(1, min(len(values), CHUNK * len(values) // values.nbytes))
        stored = {"chunks": (rows, *values.shape[1:]), "fletcher32": True}
    put_text(group.create_dataset(name, data=values, **stored).attrs, {"unit": unit})


def _recording(path: Path, file: Any) -> Recording:
    parts = tuple(read_part(name, file["parts"][name]) for name in sorted(file["parts"], key=_part_number))
    if SEEDS in file:
        names = sorted(file[SEEDS], key=int)
        seeds = {int(name): _read_seed(file[f"{SEEDS}/{name}"], int(name)) for name in names}
    else:
        seeds = _seeds_in(path.parent, len(parts))
    n_seeds = int(file.attrs["seeds"])
    not_started = no_seed(len(parts)), 0.0
    records = [seeds.get(index, not_started) for index in range(n_seeds)]
    return Recording(
        path=path,
        engine=str(get_text(file.attrs, "engine")),
        scenario_text=str(get_text(file.attrs, "scenario")),
        libraries=dict(json.loads(str(get_text(file.attrs, "libraries")))),
        inputs=dict(json.loads(str(get_text(file.attrs, "inputs")))),
        plate=read_plate(file),
        parts=parts,
        records=tuple(seed for seed, _ in records),
        wall_s=max((wall_s for _, wall_s in records), default=0.0),
    )


def _seeds_in(folder: Path, n_parts: int) -> dict[int, tuple[Seed, float]]:
    """The seeds that a run folder has files of, by their index, as `_read_seed` gives them."""
    seeds = {}
    for path in sorted((folder / SEEDS).glob("*.h5")):
        if not _NAME.fullmatch(path.name):
            continue
        if not path.is_file():  # a pipe may never end
            raise InputError("is not a file", file=path)
        index = int(path.stem)
        seed, wall_s = read_hdf5(path, SEED, functools.partial(_read_seed, index=index))
        if seed.frames.present.shape[1] != n_parts:
            raise InputError(f"has {seed.frames.present.shape[1]} parts, must be {n_parts} as the run", file=path)
        seeds[index] = _saved_in(seed, path), wall_s
    return seeds


def no_seed(n_parts: int) -> Seed:
    """What there is of a seed that has not begun."""
    shapes = {name: (0,) if name == "time" else (0, n_parts, *shape) for name, (_, _, shape) in FRAME_FIELDS.items()}
    return Seed(
        Frames(**{name: np.zeros(shape, bool if name == "present" else float) for name, shape in shapes.items()})
    )


def _read_seed(group: Any, index: int) -> tuple[Seed, float]:
    """One seed, and the wall time of the ensemble when it ended [s]."""
    wall_s, of_ensemble = group.attrs["wall_time"].tolist()
    happened = {
        kind: events(fields, **_columns(group[kind], fields)) for kind, fields in EVENTS.items() if kind in group
    }
    seed = Seed(
        _frames(group),
        **happened,
        stops=group["stops"][()] if "stops" in group else np.empty(0),
        status=Status(int(group.attrs["status"])),
        wall_s=wall_s,
        counts=Counts(*(int(group.attrs[name]) for name in Counts._fields)),
    )
    if seed.status != Status.DIVERGED:
        return seed, of_ensemble
    failure = group["failure"]
    divergence, part, cause = (str(get_text(failure.attrs, name)) for name in ("divergence", "part", "cause"))
    time_s, kind = float(failure.attrs["time"]), Divergence[divergence]
    diverged = SimulationDiverged(kind, time_s=time_s, part=part, seed=index, detail=cause)
    last = LastStates(_frames(failure), int(failure.attrs["valid"])) if "valid" in failure.attrs else None
    return replace(seed, failure=diverged, last=last), of_ensemble


def _frames(group: Any) -> Frames:
    values = _columns(group, FRAME_FIELDS)
    if len({len(each) for each in values.values()}) > 1:
        raise InputError("has frames of different lengths", file=group.file.filename, key=group.name)
    return Frames(**{name: v if v.dtype == bool else v.astype(float) for name, v in values.items()})


def _columns(group: Any, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    return {name: group[name][()] for name in names}


def _part_number(name: str) -> int:
    return int(name.rpartition("_")[2])
