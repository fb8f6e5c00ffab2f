"""What mechanics keeps, read off recorded motion: energy, true speeds, and how deep bodies reach into a plate.

    scene, runs = recorded(scenario)
    energy(scene, runs[0])

Everything comes from shapes, masses and recorded states alone, so nothing here knows how an engine found them. Frames
are taken from the engine in double precision and without the guard, which would end a run that breaks a law.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.protocol import engine_class
from feeder_sim.records.seed import Counts
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Contact, Scenario
from feeder_sim.scenario.engine_choice import choose_engine
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import generator

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
    return scene, [frames for frames, _ in counted(scenario, scene)]


def counted(scenario: Scenario, scene: Scene) -> list[tuple[Frames, Counts]]:
    """The frames of every seed as `recorded`, and what its engine has counted."""
    kind = engine_class(choose_engine(scenario))
    engines = [kind(scene, rng) for rng in (generator(scene, seed) for seed in range(scene.scenario.run.seeds))]
    return [
        (Frames.joined([engine.current(), *_blocks(engine, scene.n_frames - 1)]), engine.counts) for engine in engines
    ]


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


def momentum(scene: Scene, frames: Frames) -> Floats:
    """Of all parts in flight together, without what gravity gives them, shape (n, 3) [kg m/s]."""
    mass = np.array([part.mass for part in scene.parts])
    total = np.einsum("k,nkc->nc", mass, frames.velocity)
    total[:, 2] += mass.sum() * GRAVITY * frames.time
    return np.asarray(total)


def angular_momentum(scene: Scene, frames: Frames) -> Floats:
    """Of all parts together, about their common centre of mass, shape (n, 3) [kg m^2/s]."""
    mass = np.array([part.mass for part in scene.parts])
    share = mass / mass.sum()
    place = frames.position - np.einsum("k,nkc->nc", share, frames.position)[:, None]
    velocity = frames.velocity - np.einsum("k,nkc->nc", share, frames.velocity)[:, None]
    own = sum(_turning(scene, frames, i)[0] for i in range(len(mass)))
    return np.asarray(np.einsum("k,nkc->nc", mass, np.cross(place, velocity)) + own)


def energy(scene: Scene, frames: Frames) -> Floats:
    """Of motion and of height over the resting plate, of every part, shape (n, parts) [J]."""
    weight = GRAVITY * np.array([part.mass for part in scene.parts])
    return kinetic_energy(scene, frames) + weight * frames.position[..., 2]


def growth(scene: Scene, frames: Frames, there: NDArray[np.bool_] | None = None) -> float:
    """The most that all parts together gain after any earlier frame, as the height it would lift them by [m].

    there: parts that count, shape (parts,); all where it is not given.
    """
    counts = np.ones(len(scene.parts), np.bool_) if there is None else there
    total = energy(scene, frames)[:, counts].sum(axis=1)
    gain = float((total - np.minimum.accumulate(total)).max())
    return gain / (GRAVITY * max(np.array([part.mass for part in scene.parts])[counts].sum(), 1e-12))


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
