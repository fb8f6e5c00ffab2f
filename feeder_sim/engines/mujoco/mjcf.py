"""Scene -> MJCF.

MuJoCo has no deformable kinematic surface, so each part meets a *tangent patch* of its own: a plate-sized box on a
vertical slide and two hinges in the plate's mid-plane, massive enough not to feel the part, placed at every step on
the tangent plane of the surface under the part's centre and given the surface's velocity there. The hinges at
mid-plane make the horizontal surface velocity -h/2 beta' by themselves. Under a part in a guide the plate is a piston,
whose patch needs the slide alone.

Contact set: one small sphere at each corner of the part against its patch, as explicit pairs. (MuJoCo's own prism-box
contact keeps four of six corners and makes a flat part spin.) Parts meet each other by their
convex pieces, walls by their hulls. Restitution: `solref = "0 -(1+e)/dt"` reverses the normal velocity within one step,
`solreffriction = "0 -1/dt"` keeps the restitution out of the tangential direction.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.mujoco.contact import (
    HARD,
    contact_parameters,
    corner_name,
    hull_name,
    part_contact,
    piece_names,
)
from feeder_sim.engines.mujoco.walls import add_rim, add_tube, leaning
from feeder_sim.part.rigid_part import CORNER_RADIUS, LEVEL, RigidPart
from feeder_sim.plate.surface import Surface
from feeder_sim.scene.scene import Guide, Scene

PATCH_MASS_RATIO = 1e6  # patch over part: the part moves its patch by a millionth of its own motion
# MuJoCo stops its solver by a cost scaled with the trace of the inertia matrix, which the heavy patches inflate.
# Scaled back to the part, this is MuJoCo's own default; with the raw default the drift of a model in mm, g and
# ms came out 20 % too fast.
SOLVER_TOLERANCE = 1e-8


def build_mjcf(scene: Scene) -> Any:
    """Build the MjSpec of a scene: patches first, then parts in order, each with a free joint.

    Returns:
        mujoco.MjSpec. Compile it from memory; its `to_xml()` rounds to six digits and is the readable copy.
    """
    import mujoco

    settings = scene.scenario.mujoco
    scene = _in_principal_axes(scene)
    spec = mujoco.MjSpec()
    spec.modelname = scene.scenario.title or "feeder_sim"
    option = spec.option
    option.timestep = scene.timestep
    option.gravity = [0.0, 0.0, -GRAVITY]
    option.cone = getattr(mujoco.mjtCone, f"mjCONE_{settings.cone.upper()}")
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{settings.integrator.upper()}")
    option.iterations, option.impratio = settings.iterations, settings.impratio
    if not settings.refsafe:
        option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # divergence is for the guard to see
    _draw_surroundings(spec, scene.surface)
    part_trace = patch_trace = 0.0
    for part, guide in zip(scene.parts, scene.guides, strict=True):
        patch_trace += _add_patch(spec, scene, part, guide)
        part_trace += part.mass if guide and guide.slides else 3.0 * part.mass + part.inertia.sum()
    tube = any(guide and not guide.slides for guide in scene.guides)
    with_pieces = len(scene.parts) > 1
    with_hull = scene.rim or tube or settings.contact_set == "hull"
    for kind in scene.kinds:
        _add_meshes(spec, kind, with_hull=with_hull, with_pieces=with_pieces)
    for number, (part, guide) in enumerate(zip(scene.parts, scene.guides, strict=True)):
        kind = scene.kinds[scene.kind_of[number]]
        body = _add_part(spec, part, guide, scene.timestep)
        _add_hulls(body, part, kind, with_hull=with_hull, with_pieces=with_pieces)
        _add_surface(body, part, kind)
        _pair_with_patch(spec, scene, part, guide)
        if guide and not guide.slides:
            add_tube(spec, scene, part, guide)
    if len(scene.parts) > 1:
        _pair_parts(spec, scene)
    if scene.rim:
        add_rim(spec, scene)
    option.tolerance = SOLVER_TOLERANCE
    if settings.tolerance == "scaled":
        option.tolerance *= part_trace / (part_trace + patch_trace)
    return spec


def _in_principal_axes(scene: Scene) -> Scene:
    """The scene with every part drawn in its principal axes, as MuJoCo has its bodies."""
    kinds = tuple(
        replace(
            kind,
            corners=kind.in_principal_axes(kind.corners),
            vertices=kind.in_principal_axes(kind.vertices),
            principal_axes=np.array(LEVEL),
            pieces=tuple(kind.in_principal_axes(piece) for piece in kind.pieces),
        )
        for kind in scene.kinds
    )
    parts = tuple(replace(kinds[kind], name=part.name) for kind, part in zip(scene.kind_of, scene.parts, strict=True))
    return replace(scene, kinds=kinds, parts=parts)


def _draw_surroundings(spec: Any, surface: Surface) -> None:
    """Camera and light; collides with nothing."""
    extent = max(surface.length, surface.width)
    spec.stat.extent, spec.stat.center = 0.6 * extent, [0.0, 0.0, 0.0]
    spec.visual.headlight.ambient = spec.visual.headlight.diffuse = [0.3, 0.3, 0.3]
    spec.worldbody.add_light(pos=[0.0, -extent, 2.0 * extent], dir=[0.0, 0.4, -1.0], diffuse=[0.4, 0.4, 0.4])


def _add_patch(spec: Any, scene: Scene, part: RigidPart, guide: Guide | None) -> float:
    """Add the tangent patch of one part; returns the trace of its inertia matrix.

    Without in-plane velocity the hinges lie in the top surface, which then tilts as before but does not slide. Under a
    part in a guide the patch has no hinges, and a sensor of the force between both.
    """
    import mujoco

    surface = scene.surface
    top = 0.5 * surface.thickness if scene.scenario.run.in_plane_velocity else 0.0  # above the hinges
    mass = PATCH_MASS_RATIO * part.mass
    moment = mass * (0.5 * max(surface.length, surface.width)) ** 2
    # Its acceleration within a step must be zero: its motion is prescribed, gravity included.
    body = spec.worldbody.add_body(name=f"plate_{part.name}", pos=[0.0, 0.0, -top], gravcomp=1.0)
    _set_inertia(body, mass, [moment, moment, moment], LEVEL)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    body.mocap = scene.scenario.mujoco.plate == "mocap"
    if not body.mocap:
        body.add_joint(name=f"lift_{part.name}", type=slide, axis=[0, 0, 1])
    if not guide and not body.mocap:
        body.add_joint(name=f"tilt_x_{part.name}", type=hinge, axis=[1, 0, 0])
        body.add_joint(name=f"tilt_y_{part.name}", type=hinge, axis=[0, 1, 0])
    half = 0.5 * np.array([surface.length, surface.width, surface.thickness])
    box, centre = mujoco.mjtGeom.mjGEOM_BOX, [0.0, 0.0, top - half[2]]
    name, colour = f"plate_{part.name}", [0.75, 0.77, 0.80, 1.0]
    body.add_geom(name=name, type=box, size=half, pos=centre, contype=0, conaffinity=0, rgba=colour)
    if guide:
        # MuJoCo's touch sensor adds up the contacts of the body within the site: all of them.
        body.add_site(name=name, type=box, size=2.0 * half, pos=centre, rgba=[0.0, 0.0, 0.0, 0.0])
        sensor, site = mujoco.mjtSensor.mjSENS_TOUCH, mujoco.mjtObj.mjOBJ_SITE
        spec.add_sensor(name=f"touch_{part.name}", type=sensor, objtype=site, objname=name)
        return mass
    return 0.0 if body.mocap else mass + 2.0 * moment


def _set_inertia(body: Any, mass: float, inertia: Any, axes: Any) -> None:
    # An MjsBody whose ipos is left alone gets its centre of mass at the body's own `pos`, not at its origin.
    body.explicitinertial, body.mass, body.inertia = True, mass, inertia
    body.ipos, body.iquat = [0.0, 0.0, 0.0], axes


def build_part_mjcf(part: RigidPart) -> Any:
    """Build the MjSpec of a part alone, for use in scenes of one's own: body, drawn mesh and contact corners."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = part.name
    _add_meshes(spec, part)
    _add_surface(_add_part(spec, part), part, part)
    return spec


