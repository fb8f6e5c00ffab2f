"""Plate file -> what is fixed to the plate, in SI units: piezo actuators, bars, masses; checked against each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.actuators import Actuator, clamped_capacitance, modal_force_table, moment_of_voltage
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.outline import Outline
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Attachment, Layer, PointMass
from feeder_sim.scenario import Actuator as ActuatorTable
from feeder_sim.scenario import BondedLayer, PlateFile, resolve_material
from feeder_sim.scenario import Support as SupportTable

if TYPE_CHECKING:
    from feeder_sim.plate.elements.mindlin import Support as ElementSupport

SPREAD = 24  # points along a line or a side of an area, between which a spring is shared out
TOUCHING = 1e-6  # [m]; patches that overlap by less are side by side


def build_actuators(
    tables: Sequence[ActuatorTable], plate: RectangularPlate, *, loaded: bool = False
) -> tuple[Actuator, ...]:
    """The piezo actuators of a plate; `loaded` where its modes are those with all of them, whatever the tables say.

    Raises:
        InputError: one reaches beyond the plate, or is thicker than layers of ceramic can be.
    """
    actuators = []
    for i, table in enumerate(tables):
        ceramic = table.properties
        layer = _layer(table, ceramic.solid)
        check_on_plate(layer, plate, f"actuator[{i}]")
        moment, spread = table.moment_per_volt_n, 1.0
        if moment is None:
            glue = table.glue_thickness_um
            moment, spread = moment_of_voltage(
                plate,
                layer,
                ceramic.d31 * table.layers / layer.thickness,
                slip=None if glue is None else 1e-6 * glue / (1e9 * table.glue_shear_modulus_gpa),
                loaded=loaded or table.loads,
            )
        capacitance = clamped_capacitance(layer, ceramic.relative_permittivity, table.layers)
        actuators.append(Actuator(table.name, layer, moment, spread, capacitance, ceramic.loss_tangent))
    return tuple(actuators)


def with_actuators(mode_file: ModeFile, tables: Sequence[ActuatorTable]) -> ModeFile:
    """Imported modes with actuators, whose places are in the coordinates of the file that the modes come from.

    The modes are taken to be those of the plate with its patches.

    Raises:
        InputError: a patch reaches beyond the plate or over a hole, or two overlap.
    """
    from shapely import Polygon, box

    modes = mode_file.modes
    half_x, half_y = 0.5 * modes.plate.length, 0.5 * modes.plate.width
    area = modes.outline.polygon if modes.outline else box(-half_x, -half_y, half_x, half_y)
    x, y = mode_file.origin.shift if mode_file.origin else (0.0, 0.0)
    moved = [
        table.model_copy(update={"at_mm": (table.at_mm[0] + 1e3 * x, table.at_mm[1] + 1e3 * y)}) for table in tables
    ]
    for i, table in enumerate(moved):
        layer = _layer(table, table.properties.solid)
        if not area.covers(Polygon(layer.corners(TOUCHING))):
            raise InputError(
                f"is [{tables[i].at_mm[0]:g}, {tables[i].at_mm[1]:g}], from where it reaches beyond the plate, allowed "
                f"is a place on it; its middle is at [{-1e3 * x:g}, {-1e3 * y:g}] in the file of the modes",
                key=f"actuator[{i}].at_mm",
            )
    actuators = build_actuators(moved, modes.plate, loaded=True)
    _check_apart({f"actuator[{i}]": actuator.layer for i, actuator in enumerate(actuators)})
    return replace(mode_file, actuators=actuators, force_per_volt=modal_force_table(modes, actuators))


def build_attachments(
    file: PlateFile, plate: RectangularPlate, actuators: Sequence[Actuator]
) -> tuple[Attachment, ...]:
    """Everything that is fixed to a plate and loads it.

    Raises:
        InputError: something reaches beyond the plate, or two layers overlap.
    """
    layers = {f"actuator[{i}]": actuator.layer for i, actuator in enumerate(actuators)}
    silent = {f"actuator[{i}]" for i, table in enumerate(file.actuator) if not table.loads}
    for i, bar in enumerate(file.bar):
        key, material = f"bar[{i}]", resolve_material(bar.material)
        if not material.isotropic:
            raise InputError("is orthotropic, allowed for a bar is an isotropic material", key=f"{key}.material")
        layers[key] = _layer(bar, material)
        check_on_plate(layers[key], plate, key)
    _check_apart(layers)
    masses = []
    for i, mass in enumerate(file.mass):
        x, y = mass.at_mm
        if abs(x) > 500.0 * plate.length or abs(y) > 500.0 * plate.width:
            raise InputError(
                f"is [{x:g}, {y:g}], must be +-{500.0 * plate.length:g}, +-{500.0 * plate.width:g} (on the plate)",
                key=f"mass[{i}].at_mm",
            )
        masses.append(PointMass((1e-3 * x, 1e-3 * y), 1e-3 * mass.mass_g, 1e-3 * mass.offset_mm))
    return (*(layer for key, layer in layers.items() if key not in silent), *masses)


def check_within(outline: Outline, actuators: Sequence[Actuator], attachments: Sequence[Attachment]) -> None:
    """Refuse what reaches beyond a plate with an outline, or over a hole.

    Raises:
        InputError: something does.
    """
    from shapely import Point, Polygon

    layers = {f"actuator[{i}]": actuator.layer for i, actuator in enumerate(actuators)}
    patches = list(layers.values())
    bars = [attachment for attachment in attachments if isinstance(attachment, Layer) and attachment not in patches]
    layers |= {f"bar[{i}]": layer for i, layer in enumerate(bars)}
    places = {f"{key}.at_mm": Polygon(layer.corners(TOUCHING)) for key, layer in layers.items()}
    masses = [attachment for attachment in attachments if isinstance(attachment, PointMass)]
    places |= {f"mass[{i}].at_mm": Point(mass.centre) for i, mass in enumerate(masses)}
    for key, place in places.items():
        if not outline.polygon.covers(place):
            x, y = 1e3 * place.centroid.x, 1e3 * place.centroid.y
            raise InputError(
                f"lies at ({x:.4g}, {y:.4g}) mm from the middle of the plate, from where it reaches beyond it or over "
                "a hole, must be a place on it",
                key=key,
            )


def build_supports(tables: Sequence[SupportTable], outline: Outline) -> tuple[ElementSupport, ...]:
    """What carries a plate.

    Raises:
        InputError: a support that is not on the plate.
    """
    from feeder_sim.plate.elements.mindlin import Support

    supports = []
    for i, table in enumerate(tables):
        place = _place(table)
        points = _spread(place)
        is_on_plate = outline.polygon.buffer(TOUCHING).covers(place)
        if not is_on_plate and not (place.area > 0.0 and outline.polygon.intersection(place).area > 0.0):
            x, y = table.at_mm
            raise InputError(
                f"lies at ({x:g}, {y:g}) mm from the middle of the plate, beside it, must be a place on it",
                key=f"support[{i}].at_mm",
            )
        points = points[outline.distance(points) > -TOUCHING]
        inside = points + 1e-3 * TOUCHING * np.sign(-points)  # on the edge nothing is beside the mesh
        stiffness = 1e3 * (table.stiffness_n_per_mm or 0.0)
        weights = np.full(len(points), 1.0 / max(len(points), 1))
        supports.append(Support(table.hold, inside, weights, stiffness, table.loss_factor or 0.0, place))
    return tuple(supports)


def _place(table: SupportTable) -> Any:
    """Point, line or area [m] of a support, as shapely has it."""
    from shapely import LineString, Point, box

    x, y = (1e-3 * c for c in table.at_mm)
    if table.to_mm is not None:
        return LineString([(x, y), (1e-3 * table.to_mm[0], 1e-3 * table.to_mm[1])])
    if table.diameter_mm is not None:
        return Point(x, y).buffer(0.5e-3 * table.diameter_mm)
    if table.size_mm is not None:
        a, b = (0.5e-3 * side for side in table.size_mm)
        return box(x - a, y - b, x + a, y + b)
    return Point(x, y)


def _spread(place: Any) -> NDArray[np.float64]:
    """Points (n, 2) [m] evenly spread over a point, line or area."""
    import shapely

    if place.geom_type == "Point":
        return np.asarray(shapely.get_coordinates(place))
    middles = (np.arange(SPREAD) + 0.5) / SPREAD
    if place.geom_type == "LineString":
        return np.asarray(shapely.get_coordinates(shapely.line_interpolate_point(place, middles, normalized=True)))
    left, low, right, high = place.bounds
    x, y = np.meshgrid(left + middles * (right - left), low + middles * (high - low))
    points = np.column_stack([x.ravel(), y.ravel()])
    return np.asarray(points[shapely.intersects_xy(place, *points.T)])


def _layer(table: BondedLayer, material: Material) -> Layer:
    x, y = table.at_mm
    a, b = table.size_mm
    return Layer(
        centre=(1e-3 * x, 1e-3 * y),
        size=(1e-3 * a, 1e-3 * b),
        angle=math.radians(table.angle_deg),
        thickness=1e-3 * table.thickness_mm,
        side=-1 if table.side == "below" else 1,
        material=material,
    )


def check_on_plate(layer: Layer, plate: RectangularPlate, key: str) -> None:
    """Refuse a layer that reaches beyond the plate; `key` names it in the message.

    Raises:
        InputError: it does.
    """
    x, y = abs(layer.corners()).max(axis=0)
    if x > 0.5 * plate.length + TOUCHING or y > 0.5 * plate.width + TOUCHING:
        raise InputError(
            f"is [{1e3 * layer.centre[0]:g}, {1e3 * layer.centre[1]:g}], from where it reaches to {1e3 * x:.4g}, "
            f"{1e3 * y:.4g}, must be +-{500.0 * plate.length:g}, +-{500.0 * plate.width:g} (on the plate)",
            key=f"{key}.at_mm",
        )


def _check_apart(layers: dict[str, Layer]) -> None:
    """Refuse layers that overlap, on either side: the section of three layers is not modelled."""
    from shapely import Polygon

    areas = {key: Polygon(layer.corners(TOUCHING)) for key, layer in layers.items()}
    for (first, area), (second, other_area) in combinations(areas.items(), 2):
        if area.intersects(other_area):
            raise InputError(
                f"overlaps {first}, must be patches and bars side by side, on one side of the plate",
                key=f"{second}.at_mm",
            )
