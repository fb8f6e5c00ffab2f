"""Scenario -> scene: the moving surface, the parts, and the MJCF that combines them.

MuJoCo has no deformable kinematic surface, so each part meets a *tangent patch* of its own: a plate-sized box on a
vertical slide and two hinges in the plate's mid-plane, massive enough not to feel the part, placed at every step on
the tangent plane of the surface under the part's centre and given the surface's velocity there. The hinges at
mid-plane make the horizontal surface velocity -h/2 beta' by themselves.

Contact set: one small sphere at each corner of the part against its patch, as explicit pairs. (MuJoCo's own prism-box
contact keeps four of six corners and makes a flat drop spin.) Restitution: `solref = "0 -(1+e)/dt"` reverses the
normal velocity within one step, `solreffriction = "0 -1/dt"` keeps the restitution out of the tangential direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.parts import RigidPart, build_part
from feeder_sim.plate.assembly import DrivenMode, assemble_plate
from feeder_sim.plate.surface import Surface
from feeder_sim.scenario import Contact, Scenario, Start

GRAVITY = 9.81  # [m/s^2]

PATCH_MASS_RATIO = 1e6  # patch over part: the part moves its patch by a millionth of its own motion
CORNER_RADIUS = 1e-6  # [m]; the part rides this much higher everywhere, its shape is unchanged
IMPEDANCE = 0.9999  # MuJoCo's largest: contacts as hard as the solver allows
# MuJoCo stops its solver by a cost scaled with the trace of the inertia matrix, which the heavy patches inflate.
# Scaled back to the part, this is MuJoCo's own default; with the raw default the drift comes out 20 % too fast or
# not, depending on the unit system (README, design notes).
SOLVER_TOLERANCE = 1e-8


@dataclass(frozen=True)
class Scene:
    """Everything an engine needs, in SI units; the top of the resting plate is z = 0.

    Attributes:
        scenario: what it was made from.
        surface: the moving surface.
        driven: the driven modes, one per drive.
        parts: the rigid parts.
        timestep: [s].
        steps_per_frame: solver steps between two recorded frames.
    """

    scenario: Scenario
    surface: Surface
    driven: tuple[DrivenMode, ...]
    parts: tuple[RigidPart, ...]
    timestep: float
    steps_per_frame: int

    @property
    def frame_interval(self) -> float:
        """Time between recorded frames [s]."""
        return self.timestep * self.steps_per_frame

    @property
    def n_frames(self) -> int:
        """Recorded frames of a full-length run, the first at t = 0."""
        return 1 + math.floor(self.scenario.run.duration_s / self.frame_interval + 1e-9)

    @property
    def n_steps(self) -> int:
        """Solver steps of a full-length run."""
        return (self.n_frames - 1) * self.steps_per_frame


@dataclass(frozen=True)
class Pose:
    """Where a part starts, at rest.

    Attributes:
        position: of the centre of mass, shape (3,) [m].
        quaternion: shape (4,), w first.
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]


def build_scene(scenario: Scenario) -> Scene:
    """Resolve a scenario.

    Raises:
        InputError: the plate, a drive, a part or a start cannot be had.
    """
    plate = assemble_plate(scenario)
    parts = tuple(build_part(spec, name=f"part_{i}") for i, spec in enumerate(scenario.part))
    for i, spec in enumerate(scenario.part):
        _check_on_plate(spec.start, plate.surface, f"part[{i}].start.position_mm")
    run = scenario.run
    timestep = 1.0 / (scenario.highest_frequency_hz * run.steps_per_period)
    steps_per_frame = max(1, round(1.0 / (run.frames_per_second * timestep)))
    scene = Scene(scenario, plate.surface, plate.driven, parts, timestep, steps_per_frame)
    if scene.n_frames < 2:
        raise InputError(
            f"is {run.duration_s:g}, allowed is at least one frame, {scene.frame_interval:g} s", key="run.duration_s"
        )
    return scene