def _add_meshes(spec: Any, kind: RigidPart, *, with_hull: bool = False, with_pieces: bool = False) -> None:
    """Add the drawn mesh of a kind of part, its hull where walls meet it, and what other parts meet."""
    import mujoco

    mesh = spec.add_mesh(name=kind.name)
    mesh.uservert, mesh.userface = kind.vertices.ravel(), kind.faces.ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    for name, corners in _hulls(kind, with_hull=with_hull, with_pieces=with_pieces):
        hull = spec.add_mesh(name=name)
        hull.uservert, hull.inertia = corners.ravel(), mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX


def _hulls(part: RigidPart, *, with_hull: bool, with_pieces: bool) -> list[tuple[str, NDArray[np.float64]]]:
    """Names and corners (n, 3) of the convex bodies that a part meets walls and other parts with; a ball has none."""
    if part.corner_radius:
        return []
    meshes = {hull_name(part): part.corners} if with_hull else {}
    if with_pieces:
        meshes |= dict(zip(piece_names(part), part.pieces or (part.corners,), strict=True))
    return list(meshes.items())


def _add_part(
    spec: Any,
    part: RigidPart,
    guide: Guide | None = None,
    timestep: float = math.inf,
) -> Any:
    """Add the body of one part, without geoms, and return it.

    It has a free joint, or on a slide one slide joint with the friction of its own weight, which turns within one
    timestep [s] (MuJoCo's own default would take 20 ms).
    """
    import mujoco

    lift = -part.corners[:, 2].min() + part.corner_radius
    body = spec.worldbody.add_body(name=part.name, pos=[0.0, 0.0, lift])
    _set_inertia(body, part.mass, part.inertia, part.principal_axes)
    if guide and guide.slides:
        body.pos = [*guide.foot, 0.0] + lift / guide.axis[2] * guide.axis
        body.quat = leaning(guide)
        friction = guide.friction * part.mass * GRAVITY * guide.axis[0]
        slide = mujoco.mjtJoint.mjJNT_SLIDE  # its axis is in the body's frame, which leans with the guide
        joint = body.add_joint(name=part.name, type=slide, axis=[0.0, 0.0, 1.0], frictionloss=friction)
        joint.solref_friction, joint.solimp_friction = [0.0, -1.0 / timestep], HARD
    else:
        body.add_freejoint(name=part.name)
    return body


