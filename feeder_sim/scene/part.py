"""Part tables of a scenario -> rigid parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.part.mesh_part import mesh_part
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import ISO_4032, ball, box, cylinder, dimer, hex_nut
from feeder_sim.scenario import Ball, Box, Cylinder, Dimer, HexNut, PartSpec, resolve_material

LEAST_INERTIA = 1e-15  # [kg], [kg m^2]: what MuJoCo takes for zero; a steel ball of 0.3 mm has just more

ROD = 0.2  # diameter of a dimer's rod over that of its balls, where none is given


def build_part(spec: PartSpec, *, name: str = "part") -> RigidPart:
    """Turn a part of the scenario into a rigid body.

    Raises:
        InputError: a mesh file that is missing, unreadable, not closed or without volume; a part too small.
    """
    part = _weighed(_shaped(spec, resolve_material(spec.material).density, name), spec)
    if spec.guide is not None:  # the wall of a tube is met with corners
        part = replace(part, circle_radius=0.0)
    if min(part.mass, part.inertia.min()) < LEAST_INERTIA:
        raise InputError(
            f"has a mass of {part.mass:.3g} kg and a moment of inertia of {part.inertia.min():.3g} kg m2, allowed is "
            f"at least {LEAST_INERTIA:g} each (MuJoCo's limit)",
            key="part",
        )
    return part


def _weighed(part: RigidPart, spec: PartSpec) -> RigidPart:
    """The part with the mass and the moments of inertia that its table gives."""
    if spec.mass_g is not None:
        mass = 1e-3 * spec.mass_g
        part = replace(part, mass=mass, inertia=part.inertia * (mass / part.mass))
    if spec.inertia_g_mm2 is not None:
        part = replace(part, inertia=1e-9 * np.array(spec.inertia_g_mm2))
    return part


def _shaped(spec: PartSpec, density: float, name: str) -> RigidPart:
    if isinstance(spec, HexNut):
        across, height, bore = (1e-3 * d for d in nut_dimensions(spec))
        return hex_nut(across, height, bore, density, name)
    if isinstance(spec, Ball):
        return ball(spec.diameter_mm * 1e-3, density, name)
    if isinstance(spec, Cylinder):
        return cylinder(spec.diameter_mm * 1e-3, spec.height_mm * 1e-3, density, name)
    if isinstance(spec, Box):
        x, y, z = (1e-3 * side for side in spec.size_mm)
        return box((x, y, z), density, name)
    if isinstance(spec, Dimer):
        diameter, length = 1e-3 * spec.ball_diameter_mm, 1e-3 * spec.length_mm
        rod = 1e-3 * spec.rod_diameter_mm if spec.rod_diameter_mm else ROD * diameter
        return dimer(diameter, length, density, name, rod_diameter=rod, rod_density=spec.rod_density_kg_m3)
    error = 1e-6 * spec.corner_error_um
    return mesh_part(spec.file, spec.file_unit_mm, density, name, corner_error=error, pieces=spec.pieces_file)


def nut_dimensions(spec: HexNut) -> tuple[float, float, float]:
    """Across flats, height, bore [mm]."""
    if spec.size is not None:
        return ISO_4032[spec.size]
    assert spec.across_flats_mm is not None and spec.height_mm is not None and spec.bore_mm is not None
    return spec.across_flats_mm, spec.height_mm, spec.bore_mm
