"""Results as tidy tables: pandas DataFrames with the units in the names of the columns."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from feeder_sim.errors import InputError, Unknown
from feeder_sim.measures.catalogue import values_of_seed
from feeder_sim.measures.picking import has_picks, picks_csv
from feeder_sim.notebook import library
from feeder_sim.records.seed import Cause
from feeder_sim.records.trajectory import FRAME_FIELDS, SAME_TIME

if TYPE_CHECKING:
    import pandas
    import xarray

    from feeder_sim.api.result import Result


# Frames of all seeds as one xarray Dataset.

LONG_NAMES = {
    "position": "position of the centre of mass",
    "quaternion": "attitude of the axes that the part was drawn in",
    "velocity": "velocity of the centre of mass",
    "angular_velocity": "angular velocity in world axes",
}


def dataset_of(result: Result) -> xarray.Dataset:
    """See `Result.to_xarray`."""
    xarray = library("xarray")
    seeds = saved_frames(result)
    longest = max(seeds, key=len)
    shape = (len(seeds), len(longest), len(result.part_names))
    in_scene = np.zeros(shape, bool)
    for index, frames in enumerate(seeds):
        if np.abs(frames.time - longest.time[: len(frames)]).max(initial=0.0) > SAME_TIME:
            raise ValueError("the seeds were not recorded at the same times")  # the engines keep to one clock
        in_scene[index, : len(frames)] = frames.present
    variables: dict[str, Any] = {
        "present": (("seed", "time", "part"), in_scene, {"long_name": "whether the part is in the scene"})
    }
    for name, long_name in LONG_NAMES.items():
        unit, _, (size,) = FRAME_FIELDS[name]
        values = np.full((*shape, size), np.nan)
        for index, frames in enumerate(seeds):
            values[index, : len(frames)] = np.where(frames.present[..., None], getattr(frames, name), np.nan)
        axis = "component" if name == "quaternion" else "axis"
        variables[name] = (("seed", "time", "part", axis), values, {"units": unit, "long_name": long_name})
    coordinates = {
        "seed": np.arange(len(seeds)),
        "time": ("time", longest.time, {"units": "s"}),
        "part": list(result.part_names),
        "axis": ["x", "y", "z"],
        "component": ["w", "x", "y", "z"],
        "kind": ("part", list(result.part_kinds)),
        "status": ("seed", [seed.status.name.lower() for seed in result.seeds]),
    }
    return xarray.Dataset(variables, coordinates, {"title": result.title})


Table = Literal["measures", "frames", "impacts", "picks", "removals"]
FRAME_COLUMNS = {
    "position": ("x_m", "y_m", "z_m"),
    "quaternion": ("qw", "qx", "qy", "qz"),
    "velocity": ("vx_m_s", "vy_m_s", "vz_m_s"),
    "angular_velocity": ("wx_rad_s", "wy_rad_s", "wz_rad_s"),
}


def saved_frames(result: Result) -> list[Any]:
    """The frames of every seed.

    Raises:
        InputError: none were kept.
    """
    if not any(len(seed.frames) for seed in result.seeds):
        problem = "were not kept, must be record=AllFrames() or EveryNth(n) in the call that made the result"
        raise InputError(problem, key="frames")
    return [seed.frames for seed in result.seeds]


def frame_of(result: Result, of: Table) -> pandas.DataFrame:
    """See `Result.to_frame`."""
    if of not in get_args(Table):
        raise Unknown(of, get_args(Table), key="of")
    pandas = library("pandas")
    makers = {"measures": _measures, "frames": _frames, "impacts": _impacts, "removals": _removals}
    if of == "picks":
        if not has_picks(result.scene):
            raise InputError("are of a schedule with a pick, must be another table", key="picks")
        return pandas.read_csv(io.StringIO(picks_csv(result.scene, result.seeds)), keep_default_na=False)
    return pandas.DataFrame(makers[of](result))


def _measures(result: Result) -> dict[str, Any]:
    rows = [
        (index, seed.status.name.lower(), measure, value)
        for index, seed in enumerate(result.seeds)
        for measure, value in values_of_seed(result.prepared, seed).items()
    ]
    columns = zip(*rows, strict=True) if rows else [()] * 4
    return dict(zip(("seed", "status", "measure", "value"), map(list, columns), strict=True))


def _frames(result: Result) -> dict[str, Any]:
    seeds, names, kinds = saved_frames(result), np.array(result.part_names), np.array(result.part_kinds)
    lengths, n_parts = [len(frames) for frames in seeds], len(names)
    columns: dict[str, Any] = {
        "seed": np.repeat(np.arange(len(seeds)), [n * n_parts for n in lengths]),
        "time_s": np.repeat(np.concatenate([frames.time for frames in seeds]), n_parts),
        "part": np.tile(names, sum(lengths)),
        "kind": np.tile(kinds, sum(lengths)),
        "present": np.concatenate([frames.present for frames in seeds]).ravel(),
    }
    for name, axes in FRAME_COLUMNS.items():
        values = np.concatenate([getattr(frames, name) for frames in seeds]).reshape(-1, len(axes))
        columns |= dict(zip(axes, values.T, strict=True))
    return columns


def _impacts(result: Result) -> dict[str, Any]:
    if any(seed.readings is not None for seed in result.seeds) and not any(len(seed.impacts) for seed in result.seeds):
        raise InputError("were not kept, must be another record in the call that made the result", key="impacts")
    impacts = [seed.impacts for seed in result.seeds]
    return {
        "seed": np.repeat(np.arange(len(impacts)), [len(entry) for entry in impacts]),
        "time_s": np.concatenate([entry.time for entry in impacts]),
        "until_s": np.concatenate([entry.until for entry in impacts]),
        "approach_speed_m_s": np.concatenate([entry.approach_speed for entry in impacts]),
        "departure_velocity_m_s": np.concatenate([entry.departure_velocity for entry in impacts]),
    }


def _removals(result: Result) -> dict[str, Any]:
    removals = [seed.removals for seed in result.seeds]
    names = [*(outlet.name for outlet in result.scene.outlets), ""]  # the last one, -1, for none
    part = np.concatenate([entry.part for entry in removals])
    return {
        "seed": np.repeat(np.arange(len(removals)), [len(entry) for entry in removals]),
        "time_s": np.concatenate([entry.time for entry in removals]),
        "part": np.array(result.part_names)[part],
        "kind": np.array(result.part_kinds)[part],
        "cause": [Cause(int(cause)).name.lower() for entry in removals for cause in entry.cause],
        "outlet": [names[number] for entry in removals for number in entry.outlet],
    }
