"""Modes of any plate from its mode shapes at points: smooth shapes, slopes, modal masses, and how good all that is.

The points are moved so that the bounding box of the plate is centred on the origin. Every shape is fitted in the
package's own basis over that box (scattered_fit.py). Where no rotations are given, they are grad w times the ratio B/k
of a Mindlin plate's wave at that frequency (feeder_sim.plate.mode_shapes), which is 1 for a thin plate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.imported.measured_shapes import LARGEST_COORDINATE, MeasuredShapes
from feeder_sim.plate.imported.scattered_fit import Fit, fit_scattered, slopes
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_file import ModeFile, Origin, Resonance
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.modes import TERMS_PER_AXIS, PlateModes, plate_modes
from feeder_sim.plate.outline import Outline, checked_outline, rectangular
from feeder_sim.plate.rectangle import RectangularPlate

# The outline of a plate, from nothing but the points that a measurement or a mesh has on it.

NEIGHBOURS = 4
COMMON = 95.0  # percentile of the distances to these neighbours
LONGEST_EDGE = 2.0  # times that distance; where points are farther apart there is no plate
LEAST_HOLE = 0.75  # of that length; the radius of a hole. Smaller ones are gaps between scattered points
PLACE_TOLERANCE = 1e-6  # of the size of the plate


def distinct(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) without those at the same place, as the nodes of a solid above each other are."""
    grain = PLACE_TOLERANCE * float(np.ptp(points, axis=0).max()) or 1.0
    _, first = np.unique(np.round(points / grain).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def outline_of_points(points: NDArray[np.float64]) -> tuple[Outline, float]:
    """The concave hull of points (n, 2) [m] that are all distinct, with holes where they leave room for more.

    An outline that is its bounding box within the distance of neighbours becomes that box.

    Returns:
        the outline; how wide the widest gap between points is that is taken for plate, though it may be a hole [m].

    Raises:
        ValueError: the points are too few, or on a line.
    """
    import shapely
    from scipy.spatial import Delaunay, QhullError, cKDTree

    try:
        corners = Delaunay(points).simplices
    except (QhullError, ValueError) as error:
        raise ValueError(f"has {len(points)} places, must be at least 3 that are not on a line") from error
    sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    lengths = np.linalg.norm(points[sides[:, 0]] - points[sides[:, 1]], axis=1)
    near = cKDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points)))[0][:, -1]
    limit = LONGEST_EDGE * float(np.percentile(near, COMMON))
    ratio = (limit - lengths.min()) / max(float(np.ptp(lengths)), 1e-300)
    hull = shapely.concave_hull(shapely.MultiPoint(points), ratio=float(np.clip(ratio, 0.0, 1.0)), allow_holes=True)
    if hull.geom_type != "Polygon":
        raise ValueError(f"has {len(points)} places, must be at least 3 that are not on a line")
    areas = [shapely.Polygon(hole).area for hole in hull.interiors]
    least = np.pi * (LEAST_HOLE * limit) ** 2
    holes = [hole for hole, area in zip(hull.interiors, areas, strict=True) if area > least]
    widest = max((area for area in areas if area <= least), default=0.0)
    outline = checked_outline([shapely.get_coordinates(ring) for ring in (hull.exterior, *holes)])
    return as_box(outline) if rectangular(outline, 0.5 * limit) else outline, 2.0 * math.sqrt(widest / np.pi)


def as_box(outline: Outline) -> Outline:
    """The bounding box of an outline."""
    (left, low), (right, high) = outline.exterior.min(axis=0), outline.exterior.max(axis=0)
    return Outline(np.array([[left, low], [right, low], [right, high], [left, high]]))


# Which mode of the plain rectangle a given mode is most alike, by the modal assurance criterion.
#
#     MAC = (a . b)^2 / (a . a)(b . b)
#
# (Allemang and Brown, Proc. 1st IMAC (1982) 110.) Degenerate modes come in any mixture, so that for those within
# `FREQUENCY_TOLERANCE` of each other it is the share of a in the space that they span.

FREQUENCY_TOLERANCE = 1e-3  # relative
FARTHER = (
    1.6,
    1.2,
    1.0,
    0.7,
    0.4,
)  # of the highest frequency; how far the rectangle's modes are computed, if they can be


@dataclass(frozen=True)
class Resemblance:
    """The likeness of a mode to one of the plain rectangle of the same bounding box.

    Attributes:
        mac: 1 for the same shape, 0 for nothing in common.
        modes: 0-based index of the rectangle's mode; of all that are degenerate with it.
        frequency: of that mode [Hz].
    """

    mac: float
    modes: tuple[int, ...]
    frequency: float