def _check_on_plate(start: Start, surface: Surface, key: str) -> None:
    x, y = start.position_mm
    half = (0.5e3 * surface.length, 0.5e3 * surface.width)
    if abs(x) > half[0] or abs(y) > half[1]:
        raise InputError(f"is [{x:g}, {y:g}], allowed is +-{half[0]:.1f}, +-{half[1]:.1f} (on the plate)", key=key)


def start_poses(scene: Scene, rng: np.random.Generator) -> list[Pose]:
    """Draw the start of every part: tilt about a random horizontal axis after a yaw, lowest point at drop height."""
    poses = []
    for spec, part in zip(scene.scenario.part, scene.parts, strict=True):
        start = spec.start
        yaw, tilt = np.radians(rng.uniform(*start.yaw_deg)), np.radians(rng.uniform(*start.tilt_deg))
        direction = rng.uniform(0.0, 2.0 * np.pi)
        drop = 1e-3 * rng.uniform(*start.drop_height_mm)
        quaternion = _tilted(yaw, tilt, direction)
        lowest = _rotated(part.corners, quaternion)[:, 2].min() - part.corner_radius
        x, y = (1e-3 * c for c in start.position_mm)
        poses.append(Pose(np.array([x, y, drop - lowest]), quaternion))
    return poses


def _tilted(yaw: float, tilt: float, direction: float) -> NDArray[np.float64]:
    """Quaternion of a yaw about z followed by a tilt about the horizontal axis at angle `direction`."""
    from scipy.spatial.transform import Rotation

    axis = tilt * np.array([np.cos(direction), np.sin(direction), 0.0])
    turned = Rotation.from_rotvec(axis) * Rotation.from_rotvec([0.0, 0.0, yaw])
    return np.asarray(turned.as_quat(scalar_first=True))


def _rotated(points: NDArray[np.float64], quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternion, scalar_first=True).apply(points))


def contact_parameters(contact: Contact, timestep: float) -> dict[str, list[float]]:
    """MuJoCo's pair attributes for a contact model at a timestep [s]."""
    friction = [contact.friction, contact.friction, 0.0, 0.0, 0.0]
    if contact.time_constant_us is not None:
        solref, solreffriction = [contact.time_constant_us * 1e-6, contact.damping_ratio], [0.0, 0.0]
    else:
        solref, solreffriction = [0.0, -(1.0 + contact.restitution) / timestep], [0.0, -1.0 / timestep]
    return {
        "friction": friction,
        "solref": solref,
        "solreffriction": solreffriction,
        "solimp": [IMPEDANCE, IMPEDANCE, 1e-3, 0.5, 2.0],
    }


