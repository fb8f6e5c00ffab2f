"""Part tables of a scenario -> rigid parts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.zener import inelasticity
from feeder_sim.scenario import Ball, PartSpec, Strip, resolve_material

if TYPE_CHECKING:
    from feeder_sim.scene.scene import Scene


# Zener's inelasticity of the balls of a scene on its plate.


def zener_inelasticities(scene: Scene) -> NDArray[np.float64]:
    """Lambda of every kind of part at a normal speed of 1 m/s, shape (kinds,).

    Raises:
        InputError: a part that is no ball, a plate without a material, or an orthotropic material.
    """
    plate, inelasticities = _slab(scene), []
    for i, spec in enumerate(scene.scenario.part):
        if not isinstance(spec, Ball):
            raise InputError(f'is "{spec.shape}", must be "ball" with contact.restitution = "zener"', key=f"part[{i}]")
        inelasticities.append(inelasticity(resolve_material(spec.material), 0.5e-3 * spec.diameter_mm, plate))
    return np.array(inelasticities)


def _slab(scene: Scene) -> RectangularPlate:
    """Thickness and material of the plate."""
    plate, shape = scene.scenario.plate, scene.driven[0].shape
    if isinstance(plate, Strip):
        return RectangularPlate(1.0, 1.0, 1e-3 * plate.thickness_mm, resolve_material(plate.material))
    if isinstance(shape, RitzShape):
        return shape.modes.plate
    raise InputError('is "zener", must be a number over a plate without a material', key="contact.restitution")


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
            f"has a mass of {part.mass:.3g} kg and a moment of inertia of {part.inertia.min():.3g} kg m2, must be "
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