def resemblances(
    plate: RectangularPlate, frequency: NDArray[np.float64], points: NDArray[np.float64], values: NDArray[np.float64]
) -> list[Resemblance | None]:
    """For modes with values (modes, n) at points (n, 2) [m] of a plate; None where the rectangle has no modes there."""
    modes = _of_rectangle(plate, float(frequency.max()))
    if modes is None:
        return [None] * len(values)
    groups: list[list[int]] = []
    for i, f in enumerate(modes.natural_frequency.tolist()):
        if groups and f < (1.0 + FREQUENCY_TOLERANCE) * modes.natural_frequency[groups[-1][-1]]:
            groups[-1].append(i)
        else:
            groups.append([i])
    best: list[Resemblance | None] = [None] * len(values)
    for group in groups:
        span = np.linalg.qr(np.stack([modes.evaluate(i, *points.T)[0] for i in group], axis=1))[0]
        for k, value in enumerate(values):
            mac = float(((span.T @ value) ** 2).sum() / (value**2).sum())
            previous = best[k]
            if previous is None or mac > previous.mac:
                best[k] = Resemblance(mac, tuple(group), float(modes.natural_frequency[group[0]]))
    return best


def _of_rectangle(plate: RectangularPlate, highest: float) -> PlateModes | None:
    for factor in FARTHER:
        try:
            modes = plate_modes(plate, highest_frequency=factor * highest)
        except ValueError:  # not resolved so far
            continue
        if len(modes):
            return modes
    return None


LEAST_DEFLECTION = 1e-100  # in the unit of the file; its square would be none
MISSED = 0.9  # residual over the deflection, from which on the points contradict each other
LEAST_POINTS = 4.0  # per half wavelength, with which a shape can be told from another
OFF_PLATE = 0.02  # of the size of the plate; how far a point may lie beside a given outline
LINE_TOLERANCE = 2e-6  # [m]; a corner that close to the line between its neighbours only costs time
SAMPLES = 241  # per axis, where shapes are scaled and masses integrated
ROUGH = 0.05  # residual over the antinode from which on a shape is doubtful
COMPLEX = 0.9  # collinearity below which a mode is
MASS_FACTOR = 2.0  # a modal mass of the file farther from that of the shape is not in its units
CLEAR_OF_NODE = 0.02  # of the antinode; a smaller deflection decides on no sign


@dataclass(frozen=True)
class ImportedMode:
    """How good one imported mode is.

    Attributes:
        residual: root mean square of what the shape misses the points by, over the antinode [1].
        condition: number of the least squares.
        points_per_half_wavelength: of the plate's bending wave at that frequency.
        collinearity: of the mode as it was given; 1: real.
        with_rotations: whether the file gave them.
        mass_of_file: whether it gave the modal mass.
        resembles: mode of the plain rectangle that it is most alike; None where these cannot be computed.
    """

    residual: float
    condition: float
    points_per_half_wavelength: float
    collinearity: float
    with_rotations: bool
    mass_of_file: bool
    resembles: Resemblance | None


@dataclass(frozen=True)
class Imported:
    """Modes ready for a mode file, and what a user has to look at.

    Attributes:
        mode_file: the modes; their damping ratios as measured resonances.
        quality: of every mode.
        points: where shapes were given [m], in the coordinates of the mode file (n, 2).
        values: the deflections given there over the antinode (modes, n).
        outline: of the plate, also where it is a rectangle.
        warnings: a line each.
    """

    mode_file: ModeFile
    quality: tuple[ImportedMode, ...]
    points: NDArray[np.float64]
    values: NDArray[np.float64]
    outline: Outline
    warnings: tuple[str, ...]


