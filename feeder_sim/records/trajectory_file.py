"""The HDF5 file that is the record of truth of a run.

Layout, schema version 4 (SI units, in the `unit` attribute of every dataset):

    /                     schema, schema_version, creator, engine, seed, scenario (resolved TOML),
                          libraries (versions), inputs (SHA-256 of mode file and meshes) (JSON)
    /plate                length, width, thickness (attributes)
    /plate/x, y           (nx,), (ny,)        grid of the shapes below
    /plate/mode_shape     (n_shapes, nx, ny)  deflection per unit modal coordinate
    /plate/nodal_point    (k, 2)              points of the nodal lines of the first shape, line after line
    /plate/nodal_line     (k,)                number of the line each point belongs to
    /plate/antinode       (2,)                antinode the part starts from; NaN without nodal lines
    /plate/outline/point, ring   (k, 2), (k,)   of a plate that is no rectangle: ring 0 is its outer edge
    /drive/shape          (k,)                mode shape that each excitation of the scenario drives
    /drive/drive_frequency, natural_frequency, amplitude, phase, damping_ratio   (k,)  NaN: no ring-up
    /parts/NAME/vertices, faces               drawn mesh from the centre of mass, in the axes of its file
    /parts/NAME/centre, principal_axes        (3,), (4,): of mass in the file; attitude of the principal axes in it
    /parts/NAME/poses/height, chance, yaws    of every stable pose, from A on
    /parts/NAME/poses/pose, down, attitude    (k,), (k, 3), (k, 4): directions that point down in a pose; see PoseTable
    /seeds/NNN/time, position, quaternion, velocity, angular_velocity, present, status
    /seeds/NNN/unresolved_impacts, late_contacts, budgets_spent  (1,)   see feeder_sim.records.seed
    /seeds/NNN/wall_time  (2,)                of the seed, and of the ensemble when that was noted
    /seeds/NNN/removals/time, part, cause   of parts picked or lost; see feeder_sim.records.seed
    /seeds/NNN/arrivals/time, part, cycle, height   of parts that came with a refill
    /seeds/NNN/stops      (s,)                when the drives of the stages stopped; the others keep to the schedule
    /seeds/NNN/impacts/time, until, approach_speed, departure_velocity   of a part in a guide

Positions are those of centres of mass, quaternions (w first) attitudes of the axes that a part was drawn in; velocities
are in world axes. The file is written in HDF5's single-writer mode and flushed about twice a second: a killed run
leaves everything before that readable. Structure and data are under checksums.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from feeder_sim.errors import Divergence, FeederSimError, InputError, SimulationDiverged, path_of_user
from feeder_sim.hdf5 import check_trusted, get_text
from feeder_sim.records.files import check_no_links
from feeder_sim.records.recording import Recording, read_part, read_plate
from feeder_sim.records.seed import ARRIVALS, IMPACTS, REMOVALS, Columns, Counts, Seed, Status, events, read_failure
from feeder_sim.records.trajectory import FRAME_FIELDS, Frames
from feeder_sim.records.unclosed_file import read_hdf5

TRAJECTORY = "trajectory.h5"  # its name in a run folder
SCHEMA = "feeder_sim/trajectory"
SCHEMA_VERSION = 4
EVENTS: dict[str, Columns] = {"impacts": IMPACTS, "removals": REMOVALS, "arrivals": ARRIVALS}


def read_recording(path: str | Path) -> Recording:
    """Read a trajectory file, also one whose writer was killed.

    Raises:
        InputError: missing, truncated, not HDF5, not a trajectory, another schema version.
    """
    path = path_of_user(path, "read_recording")
    if not path.is_file():
        raise InputError("no such trajectory file", file=path)
    try:
        return read_hdf5(path, lambda file: _recording(path, file))
    except InputError:
        raise
    except Exception as error:  # of a file that is damaged, h5py raises what it likes
        raise InputError("not a readable trajectory file (truncated or of another format)", file=path) from error


def _recording(path: Path, file: Any) -> Recording:
    check_trusted(file, path)
    schema, version = get_text(file.attrs, "schema"), file.attrs.get("schema_version")
    if schema != SCHEMA:
        raise InputError(f"is {schema!r}, must be a trajectory ({SCHEMA!r})", file=path, key="schema")
    if version != SCHEMA_VERSION:
        message = f"is {version}, must be {SCHEMA_VERSION}: its scenario has to be run again"
        raise InputError(message, file=path, key="schema_version")
    groups = [file[f"seeds/{name}"] for name in sorted(file["seeds"], key=int)]
    return Recording(
        path=path,
        engine=str(get_text(file.attrs, "engine")),
        scenario_text=str(get_text(file.attrs, "scenario")),
        libraries=dict(json.loads(str(get_text(file.attrs, "libraries")))),
        inputs=dict(json.loads(str(get_text(file.attrs, "inputs")))),
        plate=read_plate(file),
        parts=tuple(read_part(name, file["parts"][name]) for name in sorted(file["parts"], key=_part_number)),
        records=tuple(_read_seed(group, index, path) for index, group in enumerate(groups)),
        wall_s=max((float(group["wall_time"][1]) for group in groups), default=0.0),
    )


def recording_of(run: Path) -> Recording:
    """Read the trajectory of a run folder, or a trajectory file itself.

    Raises:
        InputError: there is none, it cannot be read, or it is a link in a folder.
    """
    return read_recording(trajectory_of(run))


def trajectory_of(run: Path) -> Path:
    """The trajectory file of a run folder, or itself.

    Raises:
        InputError: there is none.
    """
    if run.suffix == ".h5" and run.is_file():
        return run
    check_no_links(run)
    trajectory = run / TRAJECTORY
    if not trajectory.is_file():
        raise InputError(f"no run here, must be a folder that holds {TRAJECTORY}", file=run)
    return trajectory


def read_seed(group: Any) -> Seed:
    """Read one seed; a writer killed between two datasets leaves some longer than others."""

    def columns(names: Iterable[str], under: str = "") -> dict[str, Any]:
        n = min(group[under + name].shape[0] for name in names)
        return {name: group[under + name][:n] for name in names}

    frames = {
        name: values if values.dtype == bool else values.astype(float) for name, values in columns(FRAME_FIELDS).items()
    }
    return Seed(
        Frames(**frames),
        **{kind: events(fields, **columns(fields, f"{kind}/")) for kind, fields in EVENTS.items()},
        stops=group["stops"][()],
        status=Status(int(group["status"][0])),
        wall_s=float(group["wall_time"][0]),
        counts=Counts(*(int(group[name][0]) for name in Counts._fields)),
    )


def _read_seed(group: Any, index: int, path: Path) -> Seed:
    """Read one seed; one that diverged with why, from the file of its last states if that is there."""
    seed = read_seed(group)
    if seed.status != Status.DIVERGED:
        return seed
    try:
        failure, last = read_failure(path.parent, index)
    except FeederSimError:
        reached = math.nan if seed.reached is None else seed.reached
        return replace(seed, failure=SimulationDiverged(Divergence.UNKNOWN, time_s=reached, part="a part", seed=index))
    return replace(seed, failure=failure, last=last)


def _part_number(name: str) -> int:
    return int(name.rpartition("_")[2])


def seed_name(index: int) -> str:
    """Name of the group of a seed."""
    return f"seeds/{index:03d}"
