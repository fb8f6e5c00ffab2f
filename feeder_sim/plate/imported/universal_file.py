"""Mode shapes from a universal file (.unv, .uff) of a modal analysis or a finite element program, read by pyuff.

Datasets: 164 units; 15 or 2411 nodes; 55 data at nodes, one per mode (normal or complex modes). The plate lies in a
plane of constant z. Its deflection is the displacement along z. Rotations are those of a rotation vector, for a thin
plate theta_x = dw/dy, theta_y = -dw/dx, so that beta = (-theta_y, theta_x).

Units of dataset 164 are factors by which values of the file are divided to be in SI; a modal mass is then in
force / (length / s^2).
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.imported.measured_shapes import (
    MOST_MODES,
    MOST_POINTS,
    MeasuredShapes,
    real_mode,
)

NODES, SHAPES, UNITS = (15, 2411), 55, 164
NORMAL_MODE, COMPLEX_MODES = 2, (3, 7)  # analysis types of dataset 55
LENGTHS = {"m": 1.0, "mm": 1e3, "cm": 1e2, "in": 1.0 / 0.0254}  # of the file in a metre
UNIT_TOLERANCE = 1e-3  # relative
FLAT = 0.01  # of the size of the plate; how far nodes may lie off their plane, or by the thickness


def read_universal_file(path: Path, unit: str | None, thickness: float) -> MeasuredShapes:
    """Read the modes in a universal file.

    Args:
        path: of the file.
        unit: of its lengths, one of `LENGTHS`, or None if the file says it.
        thickness: of the plate [m].

    Raises:
        InputError: pyuff is not there, a dataset is missing or cannot be used, units are mixed or unknown, nodes do not
            join.
    """
    datasets = _datasets(path)
    length, force = _units([d for d in datasets if d["type"] == UNITS], unit, path)
    nodes = _nodes([d for d in datasets if d["type"] in NODES], path)
    shapes = [d for d in datasets if d["type"] == SHAPES and d.get("analysis_type") in (NORMAL_MODE, *COMPLEX_MODES)]
    if not shapes:
        raise InputError("has no dataset 55 with a mode, must be one for each mode", file=path)
    if len(shapes) > MOST_MODES:
        raise InputError(f"has {len(shapes)} modes, must be up to {MOST_MODES}", file=path)
    numbers = np.asarray(shapes[0]["node_nums"]).astype(np.int64)
    points = _joined(numbers, nodes, thickness * length, path) / length
    read = [_mode(shape, i, numbers, length, path) for i, shape in enumerate(shapes)]
    frequency, damping, deflection, rotation, collinearity = (list(column) for column in zip(*read, strict=True))
    mass = [_number_or_nan(shape.get("modal_m")) * length / force for shape in shapes]
    masses = np.array(mass)  # of a deflection in metres, as the shape is taken
    return MeasuredShapes(
        points,
        np.array(frequency),
        np.array(deflection),
        np.array(rotation),
        np.array(damping),
        masses,
        np.array(collinearity),
    ).in_order()


def _datasets(path: Path) -> list[dict[str, Any]]:
    """The datasets that are needed, as pyuff has them."""
    try:
        import pyuff
    except ImportError as error:
        raise InputError(
            "is a universal file, which needs the library pyuff: pip install 'feeder_sim[unv]'", file=path
        ) from error
    silent = io.StringIO()
    try:
        with contextlib.redirect_stdout(silent):
            file = pyuff.UFF(str(path))
            kinds = [int(kind) for kind in file.get_set_types()]
            selected = [i for i, kind in enumerate(kinds) if kind in (*NODES, SHAPES, UNITS)]
            if not selected:
                raise InputError("has no dataset 15, 2411 or 55, must be a universal file with modes", file=path)
            read = file.read_sets(selected)
    except InputError:
        raise
    except Exception as error:  # pyuff raises bare exceptions
        raise InputError(f"cannot be read as a universal file: {error}", file=path) from error
    return [read] if isinstance(read, dict) else list(read)


def _units(datasets: Sequence[dict[str, Any]], unit: str | None, path: Path) -> tuple[float, float]:
    """Units of length in a metre, and of force in a newton."""
    factors = {(float(d["length"]), float(d["force"])) for d in datasets}
    if any(not (math.isfinite(f) and f > 0.0) for pair in factors for f in pair):
        raise InputError("dataset 164 holds a factor that is not above 0", file=path)
    lengths = sorted(length for length, _ in factors)
    if lengths and lengths[-1] / lengths[0] > 1.0 + UNIT_TOLERANCE:
        text = " and ".join(f"{length:g}" for length in lengths)
        raise InputError(f"mixes units: its datasets 164 have {text} lengths in a metre, must be one", file=path)
    if unit is None and not factors:
        raise InputError(
            f"does not say its units (dataset 164), allowed with it is --unit {', '.join(LENGTHS)}", file=path
        )
    if unit is not None and factors and abs(LENGTHS[unit] / lengths[0] - 1.0) > UNIT_TOLERANCE:
        raise InputError(
            f"is {unit}, but dataset 164 has {lengths[0]:g} lengths in a metre; must be one of both",
            file=path,
            key="--unit",
        )
    return (LENGTHS[str(unit)], 1.0) if not factors else next(iter(factors))


def _nodes(datasets: Sequence[dict[str, Any]], path: Path) -> dict[int, tuple[float, float, float]]:
    """Coordinates of every node, by its number."""
    nodes: dict[int, tuple[float, float, float]] = {}
    systems: set[int] = set()
    for dataset in datasets:
        columns = [np.asarray(dataset[name], float) for name in ("node_nums", "x", "y", "z")]
        if len({len(column) for column in columns}) > 1:
            raise InputError(f"dataset {dataset['type']} is broken: it ends within a node", file=path)
        systems |= {int(system) for system in dataset.get("disp_cs", ())}
        for number, *place in zip(*(column.tolist() for column in columns), strict=True):
            if not all(math.isfinite(c) for c in place):
                raise InputError(f"node {number:.0f} has a coordinate that is no number", file=path)
            if nodes.setdefault(int(number), tuple(place)) != tuple(place):
                raise InputError(f"node {number:.0f} stands twice, at different places", file=path)
    if not nodes:
        raise InputError("has no nodes (dataset 15 or 2411), must be one of both", file=path)
    if len(systems) > 1:
        raise InputError(
            f"has displacements in {len(systems)} coordinate systems, must be the same for all nodes", file=path
        )
    return nodes


def _joined(
    numbers: NDArray[np.int64], nodes: dict[int, tuple[float, float, float]], thickness: float, path: Path
) -> NDArray[np.float64]:
    """Places (n, 2) of the nodes of a mode, in units of the file, as is the thickness of the plate."""
    missing = [number for number in numbers.tolist() if number not in nodes]
    if missing:
        raise InputError(
            f"node {missing[0]} of dataset 55 is in no dataset 15 or 2411 (and {len(missing) - 1} more), must be "
            "nodes that are",
            file=path,
        )
    if not 3 <= len(numbers) <= MOST_POINTS:
        raise InputError(f"has modes at {len(numbers)} nodes, must be 3 to {MOST_POINTS}", file=path)
    if len(np.unique(numbers)) < len(numbers):
        raise InputError("has a mode with a node twice, must be once", file=path)
    places = np.array([nodes[number] for number in numbers.tolist()])
    size, height = float(np.ptp(places[:, :2], axis=0).max()), float(np.ptp(places[:, 2]))
    if height > max(FLAT * size, (1.0 + FLAT) * thickness):
        raise InputError(
            f"has nodes over a height of {height:g} along z (in its own unit), must be a plate in a plane x, y",
            file=path,
        )
    return places[:, :2]


def _mode(
    shape: dict[str, Any], index: int, numbers: NDArray[np.int64], length: float, path: Path
) -> tuple[float, float, NDArray[np.float64], NDArray[np.float64], float]:
    """Frequency, damping ratio, deflection (n,), rotations (2, n) and collinearity of one dataset 55."""
    name = f"mode {index + 1} (dataset 55)"
    if shape.get("n_data_per_node") not in (3, 6):
        raise InputError(
            f"{name} has {shape.get('n_data_per_node')} values per node, must be 3 (x, y, z) or 6 (and rotations)",
            file=path,
        )
    node_numbers = np.asarray(shape["node_nums"]).astype(np.int64)
    if len(node_numbers) != len(numbers) or (np.sort(node_numbers) != np.sort(numbers)).any():
        raise InputError(f"{name} has other nodes than the first mode, must be the same", file=path)
    order = np.argsort(node_numbers)[np.argsort(np.argsort(numbers))]
    columns = [np.asarray(shape[f"r{i}"]) for i in range(1, 7) if f"r{i}" in shape]
    if any(len(column) != len(numbers) for column in columns) or not all(np.isfinite(c).all() for c in columns):
        raise InputError(f"{name} has a value that is missing or no number, must be numbers", file=path)
    frequency, damping = _frequency(shape, name, path)
    w, turn, collinearity = real_mode(columns[2][order].astype(complex))
    if not np.abs(w).max() > 0.0:
        raise InputError(f"{name} does not move along z, must be a bending mode of a plate in x, y", file=path)
    rotation = np.full((2, len(numbers)), np.nan)
    if len(columns) == 6 and (np.abs(columns[3]).max() > 0.0 or np.abs(columns[4]).max() > 0.0):
        theta_x, theta_y = ((column[order] * turn).real for column in columns[3:5])
        rotation = np.stack([-theta_y, theta_x]) * length  # [rad] per unit of the file -> per metre
    return frequency, damping, w, rotation, collinearity


def _frequency(shape: dict[str, Any], name: str, path: Path) -> tuple[float, float]:
    """Natural frequency [Hz] and damping ratio, NaN where there is none."""
    if shape["analysis_type"] == NORMAL_MODE:
        frequency, damping = float(shape["freq"]), _number_or_nan(shape.get("modal_damp_vis"))
        if math.isnan(damping):
            damping = 0.5 * _number_or_nan(shape.get("modal_damp_his"))
    else:
        root = complex(shape["eig"])
        frequency = abs(root) / (2.0 * math.pi)
        damping = _number_or_nan(-root.real / abs(root)) if root else math.nan
    if not 0.1 <= frequency <= 1e7:
        raise InputError(f"{name} has a frequency of {frequency:g} Hz, must be 0.1 to 1e7", file=path)
    if not (math.isnan(damping) or 1e-6 <= damping < 1.0):
        raise InputError(f"{name} has a damping ratio of {damping:g}, must be 1e-6 to 1, or 0 for none", file=path)
    return frequency, damping


def _number_or_nan(value: Any) -> float:
    """A number that a file gives, where 0 stands for none."""
    return float(value) if value is not None and float(value) != 0.0 else math.nan