def import_modes(
    shapes: MeasuredShapes, *, thickness: float, material: Material, outline: Outline | None, source: str
) -> Imported:
    """Make modes of shapes at points.

    Args:
        shapes: as read from a file.
        thickness: of the plate [m].
        material: of the plate.
        outline: in the coordinates of the file [m]; None: from the points.
        source: name of the file, for the record.

    Raises:
        InputError: too few points for a mode, or points that are not on the plate.
    """
    places = _checked_places(shapes.points)
    for i, deflection in enumerate(shapes.deflection):
        if np.abs(deflection).max() < LEAST_DEFLECTION:
            raise InputError(f"mode {i + 1} does not move, must be a mode with a deflection")
    warnings: list[str] = []
    outline = (outline or _outline_of(places, warnings)).simplified(LINE_TOLERANCE)
    shift = -0.5 * (outline.exterior.min(axis=0) + outline.exterior.max(axis=0))
    outline, points, places = outline.moved(shift), shapes.points + shift, places + shift
    plate = RectangularPlate(*outline.size, thickness, material)
    _check_on_plate(places, outline)
    per_half_wave = [_points_per_half_wave(plate, f, outline, places) for f in shapes.frequency.tolist()]
    fit = fit_scattered(points, shapes.deflection, outline.size, TERMS_PER_AXIS)
    _check_smooth(fit, shapes)
    modes = PlateModes(
        plate=plate,
        natural_frequency=shapes.frequency,
        coefficients=np.concatenate([fit.coefficients[:, None], _rotations(shapes, points, plate, fit)], axis=1),
        parity=np.full((len(shapes), 2), -1),
        modal_mass=np.full(len(shapes), np.nan),
        outline=None if _is_rectangle(outline) else outline,
    )
    modes, scale, of_file = _scaled(modes, shapes.modal_mass, outline, warnings)
    alike = resemblances(plate, shapes.frequency, points, shapes.deflection)
    quality = tuple(
        ImportedMode(
            residual=float(fit.residual[i] * abs(scale[i])),
            condition=float(fit.condition[i]),
            points_per_half_wavelength=per_half_wave[i],
            collinearity=float(shapes.collinearity[i]),
            with_rotations=bool(np.isfinite(shapes.rotation[i]).all()),
            mass_of_file=of_file[i],
            resembles=alike[i],
        )
        for i in range(len(shapes))
    )
    warnings += _quality_warnings(quality)
    mode_file = ModeFile(modes, _resonances(shapes), origin=Origin(source, (float(shift[0]), float(shift[1]))))
    return Imported(mode_file, quality, points, shapes.deflection * scale[:, None], outline, tuple(warnings))


def _outline_of(places: NDArray[np.float64], warnings: list[str]) -> Outline:
    """The outline of points (n, 2) [m]; adds what there is to look at to the warnings."""
    try:
        outline, gap = outline_of_points(places)
    except ValueError as error:
        raise InputError(str(error)) from error
    if len(outline.exterior) > 4 or outline.holes:
        warnings.append(
            f"the outline is that of the points, {len(outline.exterior)} corners and {len(outline.holes)} holes; "
            "look at it with --picture, or give it with --outline"
        )
    if gap > 0.0:
        warnings.append(
            f"gaps between the points of up to {1e3 * gap:.2g} mm are taken for plate; give holes with --outline"
        )
    return outline


def _is_rectangle(outline: Outline) -> bool:
    fills_its_box = outline.polygon.area > (1.0 - 1e-9) * math.prod(outline.size)
    return len(outline.exterior) == 4 and not outline.holes and fills_its_box


def _check_smooth(fit: Fit, shapes: MeasuredShapes) -> None:
    """Refuse shapes that no smooth one comes near to.

    Raises:
        InputError: the fit of a mode misses nearly all of its deflection.
    """
    missed = fit.residual / np.sqrt((shapes.deflection**2).mean(axis=1))
    if not (missed < MISSED).all():
        worst = int(missed.argmax())
        raise InputError(
            f"mode {worst + 1} is no smooth shape, the nearest one misses {missed[worst]:.2g} of its deflection; "
            f"must be below {MISSED:g}. Do points at one place have different deflections?"
        )


def _resonances(shapes: MeasuredShapes) -> tuple[Resonance, ...]:
    """The modes with a damping ratio, as measured resonances."""
    return tuple(
        Resonance(mode=i, frequency=float(f), damping_ratio=float(z), gain=math.nan, driven_point=(0.0, 0.0))
        for i, (f, z) in enumerate(zip(shapes.frequency, shapes.damping_ratio, strict=True))
        if math.isfinite(z)
    )


