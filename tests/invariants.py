"""What mechanics keeps, read off recorded motion: energy, momenta, and how deep bodies reach into each other.

    scene, runs = recorded(scenario)
    energy(scene, runs[0])

Everything comes from shapes, masses and recorded states alone, so nothing here knows how an engine found them. Frames
are taken from the engine in double precision and without the guard, which would end a run that breaks a law.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from feeder_sim.engines.lookup import engine_class
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.simulation import generators
from feeder_sim.scenario import Contact, Scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.scene import GRAVITY, Scene, build_scene

Floats = NDArray[np.float64]
DEEPEST = 1e-7  # [m] that a body may be found inside another


def quiet(**contact: Any) -> Contact:
    """A contact without the small random speed of every impact, where the package has one."""
    if "noise_m_s" in Contact.model_fields:
        contact["noise_m_s"] = 0.0
    return Contact(**contact)


def recorded(scenario: Scenario, scene: Scene | None = None) -> tuple[Scene, list[Frames]]:
    """The scene, and the frames of every seed from t = 0 on; `scene` is one that a test has changed."""
    scene = scene or build_scene(scenario)
    kind = engine_class(choose_engine(scenario))
    engines = [kind(scene, rng) for rng in generators(scene)]
    return scene, [Frames.joined([engine.current(), *_blocks(engine, scene.n_frames - 1)]) for engine in engines]


def _blocks(engine: Any, n_frames: int) -> Iterator[Frames]:
    while n_frames > 0:
        block = min(n_frames, engine.frames_per_block)
        n_frames -= block
        yield engine.advance(block)


def attitudes(frames: Frames, part: int) -> Floats:
    """From the axes a part was drawn in to those of the plate, shape (n, 3, 3)."""
    return np.asarray(Rotation.from_quat(frames.quaternion[:, part], scalar_first=True).as_matrix())


def _turning(scene: Scene, frames: Frames, part: int) -> tuple[Floats, Floats]:
    """Angular momentum about the centre of mass (n, 3) [kg m^2/s] and energy of turning (n,) [J] of a part."""
    kind = scene.parts[part]
    axes = attitudes(frames, part) @ Rotation.from_quat(kind.principal_axes, scalar_first=True).as_matrix()
    spin = np.einsum("nji,nj->ni", axes, frames.angular_velocity[:, part])
    return np.einsum("nij,nj->ni", axes, spin * kind.inertia), 0.5 * (spin**2 @ kind.inertia)


def kinetic_energy(scene: Scene, frames: Frames) -> Floats:
    """Of every part, shape (n, parts) [J]."""
    moving = 0.5 * np.array([part.mass for part in scene.parts]) * (frames.velocity**2).sum(axis=2)
    return np.asarray(moving + np.stack([_turning(scene, frames, i)[1] for i in range(len(scene.parts))], axis=1))


def energy(scene: Scene, frames: Frames) -> Floats:
    """Of motion and of height over the resting plate, of every part, shape (n, parts) [J]."""
    weight = GRAVITY * np.array([part.mass for part in scene.parts])
    return kinetic_energy(scene, frames) + weight * frames.position[..., 2]


def growth(scene: Scene, frames: Frames) -> float:
    """The most that all parts together gain after any earlier frame, as the height it would lift them by [m]."""
    total = energy(scene, frames).sum(axis=1)
    gain = float((total - np.minimum.accumulate(total)).max())
    return gain / (GRAVITY * sum(part.mass for part in scene.parts))


def momenta(scene: Scene, frames: Frames) -> tuple[Floats, Floats]:
    """Momentum [kg m/s] and angular momentum about the common centre of mass [kg m^2/s] of all parts, both (n, 3).

    Gravity is taken off: in flight both stay.
    """
    mass = np.array([part.mass for part in scene.parts])
    fallen = -GRAVITY * frames.time[:, None, None] * np.array([0.0, 0.0, 1.0])
    velocity = frames.velocity - fallen
    arm = frames.position - (mass[:, None] * frames.position).sum(axis=1, keepdims=True) / mass.sum()
    turning = sum(_turning(scene, frames, i)[0] for i in range(len(mass)))
    return np.einsum("p,npi->ni", mass, velocity), turning + np.einsum("p,npi->ni", mass, np.cross(arm, velocity))


def speeds_from_poses(frames: Frames) -> tuple[Floats, Floats]:
    """Mean velocities [m/s] and spins [rad/s] between frames, from places and attitudes alone; (n - 1, parts, 3)."""
    interval = np.diff(frames.time)[:, None, None]
    turns = []
    for part in range(frames.position.shape[1]):
        attitude = Rotation.from_quat(frames.quaternion[:, part], scalar_first=True)
        turns.append((attitude[1:] * attitude[:-1].inv()).as_rotvec())
    return np.diff(frames.position, axis=0) / interval, np.stack(turns, axis=1) / interval


def unexplained_speeds(frames: Frames) -> tuple[Floats, Floats]:
    """How much faster parts move [m/s] and turn [rad/s] between frames than recorded; (n - 1, parts).

    With one impact at any time in between, the true mean differs from that of the two recorded velocities by at most
    half their difference. Only what is beyond that counts.
    """
    beyond = []
    for true, said in zip(speeds_from_poses(frames), (frames.velocity, frames.angular_velocity), strict=True):
        off = np.linalg.norm(true - 0.5 * (said[1:] + said[:-1]), axis=2)
        beyond.append(np.maximum(off - 0.5 * np.linalg.norm(np.diff(said, axis=0), axis=2), 0.0))
    return beyond[0], beyond[1]


def _reach(scene: Scene, frames: Frames, part: int, direction: Floats) -> Floats:
    """How far a part reaches along directions (3,) or (n, 3) from the origin [m], shape (n,)."""
    kind = scene.parts[part]
    along = np.einsum("nji,nj->ni", attitudes(frames, part), np.broadcast_to(direction, (len(frames), 3)))
    if kind.circle_radius > 0.0:
        own = kind.circle_radius * np.hypot(along[:, 0], along[:, 1]) + kind.corners[:, 2].max() * np.abs(along[:, 2])
    else:
        own = (along @ kind.corners.T).max(axis=1) + kind.corner_radius
    return np.asarray((frames.position[:, part] * direction).sum(axis=1) + own)


def depth_under(scene: Scene, frames: Frames, height: Floats | float = 0.0) -> Floats:
    """Depth of the lowest point of every part under a level plate, which is at heights (n,) [m]; (n, parts) [m]."""
    down = np.array([0.0, 0.0, -1.0])
    return np.stack([_reach(scene, frames, i, down) + height for i in range(len(scene.parts))], axis=1)


def depth_in_rim(scene: Scene, frames: Frames) -> Floats:
    """How far every part reaches beyond the sides of the plate, where its rim stands, shape (n, parts) [m]."""
    beyond = []
    for axis, length in ((0, scene.surface.length), (1, scene.surface.width)):
        for sign in (1.0, -1.0):
            out = sign * np.eye(3)[axis]
            beyond.append([_reach(scene, frames, i, out) - 0.5 * length for i in range(len(scene.parts))])
    return np.max(beyond, axis=0).T


def depth_in_tube(scene: Scene, frames: Frames) -> Floats:
    """How far the only part, of corners or a ball, reaches into the wall of its tube, shape (n,) [m]."""
    kind, guide = scene.parts[0], scene.guides[0]
    assert guide is not None and guide.radius is not None
    foot = np.array([*guide.foot, 0.0])
    corners = np.einsum("nij,cj->nci", attitudes(frames, 0), kind.corners) + frames.position[:, :1] - foot
    off = corners - (corners @ guide.axis)[..., None] * guide.axis
    return np.asarray(np.linalg.norm(off, axis=2).max(axis=1) + kind.corner_radius - guide.radius)


def depth_of_pairs(scene: Scene, frames: Frames) -> float:
    """The most that two parts reach into each other at any frame, negative if they never touch [m].

    Convex pieces are compared by the distance of the origin from their Minkowski difference, whose faces are exact
    inside. Outside they bound it from below; where that leaves open whether the rounded corners touch, the distance
    is that of least squares with weights that must not be negative (Lawson and Hanson 1974, ch. 23).
    """
    deepest = -np.inf
    for a, b in itertools.combinations(range(len(scene.parts)), 2):
        one, other = scene.parts[a], scene.parts[b]
        apart = np.linalg.norm(frames.position[:, a] - frames.position[:, b], axis=1)
        for row in np.flatnonzero(apart < one.size + other.size):
            pieces = [_placed(scene.parts[i], frames, int(row), i) for i in (a, b)]
            for p, q in itertools.product(*pieces):
                deepest = max(deepest, one.corner_radius + other.corner_radius - _core_distance(p, q))
    return float(deepest)


def _placed(part: RigidPart, frames: Frames, row: int, number: int) -> list[Floats]:
    """Corners (n, 3) of each convex piece of a part at a frame."""
    turn = Rotation.from_quat(frames.quaternion[row, number], scalar_first=True)
    return [turn.apply(points) + frames.position[row, number] for points in part.pieces or (part.corners,)]


def _core_distance(a: Floats, b: Floats) -> float:
    """Signed distance of the hulls of points [m]; beyond 10 um a lower bound of it."""
    points = (a[:, None] - b[None]).reshape(-1, 3)
    if len(points) == 1:
        return float(np.linalg.norm(points[0]))
    if min(len(a), len(b)) > 1 or len(points) > 3:
        outside = float(ConvexHull(points).equations[:, 3].max())
        if outside <= 0.0:  # a facet with a negative offset has the origin inside
            return outside
        if outside > 1e-5 and min(len(a), len(b)) > 1:
            return outside
    scale = np.linalg.norm(points, axis=1).min()
    weight, _ = nnls(
        np.vstack([points.T / scale, np.ones(len(points))]), np.array([0.0, 0.0, 0.0, 1.0]), maxiter=10_000
    )
    return float(np.linalg.norm(points.T @ weight) / weight.sum())
