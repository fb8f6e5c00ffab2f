"""Plate modes in HDF5, self-describing and checked on reading.

Layout, schema version 4 (SI units, named in the `unit` attribute of every dataset):

    /            schema, schema_version, creator, libraries, method, normalisation, sign_convention;
                 of imported modes also imported_from, shift (2,)   from the coordinates there to those here
    /plate       length, width, thickness, density, youngs_modulus, poisson_ratio   (attributes)
                 youngs_modulus_y, shear_modulus   (attributes; of an orthotropic plate)
    /modes       natural_frequency (n,)  coefficients (n, 3, terms, terms)  parity (n, 2)  modal_mass (n,)
                 damping_ratio (n,)   where it is known
    /resonances  mode (m,)  frequency (m,)  damping_ratio (m,)  gain (m,)  driven_point (m, 2)   measured; may be empty
                 driven_by (m, a)   1 for the actuators that were driven, else 0
    /actuators   name (attribute, one per line)  centre (a, 2)  size (a, 2)  angle (a,)  thickness (a,)  side (a,)
                 density (a,)  youngs_modulus (a,)  poisson_ratio (a,)  moment_per_volt (a,)  moment_spread (a,)
                 capacitance (a,)  loss_tangent (a,)  force_per_volt (n, a)
    /mesh        of modes on triangles of fourth degree, whose coefficients are empty:
                 point (k, 2)  triangle (t, 3)  node (p, 2)  field (n, 3, p)   w, beta_x, beta_y at the nodes
    /outline     point (k, 2)  ring (k,)   of a plate that is no rectangle: ring 0 is its outer edge, others are holes
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim import __version__
from feeder_sim.errors import InputError
from feeder_sim.hdf5 import FileKind, get_text, put_array, put_text, read_hdf5, write_hdf5
from feeder_sim.plate.actuators import Actuator
from feeder_sim.plate.elements.mesh_modes import MeshModes, quartic
from feeder_sim.plate.materials import Material
from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.outline import MOST_POINTS, Outline, checked_outline
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Layer

if TYPE_CHECKING:
    import h5py


# The group /actuators of a mode file; its layout stands in feeder_sim.plate.mode_file.

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
    "moment_spread": ("1", 0, 1.0, 1e3),
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
            "moment_spread": a.moment_spread,
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
    for name_of, (_, width, least, largest) in FIELDS.items():
        key, shape = f"actuators/{name_of}", (len(names), width) if width else (len(names),)
        values = np.asarray(file[key][()]) if key in file else np.empty(0)
        if values.dtype.kind != "f" or values.shape != shape:
            raise InputError(f"has shape {values.shape}, must be numbers of shape {shape}", file=path, key=key)
        if not ((values >= least) & (values <= largest)).all():
            raise InputError(f"holds a number outside {least:g} to {largest:g}", file=path, key=key)
        data[name_of] = values.tolist()
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
    return Actuator(name, layer, row["moment_per_volt"], row["moment_spread"], row["capacitance"], row["loss_tangent"])


# The group /outline of a mode file, and of the plate in a recording: points, and the polygon each belongs to.

SIZE_TOLERANCE = 1e-6  # relative, of the bounding box of an outline and its plate


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
        raise InputError("is unreadable, must be the datasets point and ring", file=path, key=name) from error
    if points.dtype.kind != "f" or points.shape != (len(rings), 2) or rings.dtype.kind not in "iu" or rings.ndim != 1:
        raise InputError(
            f"holds arrays of shapes {points.shape} and {rings.shape}, must be (n, 2) numbers and (n,) whole ones",
            file=path,
            key=name,
        )
    if not 3 <= len(points) <= MOST_POINTS or not (np.abs(points) <= 1e6).all():
        raise InputError(f"holds {len(points)} points, must be 3 to {MOST_POINTS} finite ones", file=path, key=name)
    steps = np.diff(rings)
    if rings[0] != 0 or ((steps != 0) & (steps != 1)).any():
        raise InputError("numbers its polygons wrongly, must be 0, 0, ..., 1, 1, ...", file=path, key=f"{name}/ring")
    try:
        outline = checked_outline([points[rings == i] for i in range(int(rings[-1]) + 1)])
    except ValueError as error:
        raise InputError(str(error), file=path, key=name) from error
    half = 0.5 * np.array(size)
    off = np.abs(np.concatenate([outline.exterior.max(axis=0) - half, outline.exterior.min(axis=0) + half]))
    if off.max() > SIZE_TOLERANCE * max(size):
        raise InputError(
            f"reaches {1e3 * off.max():.3g} mm beyond the plate's length and width or falls short of them, must be "
            "what they bound",
            file=path,
            key=name,
        )
    return outline


MAKE = "make it with 'feeder-sim modes PLATE.toml --out FILE'"
MODE_FILE = FileKind("feeder_sim/plate_modes", 4, "mode file", MAKE)
RITZ = "Mindlin plate, Ritz with orthonormal Legendre products, shear factor 5/6"
ELEMENTS = "Mindlin plate, triangles of fourth degree, shear factor 5/6"
IMPORTED = "imported mode shapes at points, least squares in orthonormal Legendre products with a bending energy"


@dataclass(frozen=True)
class Resonance:
    """A measured resonance of a real plate, assigned to the computed mode nearest in frequency.

    Attributes:
        mode: 0-based mode index.
        frequency: measured [Hz].
        damping_ratio: measured [1]; NaN when unknown.
        gain: deflection amplitude at the driven point per drive voltage [m / V peak to peak]; NaN when unknown.
        driven_point: (x, y) where the amplitude was measured [m].
        actuators: names of those that were driven; empty when unknown.
    """

    mode: int
    frequency: float
    damping_ratio: float
    gain: float
    driven_point: tuple[float, float]
    actuators: tuple[str, ...] = ()


@dataclass(frozen=True)
class Origin:
    """Where imported modes come from: the name of the file, and the shift (x, y) [m] from its coordinates."""

    imported_from: str
    shift: tuple[float, float]


@dataclass(frozen=True)
class ModeFile:
    """What a mode file contains.

    Attributes:
        modes: of the plate.
        resonances: measured on it.
        actuators: bonded to it.
        force_per_volt: modal force of every actuator over its voltage [N/V], shape (n_modes, n_actuators).
        origin: where modes were imported from; None for computed ones.
        damping_ratio: of every mode, as far as nothing was measured, shape (n_modes,); None where it is unknown.
    """

    modes: PlateModes
    resonances: tuple[Resonance, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    force_per_volt: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    origin: Origin | None = None
    damping_ratio: NDArray[np.float64] | None = None


def write_mode_file(path: Path, mode_file: ModeFile) -> None:
    """Write a mode file; an existing one is replaced only when the new one is complete.

    Raises:
        RecordingFailed: it cannot be written, as when the disk is full.
        InputError: the system does not accept the file name.
    """
    write_hdf5(path, MODE_FILE, lambda file: _write(file, mode_file))


def _write(file: Any, mode_file: ModeFile) -> None:
    import h5py

    modes, resonances, origin = mode_file.modes, mode_file.resonances, mode_file.origin
    plate, material = modes.plate, modes.plate.material
    attributes = {
        "creator": f"feeder_sim {__version__}",
        "libraries": f"numpy {np.__version__}, h5py {h5py.__version__}",
        "method": IMPORTED if origin else ELEMENTS if isinstance(modes, MeshModes) else RITZ,
        "normalisation": "max |w| = 1 over the plate",
        "sign_convention": "w > 0 at or next to (+length/2, +width/2); the top moves by (-h/2 bx, -h/2 by, w) q",
    }
    put_text(file.attrs, attributes)
    if origin is not None:
        put_text(file.attrs, {"imported_from": origin.imported_from})
        file.attrs["shift"] = origin.shift
    if modes.outline is not None:
        write_outline(file, "outline", modes.outline)
    group = file.create_group("plate")
    group.attrs.update(
        length=plate.length,
        width=plate.width,
        thickness=plate.thickness,
        density=material.density,
        youngs_modulus=material.youngs_modulus,
        poisson_ratio=material.poisson_ratio,
    )
    if material.youngs_modulus_y is not None and material.shear_modulus is not None:
        group.attrs.update(youngs_modulus_y=material.youngs_modulus_y, shear_modulus=material.shear_modulus)
    put_text(group.attrs, {"unit": "SI: m, kg/m^3, Pa"})
    put_array(file, "modes/natural_frequency", modes.natural_frequency, "Hz")
    put_array(file, "modes/coefficients", modes.coefficients, "1, 1/m, 1/m")
    put_array(file, "modes/parity", modes.parity, "1")
    put_array(file, "modes/modal_mass", modes.modal_mass, "kg")
    if isinstance(modes, MeshModes):
        mesh = {"point": modes.points, "triangle": modes.triangles, "node": modes.nodes, "field": modes.fields}
        for name, values in mesh.items():
            put_array(file, f"mesh/{name}", values, {"field": "1, 1/m, 1/m", "triangle": "1"}.get(name, "m"))
    if mode_file.damping_ratio is not None:
        put_array(file, DAMPING, mode_file.damping_ratio, "1")
    put_array(file, "resonances/mode", np.array([r.mode for r in resonances], np.int64), "0-based index")
    put_array(file, "resonances/frequency", np.array([r.frequency for r in resonances], float), "Hz")
    put_array(file, "resonances/damping_ratio", np.array([r.damping_ratio for r in resonances], float), "1")
    put_array(file, "resonances/gain", np.array([r.gain for r in resonances], float), "m/V peak to peak")
    points = np.array([r.driven_point for r in resonances], float).reshape(-1, 2)
    put_array(file, "resonances/driven_point", points, "m")
    names = [actuator.name for actuator in mode_file.actuators]
    driven = np.array([[name in r.actuators for name in names] for r in resonances], np.int64)
    put_array(file, "resonances/driven_by", driven.reshape(len(resonances), len(names)), "1")
    write_actuators(file, mode_file.actuators, mode_file.force_per_volt.reshape(len(modes), len(names)))


def read_mode_file(path: Path) -> ModeFile:
    """Read and check a mode file.

    Raises:
        InputError: missing, truncated, not HDF5, not a mode file, another schema version, or inconsistent content.
    """
    if not path.is_file():
        raise InputError(f"no such mode file; {MAKE}", file=path)
    return read_hdf5(path, MODE_FILE, lambda file: _checked(file, path))


def _checked(file: h5py.File, path: Path) -> ModeFile:
    """Read everything and check that the arrays fit each other.

    Raises:
        InputError: inconsistent content.
    """
    values = {name: _number(file, name, path) for name in _PLATE_KEYS}
    orthotropic = {name: _number(file, name, path) for name in _ORTHOTROPIC_KEYS if name in file["plate"].attrs}
    material = Material(values["density"], values["youngs_modulus"], values["poisson_ratio"], **orthotropic)
    plate = RectangularPlate(values["length"], values["width"], values["thickness"], material)
    on_mesh = "mesh" in file
    needed = {name: name != DAMPING and (on_mesh or not name.startswith("mesh/")) for name in _DATASETS}
    data = {name: _array(file, name, path) for name in _DATASETS if needed[name] or name in file}
    actuators, force = read_actuators(file, path)
    n, m = len(data["modes/natural_frequency"]), len(data["resonances/mode"])
    coefficients = data["modes/coefficients"]
    terms = coefficients.shape[-1]
    shapes = {
        "modes/coefficients": (n, 3, terms, terms),
        "modes/parity": (n, 2),
        "modes/modal_mass": (n,),
        "resonances/driven_point": (m, 2),
        "resonances/driven_by": (m, len(actuators)),
        **{f"resonances/{name}": (m,) for name in ("frequency", "damping_ratio", "gain")},
    }
    if DAMPING in data:
        shapes[DAMPING] = (n,)
    if on_mesh:
        nodes = len(data["mesh/node"])
        shapes |= {"mesh/field": (n, 3, nodes), "mesh/node": (nodes, 2), "modes/coefficients": (n, 3, 0, 0)}
        shapes |= {"mesh/point": (len(data["mesh/point"]), 2), "mesh/triangle": (len(data["mesh/triangle"]), 3)}
    for name, shape in shapes.items():
        if data[name].shape != shape:
            raise InputError(f"has shape {data[name].shape}, must be {shape}", file=path, key=name)
    frequency = data["modes/natural_frequency"]
    if n == 0 or (np.diff(frequency) < -1e-3 * frequency[:-1]).any():
        raise InputError("must hold modes in ascending order", file=path, key="modes/natural_frequency")
    field_key = "mesh/field" if on_mesh else "modes/coefficients"
    if not np.abs(data[field_key][:, 0]).reshape(n, -1).max(axis=1, initial=0.0).all():
        raise InputError("holds a mode without deflection", file=path, key=field_key)
    if len(np.unique(data["resonances/mode"])) < m:
        raise InputError("names a mode twice, must be one resonance of each mode", file=path, key="resonances/mode")
    if (data["resonances/mode"] >= n).any():
        raise InputError(f"names a mode that is not there, must be below {n}", file=path, key="resonances/mode")
    outline = read_outline(file, "outline", (plate.length, plate.width), path)
    parity = data["modes/parity"].astype(np.int64)
    mass = data["modes/modal_mass"]
    modes = PlateModes(plate, frequency, coefficients, parity, mass, outline=outline)
    if on_mesh:
        triangles = _checked_triangles(data, path)
        modes = MeshModes(
            plate=plate,
            natural_frequency=frequency,
            coefficients=coefficients,
            parity=parity,
            modal_mass=mass,
            outline=outline,
            points=data["mesh/point"],
            triangles=triangles,
            nodes=data["mesh/node"],
            fields=data["mesh/field"],
        )
    columns = [
        data[f"resonances/{name}"].tolist() for name in ("mode", "frequency", "damping_ratio", "gain", "driven_point")
    ]
    columns.append(
        [tuple(a.name for a, d in zip(actuators, row, strict=True) if d) for row in data["resonances/driven_by"]]
    )
    rows = zip(*columns, strict=True)
    resonances = tuple(Resonance(mode, f, z, g, (p[0], p[1]), names) for mode, f, z, g, p, names in rows)
    if force.shape != (n, len(actuators)):
        raise InputError(
            f"has shape {force.shape}, must be {(n, len(actuators))}", file=path, key="actuators/force_per_volt"
        )
    return ModeFile(modes, resonances, actuators, force, _origin(file, path), data.get(DAMPING))


def _checked_triangles(data: dict[str, NDArray[Any]], path: Path) -> NDArray[np.int64]:
    """The triangles of a mesh.

    Raises:
        InputError: one names no point or has no area, or nodes are not those of fourth degree.
    """
    points, triangles = data["mesh/point"], data["mesh/triangle"].astype(np.int64)
    if not len(triangles) or triangles.max() >= len(points):
        raise InputError(f"names a point that is not there, must be below {len(points)}", file=path, key="mesh")
    a, b, c = (points[triangles[:, k]] for k in range(3))
    if not ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) > (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])).all():
        raise InputError("has a triangle without area, or clockwise", file=path, key="mesh/triangle")
    if len(data["mesh/node"]) != quartic(points, triangles).N:
        raise InputError("has another number than elements of fourth degree", file=path, key="mesh/node")
    return triangles


def _origin(file: h5py.File, path: Path) -> Origin | None:
    """Where modes were imported from; None for computed ones."""
    name, shift = get_text(file.attrs, "imported_from"), file.attrs.get("shift")
    if name is None and shift is None:
        return None
    if name is None or np.shape(shift) != (2,) or not (np.abs(np.asarray(shift, float)) <= 1e6).all():
        raise InputError("is damaged, must be a name, with a shift of two numbers", file=path, key="imported_from")
    return Origin(name, (float(shift[0]), float(shift[1])))


_PLATE_KEYS = ("length", "width", "thickness", "density", "youngs_modulus", "poisson_ratio")
DAMPING = "modes/damping_ratio"
_ORTHOTROPIC_KEYS = ("youngs_modulus_y", "shear_modulus")
# name: (kinds of NumPy dtype, number of dimensions, least, largest, whether NaN may stand for "unknown")
_DATASETS: dict[str, tuple[str, int, float, float, bool]] = {
    "modes/natural_frequency": ("f", 1, 1e-9, 1e12, False),
    "modes/coefficients": ("f", 4, -1e12, 1e12, False),
    "modes/parity": ("iu", 2, -1, 1, False),
    "modes/modal_mass": ("f", 1, 1e-15, 1e9, True),
    DAMPING: ("f", 1, 1e-9, 1.0, False),
    "mesh/point": ("f", 2, -1e3, 1e3, False),
    "mesh/triangle": ("iu", 2, 0, 1e9, False),
    "mesh/node": ("f", 2, -1e3, 1e3, False),
    "mesh/field": ("f", 3, -1e12, 1e12, False),
    "resonances/mode": ("iu", 1, 0, 1e9, False),
    "resonances/frequency": ("f", 1, 1e-9, 1e12, False),
    "resonances/damping_ratio": ("f", 1, 1e-9, 1.0, True),
    "resonances/gain": ("f", 1, 0.0, 1.0, True),
    "resonances/driven_point": ("f", 2, -1e3, 1e3, False),
    "resonances/driven_by": ("iu", 2, 0, 1, False),
}


def _number(file: h5py.File, name: str, path: Path) -> float:
    """Read an attribute of /plate; refuse it unless it is a finite number above 0 (Poisson's ratio: 0 to 0.5)."""
    value: Any = file["plate"].attrs.get(name) if "plate" in file else None
    largest = 0.5 if name == "poisson_ratio" else 1e15
    if not isinstance(value, float | int | np.number) or not 0.0 <= float(value) <= largest:
        raise InputError(f"is {value!r}, must be a number up to {largest:g}", file=path, key=f"plate.{name}")
    if value == 0.0 and name != "poisson_ratio":
        raise InputError("is 0, must be a number above 0", file=path, key=f"plate.{name}")
    return float(value)


def _array(file: h5py.File, name: str, path: Path) -> NDArray[Any]:
    """Read a dataset; refuse it unless its kind, dimensions and range are those of `_DATASETS`."""
    kinds, dimensions, least, largest, nan_allowed = _DATASETS[name]
    try:
        values = np.asarray(file[name][()])
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError("is missing or unreadable, every mode file has it", file=path, key=name) from error
    if values.dtype.kind not in kinds or values.ndim != dimensions:
        allowed = f"{dimensions}-dimensional array of {'whole ' if 'i' in kinds else ''}numbers"
        raise InputError(f"is a {values.ndim}-dimensional {values.dtype}, must be a {allowed}", file=path, key=name)
    valid = (values >= least) & (values <= largest)
    if not (valid | np.isnan(values) if nan_allowed else valid).all():
        raise InputError(f"holds a number outside {least:g} to {largest:g}", file=path, key=name)
    return values
