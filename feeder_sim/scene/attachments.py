"""Plate file -> what is fixed to the plate, in SI units: piezo actuators, bars, masses; checked against each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from feeder_sim.errors import InputError
from feeder_sim.plate.actuators import SHEAR_LAG, Actuator, clamped_capacitance, modal_force_table, moment_of_strain
from feeder_sim.plate.materials import Material
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Attachment, Layer, PointMass
from feeder_sim.scenario import Actuator as ActuatorTable
from feeder_sim.scenario import BondedLayer, PlateFile, resolve_material

TOUCHING = 1e-6  # [m]; patches that overlap by less are side by side


def build_actuators(tables: Sequence[ActuatorTable], plate: RectangularPlate) -> tuple[Actuator, ...]:
    """The piezo actuators of a plate.

    Raises:
        InputError: one reaches beyond the plate, or is thicker than layers of ceramic can be.
    """
    actuators = []
    for i, table in enumerate(tables):
        material = Material(table.density_kg_m3, 1e12 / table.s11_um2_per_n, table.poisson_ratio)
        layer = _layer(table, material)
        check_on_plate(layer, plate, f"actuator[{i}]")
        moment = table.moment_per_volt_n
        if moment is None:
            assert table.d31_pm_per_v is not None  # the table's own check
            strain_per_volt = table.d31_pm_per_v * 1e-12 * table.layers / layer.thickness
            moment = moment_of_strain(plate, layer) * strain_per_volt
        capacitance = clamped_capacitance(layer, table.relative_permittivity, table.layers)
        lag = SHEAR_LAG * plate.thickness if table.shear_lag_mm is None else 1e-3 * table.shear_lag_mm
        if 2.0 * lag >= min(layer.size):
            raise InputError(
                f"is [{1e3 * layer.size[0]:g}, {1e3 * layer.size[1]:g}], allowed is above {2e3 * lag:.3g}, the way "
                "over which stress enters the patch from two edges (or give shear_lag_mm)",
                key=f"actuator[{i}].size_mm",
            )
        actuators.append(Actuator(table.name, layer, moment, lag, capacitance, table.loss_tangent))
    return tuple(actuators)


def with_actuators(held: ModeFile, tables: Sequence[ActuatorTable]) -> ModeFile:
    """Imported modes with actuators, whose places are in the coordinates of the file that the modes come from.

    The modes are taken to be those of the plate with its patches.

    Raises:
        InputError: a patch reaches beyond the plate or over a hole, or two overlap.
    """
    from shapely import Polygon, box

    modes = held.modes
    half_x, half_y = 0.5 * modes.plate.length, 0.5 * modes.plate.width
    area = modes.outline.polygon if modes.outline else box(-half_x, -half_y, half_x, half_y)
    x, y = held.origin.shift if held.origin else (0.0, 0.0)
    moved = [
        table.model_copy(update={"at_mm": (table.at_mm[0] + 1e3 * x, table.at_mm[1] + 1e3 * y)}) for table in tables
    ]
    for i, table in enumerate(moved):
        layer = _layer(table, Material(table.density_kg_m3, 1.0, table.poisson_ratio))
        if not area.covers(Polygon(layer.corners(TOUCHING))):
            raise InputError(
                f"is [{tables[i].at_mm[0]:g}, {tables[i].at_mm[1]:g}], from where it reaches beyond the plate, allowed "
                f"is a place on it; its middle is at [{-1e3 * x:g}, {-1e3 * y:g}] in the file of the modes",
                key=f"actuator[{i}].at_mm",
            )
    actuators = build_actuators(moved, modes.plate)
    _check_apart({f"actuator[{i}]": actuator.layer for i, actuator in enumerate(actuators)})
    return replace(held, actuators=actuators, force_per_volt=modal_force_table(modes, actuators))


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
                f"is [{x:g}, {y:g}], allowed is +-{500.0 * plate.length:g}, +-{500.0 * plate.width:g} (on the plate)",
                key=f"mass[{i}].at_mm",
            )
        masses.append(PointMass((1e-3 * x, 1e-3 * y), 1e-3 * mass.mass_g, 1e-3 * mass.offset_mm))
    return (*(layer for key, layer in layers.items() if key not in silent), *masses)


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
            f"{1e3 * y:.4g}, allowed is +-{500.0 * plate.length:g}, +-{500.0 * plate.width:g} (on the plate)",
            key=f"{key}.at_mm",
        )


def _check_apart(layers: dict[str, Layer]) -> None:
    """Refuse layers that overlap, on either side: the section of three layers is not modelled."""
    from shapely import Polygon

    areas = {key: Polygon(layer.corners(TOUCHING)) for key, layer in layers.items()}
    for (first, one), (second, other) in combinations(areas.items(), 2):
        if one.intersects(other):
            raise InputError(
                f"overlaps {first}, allowed are patches and bars side by side, on one side of the plate",
                key=f"{second}.at_mm",
            )
