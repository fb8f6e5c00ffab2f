"""A drift map in a file (NumPy's .npz): the tables, what they were made of, and the version of the format."""

from __future__ import annotations

import io
import json
import math
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from feeder_sim.errors import InputError, cause_of
from feeder_sim.plate.materials import Material
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.scenario import Scenario, resolve_material
from feeder_sim.studies.drift_map.drift_map import DriftMap, MapInputs
from feeder_sim.studies.drift_map.making import made_of, strip_of
from feeder_sim.whole_files import write_whole

FORMAT, VERSION = "feeder_sim drift map", 2
TABLES = ("frequency", "speed", "drift", "drift_se", "along", "across")
COST = ("simulated_s", "processor_s")


def save_map(drift_map: DriftMap, path: Path) -> None:
    """Write a map, in place of a file before it.

    Raises:
        RecordingFailed: it cannot be written.
    """
    about = {
        "format": FORMAT,
        "version": VERSION,
        "made": asdict(drift_map.made),
        "plate": asdict(drift_map.plate),
        "cost": {name: getattr(drift_map, name) for name in COST},
    }
    file = io.BytesIO()
    np.savez_compressed(file, about=np.array(json.dumps(about)), **{name: getattr(drift_map, name) for name in TABLES})
    write_whole(path, file.getvalue())


def load_map(path: Path, scenario: Scenario | None = None, thickness: float | None = None) -> DriftMap:
    """Read a map.

    Args:
        path: of the file.
        scenario: whose part and contact the map has to be of; None takes any.
        thickness: of its plate [m], which the map has to be of.

    Raises:
        InputError: no such file, no map, one of another version, or of something else than the scenario has.
    """
    try:
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            tables = [np.asarray(file[name], float) for name in TABLES]
        if about["format"] != FORMAT:
            raise ValueError
        if about["version"] != VERSION:
            problem = f"is of version {about['version']}, must be {VERSION}: make it again"
            raise InputError(problem, file=path)
        inputs = MapInputs(**about["made"])
        plate = RectangularPlate(**about["plate"] | {"material": Material(**about["plate"]["material"])})
        cost = {name: float(about["cost"][name]) for name in COST}
        attributes: dict[str, Any] = dict(zip(TABLES, tables, strict=True)) | cost
        drift_map = DriftMap(inputs, plate, **attributes)
        shape = (len(drift_map.frequency), len(drift_map.speed), drift_map.drift.shape[-1])
        if any(table.shape != shape or not np.isfinite(table).all() for table in tables[2:]):
            raise ValueError
    except OSError as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=path) from error
    except (ValueError, KeyError, TypeError, IndexError, EOFError, zipfile.BadZipFile) as error:
        raise InputError("is no drift map, must be a file that one was saved to", file=path) from error
    if scenario is not None:
        check_made(drift_map, scenario, drift_map.made.thickness if thickness is None else thickness, path)
    return drift_map


def check_made(drift_map: DriftMap, scenario: Scenario, thickness: float, path: Path | None = None) -> None:
    """Refuse a map of something else than a scenario has.

    Raises:
        InputError: its part, its contact, its engine or step, the material or thickness [m] of its plate differ.
    """
    requested, inputs = made_of(scenario, thickness), drift_map.made
    for name, what in (("part", "part"), ("contact", "contact"), ("method", "engine or step")):
        if getattr(requested, name) != getattr(inputs, name):
            raise InputError(f"is of another {what}, must be a drift map of that of the scenario", file=path)
    material, of_map = resolve_material(strip_of(scenario).material), drift_map.plate.material
    for constant in asdict(of_map):
        if not _is_close(getattr(material, constant), getattr(of_map, constant)):
            raise InputError("is of a plate of another material, must be that of the scenario", file=path)
    if abs(requested.thickness / inputs.thickness - 1.0) > 1e-6:
        raise InputError(
            f"is of a plate of {1e3 * inputs.thickness:g} mm, must be {1e3 * thickness:g} mm, that of the scenario",
            file=path,
        )


def _is_close(one: float | None, other: float | None) -> bool:
    """Whether two constants are the same, but for rounding; None is that of an isotropic material."""
    return one == other or (one is not None and other is not None and math.isclose(one, other, rel_tol=1e-6))
