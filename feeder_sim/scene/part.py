"""Part tables of a scenario -> rigid parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import PartSpec, resolve_material

LEAST_INERTIA = 1e-15  # [kg], [kg m^2]: what MuJoCo takes for zero; a steel ball of 0.3 mm has just more


def build_part(spec: PartSpec, *, name: str = "part") -> RigidPart:
    """Turn a part of the scenario into a rigid body.

    Raises:
        InputError: a mesh file that is missing, unreadable, not closed or without volume; a part too small.
    """
    part = _weighed(spec.solid(resolve_material(spec.material).density, name), spec)
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
