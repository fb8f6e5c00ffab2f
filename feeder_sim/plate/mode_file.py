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

import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

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


class Field(NamedTuple):
    """A dataset of a mode file.

    Attributes:
        unit: of its numbers.
        axes: size of every axis, a number or a letter that stands for the same one everywhere: n modes, m resonances,
            a actuators, q terms, k points, t triangles, p nodes.
        least, largest: of its numbers.
        kinds: of its numbers, as NumPy calls them.
        unknown: whether NaN may stand for what is not known.
    """

    unit: str
    axes: str
    least: float
    largest: float
    kinds: str = "f"
    unknown: bool = False


WHOLE = "iu"
DAMPING, FORCE = "modes/damping_ratio", "actuators/force_per_volt"
FIELDS = {
    "modes/natural_frequency": Field("Hz", "n", 1e-9, 1e12),
    "modes/coefficients": Field("1, 1/m, 1/m", "n 3 q q", -1e12, 1e12),
    "modes/parity": Field("1", "n 2", -1, 1, WHOLE),
    "modes/modal_mass": Field("kg", "n", 1e-15, 1e9, unknown=True),
    DAMPING: Field("1", "n", 1e-9, 1.0),
    "mesh/point": Field("m", "k 2", -1e3, 1e3),
    "mesh/triangle": Field("1", "t 3", 0, 1e9, WHOLE),
    "mesh/node": Field("m", "p 2", -1e3, 1e3),
    "mesh/field": Field("1, 1/m, 1/m", "n 3 p", -1e12, 1e12),
    "resonances/mode": Field("0-based index", "m", 0, 1e9, WHOLE),
    "resonances/frequency": Field("Hz", "m", 1e-9, 1e12),
    "resonances/damping_ratio": Field("1", "m", 1e-9, 1.0, unknown=True),
    "resonances/gain": Field("m/V peak to peak", "m", 0.0, 1.0, unknown=True),
    "resonances/driven_point": Field("m", "m 2", -1e3, 1e3),
    "resonances/driven_by": Field("1", "m a", 0, 1, WHOLE),
    "actuators/centre": Field("m", "a 2", -1e3, 1e3),
    "actuators/size": Field("m", "a 2", 1e-9, 1e3),
    "actuators/angle": Field("rad", "a", -10.0, 10.0),
    "actuators/thickness": Field("m", "a", 1e-9, 1e3),
    "actuators/side": Field("1 above, -1 below the plate", "a", -1.0, 1.0),
    "actuators/density": Field("kg/m^3", "a", 1e-3, 1e6),
    "actuators/youngs_modulus": Field("Pa", "a", 1.0, 1e15),
    "actuators/poisson_ratio": Field("1", "a", 0.0, 0.5),
    "actuators/moment_per_volt": Field("N/V", "a", 0.0, 1e12),
    "actuators/moment_spread": Field("1", "a", 1.0, 1e3),
    "actuators/capacitance": Field("F", "a", 0.0, 1e3),
    "actuators/loss_tangent": Field("1", "a", 0.0, 1.0),
    FORCE: Field("N/V", "n a", -1e300, 1e300),
}
ACTUATOR_KEYS = [name.removeprefix("actuators/") for name in FIELDS if name.startswith("actuators/") and name != FORCE]
_PLATE_KEYS = ("length", "width", "thickness", "density", "youngs_modulus", "poisson_ratio")
_ORTHOTROPIC_KEYS = ("youngs_modulus_y", "shear_modulus")


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
    values: dict[str, Any] = {
        "modes/natural_frequency": modes.natural_frequency,
        "modes/coefficients": modes.coefficients,
        "modes/parity": modes.parity,
        "modes/modal_mass": modes.modal_mass,
    }
    if isinstance(modes, MeshModes):
        values |= {"mesh/point": modes.points, "mesh/triangle": modes.triangles}
        values |= {"mesh/node": modes.nodes, "mesh/field": modes.fields}
    if mode_file.damping_ratio is not None:
        values[DAMPING] = mode_file.damping_ratio
    names = [actuator.name for actuator in mode_file.actuators]
    for key in ("mode", "frequency", "damping_ratio", "gain", "driven_point"):
        values[f"resonances/{key}"] = [getattr(resonance, key) for resonance in resonances]
    values["resonances/driven_by"] = [[name in resonance.actuators for name in names] for resonance in resonances]
    for key in ACTUATOR_KEYS:
        values[f"actuators/{key}"] = [_value_of(actuator, key) for actuator in mode_file.actuators]
    values[FORCE] = mode_file.force_per_volt
    put_text(file.create_group("actuators").attrs, {"name": "\n".join(names)})
    sizes = {"n": len(modes), "m": len(resonances), "a": len(names)}
    for name, numbers in values.items():
        unit, axes, _, _, kinds, _ = FIELDS[name]
        array = np.asarray(numbers, np.int64 if kinds == WHOLE else float)
        if not array.size:  # what is empty has lost its axes
            array = array.reshape([int(axis) if axis.isdigit() else sizes.get(axis, 0) for axis in axes.split()])
        put_array(file, name, array, unit)


