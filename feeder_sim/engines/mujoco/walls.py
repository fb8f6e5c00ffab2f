"""Walls in MJCF: the tube around a part in a guide with play, and the rim of a plate."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from feeder_sim.engines.mujoco.contact import contact_parameters, hull_name
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.scenario import Contact
from feeder_sim.scene.scene import Guide, Scene

TUBE_PLANES = 32  # around a tube: its radius is right to half a percent
TUBE_HEIGHT = 0.02  # [m]; drawn to twice that, in contact everywhere


def add_tube(spec: Any, scene: Scene, part: RigidPart, guide: Guide) -> None:
    """Add the wall of a tube as a ring of planes, which the part's hull meets (a ball: its sphere)."""
    import mujoco

    assert guide.radius is not None and guide.restitution is not None
    wall = Contact(restitution=guide.restitution, friction=guide.friction)
    parameters = contact_parameters(wall, scene.timestep)
    half = [guide.radius * math.tan(math.pi / TUBE_PLANES), TUBE_HEIGHT, 0.01]
    frame = spec.worldbody.add_body(name=f"tube_{part.name}", pos=[*guide.foot, 0.0], quat=leaning(guide))
    touching = hull_name(part)
    for i in range(TUBE_PLANES):
        angle = 2.0 * math.pi * i / TUBE_PLANES
        outwards = np.array([math.cos(angle), math.sin(angle), 0.0])
        name = f"tube_{part.name}_{i}"
        frame.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=half,
            pos=guide.radius * outwards + [0.0, 0.0, TUBE_HEIGHT],
            zaxis=-outwards,
            contype=0,
            conaffinity=0,
            rgba=[0.6, 0.8, 0.9, 0.15],
        )
        spec.add_pair(name=name, geomname1=name, geomname2=touching, condim=3, **parameters)


def add_rim(spec: Any, scene: Scene) -> None:
    """Add a wall along each side of the plate, which the parts' hulls meet."""
    import mujoco

    parameters = contact_parameters(scene.scenario.contact, scene.timestep, scene.scenario.mujoco)
    half = (0.5 * scene.surface.length, 0.5 * scene.surface.width)
    for i, (x, y) in enumerate([(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)]):
        wall = spec.worldbody.add_geom(
            name=f"rim_{i}",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[max(half), 0.01, 0.01],
            pos=[half[0] * x, half[1] * y, 0.0],
            zaxis=[-x, -y, 0.0],
            contype=0,
            conaffinity=0,
            rgba=[0.6, 0.8, 0.9, 0.15],
        )
        for part in scene.parts:
            name = f"{wall.name}_{part.name}"
            spec.add_pair(name=name, geomname1=wall.name, geomname2=hull_name(part), condim=3, **parameters)


def leaning(guide: Guide) -> list[float]:
    """Quaternion that turns the vertical into the guide's axis."""
    return [math.cos(0.5 * guide.tilt), 0.0, math.sin(0.5 * guide.tilt), 0.0]
