"""Zener's inelasticity of the balls of a scene on its plate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.mode_shapes import RitzShape
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.zener import inelasticity
from feeder_sim.scenario import Ball, Strip, resolve_material

if TYPE_CHECKING:
    from feeder_sim.scene.scene import Scene


def zener_inelasticities(scene: Scene) -> NDArray[np.float64]:
    """Lambda of every kind of part at a normal speed of 1 m/s, shape (kinds,).

    Raises:
        InputError: a part that is no ball, a plate without a material, or an orthotropic material.
    """
    plate, found = _slab(scene), []
    for i, spec in enumerate(scene.scenario.part):
        if not isinstance(spec, Ball):
            raise InputError(
                f'is "{spec.shape}", allowed is "ball" with contact.restitution = "zener"', key=f"part[{i}]"
            )
        found.append(inelasticity(resolve_material(spec.material), 0.5e-3 * spec.diameter_mm, plate))
    return np.array(found)


def _slab(scene: Scene) -> RectangularPlate:
    """Thickness and material of the plate."""
    plate, shape = scene.scenario.plate, scene.driven[0].shape
    if isinstance(plate, Strip):
        return RectangularPlate(1.0, 1.0, 1e-3 * plate.thickness_mm, resolve_material(plate.material))
    if isinstance(shape, RitzShape):
        return shape.modes.plate
    raise InputError('is "zener", allowed is a number over a plate without a material', key="contact.restitution")