def build_mjcf(scene: Scene) -> Any:
    """Build the MjSpec of a scene: patches first, then parts in order, each with a free joint.

    Returns:
        mujoco.MjSpec. Compile it from memory; its `to_xml()` rounds to six digits and is the readable copy.
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = scene.scenario.title or "feeder_sim"
    option = spec.option
    option.timestep = scene.timestep
    option.gravity = [0.0, 0.0, -GRAVITY]
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # divergence is for the guard to see
    _draw_surroundings(spec, scene.surface)
    part_trace = patch_trace = 0.0
    for part in scene.parts:
        patch_trace += _add_patch(spec, scene, part)
        part_trace += 3.0 * part.mass + part.inertia.sum()
    for part in scene.parts:
        _add_part(spec, part)
        _pair_with_patch(spec, scene, part)
    option.tolerance = SOLVER_TOLERANCE * part_trace / (part_trace + patch_trace)
    return spec


def _draw_surroundings(spec: Any, surface: Surface) -> None:
    """Camera and light; collides with nothing."""
    extent = max(surface.length, surface.width)
    spec.stat.extent, spec.stat.center = 0.6 * extent, [0.0, 0.0, 0.0]
    spec.visual.headlight.ambient = spec.visual.headlight.diffuse = [0.3, 0.3, 0.3]
    spec.worldbody.add_light(pos=[0.0, -extent, 2.0 * extent], dir=[0.0, 0.4, -1.0], diffuse=[0.4, 0.4, 0.4])


def _add_patch(spec: Any, scene: Scene, part: RigidPart) -> float:
    """Add the tangent patch of one part; returns the trace of its inertia matrix.

    Without in-plane velocity the hinges lie in the top surface, which then tilts as before but does not slide.
    """
    import mujoco

    surface = scene.surface
    top = 0.5 * surface.thickness if scene.scenario.run.in_plane_velocity else 0.0  # above the hinges
    mass = PATCH_MASS_RATIO * part.mass
    moment = mass * (0.5 * max(surface.length, surface.width)) ** 2
    # Its acceleration within a step must be zero: its motion is prescribed, gravity included.
    body = spec.worldbody.add_body(name=f"plate_{part.name}", pos=[0.0, 0.0, -top], gravcomp=1.0)
    _set_inertia(body, mass, [moment, moment, moment])
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    body.add_joint(name=f"lift_{part.name}", type=slide, axis=[0, 0, 1])
    body.add_joint(name=f"tilt_x_{part.name}", type=hinge, axis=[1, 0, 0])
    body.add_joint(name=f"tilt_y_{part.name}", type=hinge, axis=[0, 1, 0])
    body.add_geom(
        name=f"plate_{part.name}",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.5 * surface.length, 0.5 * surface.width, 0.5 * surface.thickness],
        pos=[0.0, 0.0, top - 0.5 * surface.thickness],
        contype=0,
        conaffinity=0,
        rgba=[0.75, 0.77, 0.80, 1.0],
    )
    return mass + 2.0 * moment


def _set_inertia(body: Any, mass: float, inertia: Any) -> None:
    # An MjsBody whose ipos is left alone gets its centre of mass at the body's own `pos`, not at its origin.
    body.explicitinertial, body.mass, body.inertia = True, mass, inertia
    body.ipos, body.iquat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]


def build_part_mjcf(part: RigidPart) -> Any:
    """Build the MjSpec of a part alone, for use in scenes of one's own: body, drawn mesh and contact corners."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.modelname = part.name
    _add_part(spec, part)
    return spec


def _add_part(spec: Any, part: RigidPart) -> None:
    """Add one free part: drawn mesh, and a small sphere at each corner that collides only where a pair says so."""
    import mujoco

    lift = -part.corners[:, 2].min() + part.corner_radius
    body = spec.worldbody.add_body(name=part.name, pos=[0.0, 0.0, lift])
    _set_inertia(body, part.mass, part.inertia)
    body.add_freejoint(name=part.name)
    mesh = spec.add_mesh(name=part.name)
    mesh.uservert, mesh.userface = part.vertices.ravel(), part.faces.ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    body.add_geom(
        name=f"{part.name}_drawn",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=part.name,
        contype=0,
        conaffinity=0,
        group=1,
        rgba=[0.85, 0.60, 0.20, 1.0],
    )
    size = [part.corner_radius or CORNER_RADIUS, 0.0, 0.0]
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    for i, corner in enumerate(part.corners):
        body.add_geom(name=_corner_name(part, i), type=sphere, size=size, pos=corner, contype=0, conaffinity=0, group=3)


def _pair_with_patch(spec: Any, scene: Scene, part: RigidPart) -> None:
    """Let every corner of a part meet the part's own patch, and nothing else."""
    parameters = contact_parameters(scene.scenario.contact, scene.timestep)
    for i in range(len(part.corners)):
        name = _corner_name(part, i)
        spec.add_pair(name=name, geomname1=f"plate_{part.name}", geomname2=name, condim=3, **parameters)


def _corner_name(part: RigidPart, i: int) -> str:
    return f"{part.name}_corner_{i}"
