"""Frames of all seeds as one xarray Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.api.tables import kept_frames
from feeder_sim.notebook import library
from feeder_sim.records.trajectory import FRAME_FIELDS, SAME_TIME

if TYPE_CHECKING:
    import xarray

    from feeder_sim.api.result import Result

LONG_NAMES = {
    "position": "position of the centre of mass",
    "quaternion": "attitude of the axes that the part was drawn in",
    "velocity": "velocity of the centre of mass",
    "angular_velocity": "angular velocity in world axes",
}


def dataset_of(result: Result) -> xarray.Dataset:
    """See `Result.to_xarray`."""
    xarray = library("xarray")
    seeds = kept_frames(result)
    longest = max(seeds, key=len)
    shape = (len(seeds), len(longest), len(result.part_names))
    present = np.zeros(shape, bool)
    for index, frames in enumerate(seeds):
        if np.abs(frames.time - longest.time[: len(frames)]).max(initial=0.0) > SAME_TIME:
            raise ValueError("the seeds were not recorded at the same times")  # the engines keep to one clock
        present[index, : len(frames)] = frames.present
    variables: dict[str, Any] = {
        "present": (("seed", "time", "part"), present, {"long_name": "whether the part is in the scene"})
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
