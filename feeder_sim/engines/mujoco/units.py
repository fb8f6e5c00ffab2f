"""Systems of units that MuJoCo can be given a scene in; everything else in the package is SI."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from feeder_sim.part.rigid_part import LEVEL
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.scene.scene import Scene


class Units(NamedTuple):
    """What 1 m, 1 kg and 1 s are in a system of units."""

    length: float
    mass: float
    time: float


UNITS = {"SI": Units(1.0, 1.0, 1.0), "mm-g-ms": Units(1e3, 1e3, 1e3)}


def converted(scene: Scene) -> Scene:
    """The scene with surface, parts and timestep in the units of its MuJoCo settings; parts in principal axes."""
    length, mass, time = UNITS[scene.scenario.mujoco.units]
    s, t = scene.surface, scene.surface.terms
    surface = replace(
        s,
        length=s.length * length,
        width=s.width * length,
        thickness=s.thickness * length,
        x=s.x * length,
        y=s.y * length,
        table=s.table * np.array([1.0, 1.0 / length, 1.0 / length])[:, None, None],
        terms=ModalTerms(t.shape, t.start * time, t.stop * time, t.coefficient * length, t.rate / time),
    )
    kinds = tuple(
        replace(
            kind,
            mass=kind.mass * mass,
            inertia=kind.inertia * mass * length**2,
            corners=kind.in_principal_axes(kind.corners) * length,
            corner_radius=kind.corner_radius * length,
            vertices=kind.in_principal_axes(kind.vertices) * length,
            principal_axes=np.array(LEVEL),
            pieces=tuple(kind.in_principal_axes(piece) * length for piece in kind.pieces),
            circle_radius=kind.circle_radius * length,
        )
        for kind in scene.kinds
    )
    parts = tuple(replace(kinds[kind], name=part.name) for kind, part in zip(scene.kind_of, scene.parts, strict=True))
    return replace(scene, surface=surface, kinds=kinds, parts=parts, timestep=scene.timestep * time)