def _value_of(actuator: Actuator, key: str) -> Any:
    """What an actuator has of a field: itself, or its layer, or the material of that."""
    return next(getattr(o, key) for o in (actuator, actuator.layer, actuator.layer.material) if hasattr(o, key))


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
    text = get_text(file["actuators"].attrs, "name") if "actuators" in file else None
    if text is None:
        raise InputError("is missing, every mode file has it", file=path, key="actuators")
    names = text.split("\n") if text else []
    sizes = {"a": len(names)} | ({"q": 0} if on_mesh else {})  # modes on a mesh have no terms
    present = {name: on_mesh if name.startswith("mesh/") else name != DAMPING or name in file for name in FIELDS}
    data = {name: _array(file, name, sizes, path) for name in FIELDS if present[name]}
    actuators = tuple(
        _actuator(name, {key: data[f"actuators/{key}"][i].tolist() for key in ACTUATOR_KEYS})
        for i, name in enumerate(names)
    )
    n, m, coefficients = sizes["n"], sizes["m"], data["modes/coefficients"]
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
    keys = ("mode", "frequency", "damping_ratio", "gain", "driven_point")
    rows = zip(*(data[f"resonances/{key}"].tolist() for key in keys), data["resonances/driven_by"], strict=True)
    resonances = tuple(
        Resonance(mode, f, z, g, (p[0], p[1]), tuple(itertools.compress(names, driven)))
        for mode, f, z, g, p, driven in rows
    )
    return ModeFile(modes, resonances, actuators, data[FORCE], _origin(file, path), data.get(DAMPING))


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


def _number(file: h5py.File, name: str, path: Path) -> float:
    """Read an attribute of /plate; refuse it unless it is a finite number above 0 (Poisson's ratio: 0 to 0.5)."""
    value: Any = file["plate"].attrs.get(name) if "plate" in file else None
    largest = 0.5 if name == "poisson_ratio" else 1e15
    if not isinstance(value, float | int | np.number) or not 0.0 <= float(value) <= largest:
        raise InputError(f"is {value!r}, must be a number up to {largest:g}", file=path, key=f"plate.{name}")
    if value == 0.0 and name != "poisson_ratio":
        raise InputError("is 0, must be a number above 0", file=path, key=f"plate.{name}")
    return float(value)


def _array(file: h5py.File, name: str, sizes: dict[str, int], path: Path) -> NDArray[Any]:
    """Read a dataset; refuse it unless kind, shape and range are those of its field.

    Args:
        file: opened.
        name: of the dataset.
        sizes: of axes, by their letters; takes those that are not known yet.
        path: of the file, for messages.
    """
    _, axes, least, largest, kinds, unknown = FIELDS[name]
    try:
        values = np.asarray(file[name][()])
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError("is missing or unreadable, every mode file has it", file=path, key=name) from error
    letters = axes.split()
    if values.dtype.kind not in kinds or values.ndim != len(letters):
        allowed = f"{len(letters)}-dimensional array of {'whole ' if kinds == WHOLE else ''}numbers"
        raise InputError(f"is a {values.ndim}-dimensional {values.dtype}, must be a {allowed}", file=path, key=name)
    shape = tuple(
        int(letter) if letter.isdigit() else sizes.setdefault(letter, size)
        for letter, size in zip(letters, values.shape, strict=True)
    )
    if values.shape != shape:
        raise InputError(f"has shape {values.shape}, must be {shape}", file=path, key=name)
    valid = (values >= least) & (values <= largest)
    if not (valid | np.isnan(values) if unknown else valid).all():
        raise InputError(f"holds a number outside {least:g} to {largest:g}", file=path, key=name)
    return values
