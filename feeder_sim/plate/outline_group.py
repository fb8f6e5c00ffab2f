"""The group /outline of a mode file, and of the plate in a trajectory file: points, and the polygon each belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.hdf5_text import put_array
from feeder_sim.plate.outline import MOST_POINTS, Outline, checked_outline

SAME_SIZE = 1e-6  # relative, of the bounding box of an outline and its plate


def write_outline(file: Any, name: str, outline: Outline) -> None:
    """Write an outline as a group; polygon 0 is the outer edge, the others are holes."""
    numbers = [np.full(len(ring), i, np.int64) for i, ring in enumerate(outline.rings)]
    put_array(file, f"{name}/point", np.concatenate(outline.rings), "m")
    put_array(file, f"{name}/ring", np.concatenate(numbers), "0: outer edge, else a hole")


def read_outline(file: Any, name: str, size: tuple[float, float], path: Path) -> Outline | None:
    """Read and check it; None where there is none.

    Args:
        file: HDF5 file or group.
        name: of the group.
        size: length and width of its bounding box [m].
        path: of the file, for messages.

    Raises:
        InputError: it is damaged, is no simple polygon with holes in it, or does not fit the plate.
    """
    if name not in file:
        return None
    try:
        points, rings = np.asarray(file[name]["point"][()]), np.asarray(file[name]["ring"][()])
    except (KeyError, TypeError, AttributeError, ValueError, IndexError) as error:
        raise InputError("is unreadable, allowed are the datasets point and ring", file=path, key=name) from error
    if points.dtype.kind != "f" or points.shape != (len(rings), 2) or rings.dtype.kind not in "iu" or rings.ndim != 1:
        raise InputError(
            f"holds arrays of shapes {points.shape} and {rings.shape}, allowed are (n, 2) numbers and (n,) whole ones",
            file=path,
            key=name,
        )
    if not 3 <= len(points) <= MOST_POINTS or not (np.abs(points) <= 1e6).all():
        raise InputError(f"holds {len(points)} points, allowed are 3 to {MOST_POINTS} finite ones", file=path, key=name)
    steps = np.diff(rings)
    if rings[0] != 0 or ((steps != 0) & (steps != 1)).any():
        raise InputError("numbers its polygons wrongly, allowed is 0, 0, ..., 1, 1, ...", file=path, key=f"{name}/ring")
    try:
        outline = checked_outline([points[rings == i] for i in range(int(rings[-1]) + 1)])
    except ValueError as error:
        raise InputError(str(error), file=path, key=name) from error
    half = 0.5 * np.array(size)
    off = np.abs(np.concatenate([outline.exterior.max(axis=0) - half, outline.exterior.min(axis=0) + half]))
    if off.max() > SAME_SIZE * max(size):
        raise InputError(
            f"reaches {1e3 * off.max():.3g} mm beyond the plate's length and width or falls short of them, allowed is "
            "what they bound",
            file=path,
            key=name,
        )
    return outline
