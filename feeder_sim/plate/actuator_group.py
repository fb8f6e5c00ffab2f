"""The group /actuators of a mode file; its layout stands in feeder_sim.plate.mode_file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.hdf5_text import get_text, put_array, put_text
from feeder_sim.plate.actuators import Actuator
from feeder_sim.plate.materials import Material
from feeder_sim.plate.ritz.attachments import Layer

FORCE = "actuators/force_per_volt"
# name: (unit, numbers of each actuator, least, largest)
FIELDS = {
    "centre": ("m", 2, -1e3, 1e3),
    "size": ("m", 2, 1e-9, 1e3),
    "angle": ("rad", 0, -10.0, 10.0),
    "thickness": ("m", 0, 1e-9, 1e3),
    "side": ("1 above, -1 below the plate", 0, -1.0, 1.0),
    "density": ("kg/m^3", 0, 1e-3, 1e6),
    "youngs_modulus": ("Pa", 0, 1.0, 1e15),
    "poisson_ratio": ("1", 0, 0.0, 0.5),
    "moment_per_volt": ("N/V", 0, 0.0, 1e12),
    "shear_lag": ("m", 0, 0.0, 1e3),
    "capacitance": ("F", 0, 0.0, 1e3),
    "loss_tangent": ("1", 0, 0.0, 1.0),
}


def write_actuators(file: Any, actuators: Sequence[Actuator], force_per_volt: NDArray[np.float64]) -> None:
    """Write the actuators of a plate, and their modal forces [N/V], shape (n_modes, n_actuators)."""
    rows = [
        {
            "centre": a.layer.centre,
            "size": a.layer.size,
            "angle": a.layer.angle,
            "thickness": a.layer.thickness,
            "side": float(a.layer.side),
            "density": a.layer.material.density,
            "youngs_modulus": a.layer.material.youngs_modulus,
            "poisson_ratio": a.layer.material.poisson_ratio,
            "moment_per_volt": a.moment_per_volt,
            "shear_lag": a.shear_lag,
            "capacitance": a.capacitance,
            "loss_tangent": a.loss_tangent,
        }
        for a in actuators
    ]
    put_text(file.create_group("actuators").attrs, {"name": "\n".join(a.name for a in actuators)})
    for name, (unit, width, _, _) in FIELDS.items():
        shape = (len(rows), width) if width else (len(rows),)
        put_array(file, f"actuators/{name}", np.array([row[name] for row in rows], float).reshape(shape), unit)
    put_array(file, FORCE, force_per_volt, "N/V")


def read_actuators(file: Any, path: Path) -> tuple[tuple[Actuator, ...], NDArray[np.float64]]:
    """Read both back.

    Raises:
        InputError: something is missing, has another shape, or a number that is not allowed; `path` names the file.
    """
    text = get_text(file["actuators"].attrs, "name") if "actuators" in file else None
    if text is None:
        raise InputError("is missing, every mode file has it", file=path, key="actuators")
    names = text.split("\n") if text else []
    data = {}
    for field, (_, width, least, largest) in FIELDS.items():
        key, shape = f"actuators/{field}", (len(names), width) if width else (len(names),)
        values = np.asarray(file[key][()]) if key in file else np.empty(0)
        if values.dtype.kind != "f" or values.shape != shape:
            raise InputError(f"has shape {values.shape}, allowed are numbers of shape {shape}", file=path, key=key)
        if not ((values >= least) & (values <= largest)).all():
            raise InputError(f"holds a number outside {least:g} to {largest:g}", file=path, key=key)
        data[field] = values.tolist()
    rows = [dict(zip(data, row, strict=True)) for row in zip(*data.values(), strict=True)]
    force = np.asarray(file[FORCE][()]) if FORCE in file else np.empty(0)
    if force.dtype.kind != "f" or force.ndim != 2 or not np.isfinite(force).all():
        raise InputError("is missing or damaged, every mode file has it", file=path, key=FORCE)
    return tuple(_actuator(name, row) for name, row in zip(names, rows, strict=True)), force


def _actuator(name: str, row: dict[str, Any]) -> Actuator:
    layer = Layer(
        centre=tuple(row["centre"]),
        size=tuple(row["size"]),
        angle=row["angle"],
        thickness=row["thickness"],
        side=-1 if row["side"] < 0.0 else 1,
        material=Material(row["density"], row["youngs_modulus"], row["poisson_ratio"]),
    )
    return Actuator(name, layer, row["moment_per_volt"], row["shear_lag"], row["capacitance"], row["loss_tangent"])