def _checked_places(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The distinct ones of points (n, 2) [m]."""
    if len(points) < 3:
        raise InputError(f"has {len(points)} points, must be at least 3")
    if np.abs(points).max() > LARGEST_COORDINATE:
        raise InputError(
            f"has a point at {np.abs(points).max():g} m, must be up to {LARGEST_COORDINATE:g} m; is the unit right?"
        )
    return distinct(points)


def _check_on_plate(places: NDArray[np.float64], outline: Outline) -> None:
    beside = -outline.distance(places)
    if beside.max() > OFF_PLATE * max(outline.size):
        raise InputError(
            f"has {int((beside > OFF_PLATE * max(outline.size)).sum())} points beside the outline, the farthest by "
            f"{1e3 * beside.max():.3g} mm; must be points on it, in the same coordinates",
            key="--outline",
        )


def _points_per_half_wave(
    plate: RectangularPlate, frequency: float, outline: Outline, places: NDArray[np.float64]
) -> float:
    """How many points the plate has per half wavelength at a frequency [Hz].

    Raises:
        InputError: too few, no such wave in the plate, or a gap between them as wide as half a wave.
    """
    from scipy.spatial import cKDTree

    try:
        half_wave = 0.5 * standing_wave(plate, frequency).wavelength
    except ValueError as error:
        raise InputError(f"has a mode at {frequency:g} Hz, but {error}; is the thickness right?") from error
    per_half_wave = half_wave / math.sqrt(outline.polygon.area / len(places))
    name = f"the mode at {frequency:g} Hz, whose half wave is {1e3 * half_wave:.3g} mm,"
    if per_half_wave < LEAST_POINTS:
        raise InputError(f"{name} has {per_half_wave:.2g} points per half wave, must be at least {LEAST_POINTS:g}")
    on_plate = _grid(outline, 61)[2]
    gap = 2.0 * float(cKDTree(places).query(on_plate)[0].max())
    if gap > half_wave:
        raise InputError(f"{name} has a gap of {1e3 * gap:.3g} mm without points, must be up to half a wave")
    return per_half_wave


def _rotations(
    shapes: MeasuredShapes, points: NDArray[np.float64], plate: RectangularPlate, fit: Fit
) -> NDArray[np.float64]:
    """Coefficients (modes, 2, terms, terms) of the rotations: fitted where they are given, else from the slopes."""
    size = (plate.length, plate.width)
    rotations = slopes(fit.coefficients, size)
    for i, frequency in enumerate(shapes.frequency.tolist()):
        if np.isfinite(shapes.rotation[i]).all():
            rotations[i] = fit_scattered(points, shapes.rotation[i], size, TERMS_PER_AXIS).coefficients
        else:
            wave = standing_wave(plate, frequency)
            rotations[i] *= wave.rotation / wave.wavenumber
    return rotations


def _grid(
    outline: Outline, n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Middles of n x n cells of the box: x, y [m], those on the plate (m, 2), and which ones they are (n, n)."""
    x, y = (((np.arange(n) + 0.5) / n - 0.5) * side for side in outline.size)
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    inside = outline.holds(places)
    return x, y, places[inside], inside


def _scaled(
    modes: PlateModes, mass_of_file: NDArray[np.float64], outline: Outline, warnings: list[str]
) -> tuple[PlateModes, NDArray[np.float64], list[bool]]:
    """The modes with max |w| = 1 on the plate and w > 0 next to the corner (+, +), with their modal masses.

    Returns:
        the modes; the factor of each; whether its mass is that of the file.
    """
    x, y, _, inside = _grid(outline, SAMPLES)
    edge = outline.edge_points(max(outline.size) / SAMPLES)
    order = np.argsort(-(edge / np.array(outline.size)).sum(axis=1), kind="stable")  # the corner (+, +) first
    share = outline.polygon.area * inside / inside.sum()
    plate, coefficients = modes.plate, modes.coefficients.copy()
    scale, masses, of_file = np.ones(len(modes)), np.zeros(len(modes)), [False] * len(modes)
    for i in range(len(modes)):
        values = modes.evaluate_grid(i, x, y)
        along = modes.evaluate(i, *edge[order].T)[0]
        largest = max(np.abs(values[0][inside]).max(), np.abs(along).max())
        decides = along[np.argmax(np.abs(along) > CLEAR_OF_NODE * largest)]
        scale[i] = (np.sign(decides) or 1.0) / largest
        coefficients[i] *= scale[i]
        w, bx, by = (share * (scale[i] * field) ** 2 for field in values)
        masses[i] = plate.mass_per_area * w.sum() + plate.rotary_inertia * (bx.sum() + by.sum())
        measured_mass = mass_of_file[i] / largest**2
        if math.isnan(measured_mass):
            continue
        if masses[i] / MASS_FACTOR < measured_mass < masses[i] * MASS_FACTOR:
            masses[i], of_file[i] = measured_mass, True
        else:
            warnings.append(
                f"mode {i + 1}: the modal mass of the file would be {1e3 * measured_mass:.3g} g, that of its shape is "
                f"{1e3 * masses[i]:.3g} g, which is taken"
            )
    scaled = PlateModes(plate, modes.natural_frequency, coefficients, modes.parity, masses, outline=modes.outline)
    return scaled, scale, of_file


def _quality_warnings(quality: Sequence[ImportedMode]) -> list[str]:
    lines = []
    for i, mode in enumerate(quality):
        if mode.residual > ROUGH:
            lines.append(
                f"mode {i + 1}: the smooth shape misses the points by {mode.residual:.2g} of the antinode; noise, or a "
                "shape too fine for the points"
            )
        if mode.collinearity < COMPLEX:
            lines.append(f"mode {i + 1}: is complex, collinearity {mode.collinearity:.2g}; only its real part is kept")
    return lines
