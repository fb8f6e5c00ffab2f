"""Plate modes in HDF5, self-describing and checked on reading.

Layout, schema version 1 (SI units, named in the `unit` attribute of every dataset):

    /            schema, schema_version, creator, method, normalisation, sign_convention
    /plate       length, width, thickness, density, youngs_modulus, poisson_ratio   (attributes)
    /modes       natural_frequency (n,)  coefficients (n, 3, terms, terms)  parity (n, 2)
    /resonances  mode (m,)  frequency (m,)  damping_ratio (m,)  gain (m,)  driven_point (m, 2)   measured; may be empty
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import InputError
from feeder_sim.materials import Material
from feeder_sim.plate.modes import PlateModes, RectangularPlate

if TYPE_CHECKING:
    import h5py

SCHEMA = "feeder_sim/plate_modes"
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Resonance:
    """A measured resonance of a real plate, tied to the computed mode nearest in frequency.

    Attributes:
        mode: 0-based mode index.
        frequency: measured [Hz].
        damping_ratio: measured; NaN when unknown.
        gain: deflection amplitude at the driven point per drive voltage [m / V peak to peak]; NaN when unknown.
        driven_point: where the amplitude was measured, shape (2,) [m].
    """

    mode: int
    frequency: float
    damping_ratio: float
    gain: float
    driven_point: tuple[float, float]


@dataclass(frozen=True)
class ModeFile:
    """Everything a mode file holds: the computed modes, and what was measured on the plate."""

    modes: PlateModes
    resonances: tuple[Resonance, ...] = ()


def write_mode_file(path: Path, modes: PlateModes, resonances: Sequence[Resonance] = ()) -> None:
    """Write modes and measured resonances; an existing file is replaced only when the new one is complete."""
    import h5py

    plate, material = modes.plate, modes.plate.material
    partial = path.with_name(path.name + ".partial")
    with h5py.File(partial, "w") as file:
        file.attrs.update(
            schema=SCHEMA,
            schema_version=SCHEMA_VERSION,
            creator=f"feeder_sim {__version__}",
            method="Mindlin plate, Ritz with orthonormal Legendre products, shear factor 5/6",
            normalisation="max |w| = 1 over the plate",
            sign_convention="w > 0 at (+length/2, +width/2); a top surface point moves by (-h/2 bx, -h/2 by, w) q",
        )
        group = file.create_group("plate")
        group.attrs.update(
            length=plate.length,
            width=plate.width,
            thickness=plate.thickness,
            density=material.density,
            youngs_modulus=material.youngs_modulus,
            poisson_ratio=material.poisson_ratio,
            unit="SI: m, kg/m^3, Pa",
        )
        _write(file, "modes/natural_frequency", modes.natural_frequency, "Hz")
        _write(file, "modes/coefficients", modes.coefficients, "1, 1/m, 1/m")
        _write(file, "modes/parity", modes.parity, "1")
        _write(file, "resonances/mode", np.array([r.mode for r in resonances], np.int64), "0-based index")
        _write(file, "resonances/frequency", np.array([r.frequency for r in resonances], float), "Hz")
        _write(file, "resonances/damping_ratio", np.array([r.damping_ratio for r in resonances], float), "1")
        _write(file, "resonances/gain", np.array([r.gain for r in resonances], float), "m/V peak to peak")
        points = np.array([r.driven_point for r in resonances], float).reshape(-1, 2)
        _write(file, "resonances/driven_point", points, "m")
    partial.replace(path)


def read_mode_file(path: Path) -> ModeFile:
    """Read and check a mode file.

    Raises:
        InputError: missing, truncated, not HDF5, not a mode file, another schema version, or inconsistent content.
    """
    import h5py

    if not path.is_file():
        raise InputError("no such mode file; make it with 'feeder-sim modes PLATE.toml --out FILE'", file=path)
    try:
        with h5py.File(path, "r") as file:
            return _checked(file, path)
    except (OSError, RuntimeError) as error:
        raise InputError("not a readable HDF5 file (truncated or of another format)", file=path) from error


def _checked(file: h5py.File, path: Path) -> ModeFile:
    found = file.attrs.get("schema")
    if found != SCHEMA:
        raise InputError(f"is {found!r}, allowed is a mode file ({SCHEMA!r})", file=path, key="schema")
    version = file.attrs.get("schema_version")
    if version != SCHEMA_VERSION:
        raise InputError(f"is {version!r}, allowed is {SCHEMA_VERSION}", file=path, key="schema_version")
    try:
        values: dict[str, Any] = {name: float(file["plate"].attrs[name]) for name in _PLATE_KEYS}
        modes = {name: file[f"modes/{name}"][()] for name in ("natural_frequency", "coefficients", "parity")}
        measured = {name: file[f"resonances/{name}"][()] for name in _RESONANCE_KEYS}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"a mode file of schema version 1 lacks this: {error}", file=path) from error
    material = Material(values["density"], values["youngs_modulus"], values["poisson_ratio"])
    plate = RectangularPlate(values["length"], values["width"], values["thickness"], material)
    result = PlateModes(plate, modes["natural_frequency"], modes["coefficients"], modes["parity"])
    _check_plate(values, path)
    _check_modes(result, path)
    n = len(measured["mode"])
    if any(len(measured[name]) != n for name in _RESONANCE_KEYS) or not _indices_valid(measured["mode"], len(result)):
        raise InputError("is inconsistent with the modes", file=path, key="resonances")
    rows = zip(*(measured[name] for name in _RESONANCE_KEYS), strict=True)
    return ModeFile(
        result,
        tuple(Resonance(int(m), float(f), float(z), float(g), (float(p[0]), float(p[1]))) for m, f, z, g, p in rows),
    )


_PLATE_KEYS = ("length", "width", "thickness", "density", "youngs_modulus", "poisson_ratio")
_RESONANCE_KEYS = ("mode", "frequency", "damping_ratio", "gain", "driven_point")


def _check_plate(values: dict[str, float], path: Path) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"is {value}, allowed is a number above 0", file=path, key=f"plate.{name}")


def _check_modes(modes: PlateModes, path: Path) -> None:
    n, f, c = len(modes.natural_frequency), modes.natural_frequency, modes.coefficients
    if f.ndim != 1 or n == 0 or not np.isfinite(f).all() or (f <= 0).any() or (np.diff(f) < -1e-3 * f[:-1]).any():
        raise InputError("must be positive, finite and ascending", file=path, key="modes/natural_frequency")
    if c.shape[:2] != (n, 3) or c.ndim != 4 or c.shape[2] != c.shape[3] or not np.isfinite(c).all():
        raise InputError(
            f"has shape {c.shape}, allowed is ({n}, 3, terms, terms), finite", file=path, key="modes/coefficients"
        )
    if modes.parity.shape != (n, 2):
        raise InputError(f"has shape {modes.parity.shape}, allowed is ({n}, 2)", file=path, key="modes/parity")


def _indices_valid(index: NDArray[np.int64], n: int) -> bool:
    return bool(((index >= 0) & (index < n)).all())


def _write(file: h5py.File, name: str, values: NDArray[Any], unit: str) -> None:
    compression = {"compression": "gzip", "shuffle": True} if values.size > 1000 else {}
    dataset = file.create_dataset(name, data=values, **compression)
    dataset.attrs["unit"] = unit