def _add_hulls(body: Any, part: RigidPart, kind: RigidPart, *, with_hull: bool, with_pieces: bool) -> None:
    """Add what a part meets walls and other parts with; it collides only where a pair says so."""
    import mujoco

    mesh_geom = mujoco.mjtGeom.mjGEOM_MESH
    own, meshes = (_hulls(p, with_hull=with_hull, with_pieces=with_pieces) for p in (part, kind))
    for (name, _), (mesh, _) in zip(own, meshes, strict=True):
        body.add_geom(name=name, type=mesh_geom, meshname=mesh, contype=0, conaffinity=0, group=3)


def _add_surface(body: Any, part: RigidPart, kind: RigidPart) -> None:
    """Add the drawn mesh of a part, and a small sphere at each corner; they collide only where a pair says so."""
    import mujoco

    body.add_geom(
        name=f"{part.name}_drawn",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=kind.name,
        contype=0,
        conaffinity=0,
        group=1,
        rgba=[0.85, 0.60, 0.20, 1.0],
    )
    size = [part.corner_radius or CORNER_RADIUS, 0.0, 0.0]
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    for i, corner in enumerate(part.corners):
        body.add_geom(name=corner_name(part, i), type=sphere, size=size, pos=corner, contype=0, conaffinity=0, group=3)


def _pair_with_patch(spec: Any, scene: Scene, part: RigidPart, guide: Guide | None) -> None:
    """Let every corner of a part, or its hull, meet its own patch and nothing else; on a slide without friction."""
    condim = 1 if guide and guide.slides else 3
    settings = scene.scenario.mujoco
    parameters = contact_parameters(scene.scenario.contact, scene.timestep, settings)
    names = [corner_name(part, i) for i in range(len(part.corners))]
    for name in names if settings.contact_set == "corners" else [hull_name(part)]:
        spec.add_pair(name=name, geomname1=f"plate_{part.name}", geomname2=name, condim=condim, **parameters)


def _pair_parts(spec: Any, scene: Scene) -> None:
    """Let all parts meet each other, piece by piece."""
    parameters = contact_parameters(part_contact(scene.scenario.contact), scene.timestep, scene.scenario.mujoco)
    names = [piece_names(part) for part in scene.parts]
    for one, other in itertools.combinations(names, 2):
        for first, second in itertools.product(one, other):
            spec.add_pair(name=f"{first}_{second}", geomname1=first, geomname2=second, condim=3, **parameters)
