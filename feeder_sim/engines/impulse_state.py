"""What the impulse engine works on: part, motion, wall and scratch space as compiled code takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from feeder_sim.engines.free_flight import symmetry_axis
from feeder_sim.guide import Guide
from feeder_sim.mjcf import build_mjcf
from feeder_sim.scene import Scene

GAP, RATE, SURFACE_RATE, SURFACE_ACCELERATION, WALL_GAP, WALL_RATE = range(6)  # columns of Scratch.corner
ARM, NORMAL, VELOCITY = range(3)  # of Scratch.contact
RESTITUTION, FRICTION = range(2)  # of Scratch.law
BEAT = 1e-4  # relative; damping alone shifts the frequency of the transient by a hundredth of this


class Body(NamedTuple):
    """The part: mass [kg], principal inertia (3,), symmetry axis, corners (n, 3) [m] with a radius, contact."""

    mass: float
    inertia: NDArray[np.float64]
    axis: int
    corners: NDArray[np.float64]
    radius: float
    reach: float
    restitution: float
    friction: float


class Motion(NamedTuple):
    """State of the part in world axes: position, velocity, attitude (columns: body axes), angular momentum."""

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    attitude: NDArray[np.float64]
    momentum: NDArray[np.float64]


class Wall(NamedTuple):
    """The wall of a tube: a point of its axis [m], unit vector along it, inner radius [m]; infinite without a tube."""

    foot: NDArray[np.float64]
    axis: NDArray[np.float64]
    radius: float
    restitution: float
    friction: float


class Bounds(NamedTuple):
    """What the surface can do at most: height [m], and per mode shape the acceleration at its antinode [m/s^2]."""

    crest: float
    acceleration: NDArray[np.float64]


class Scratch(NamedTuple):
    """Few arrays, since every one of them makes each call of a compiled function dearer.

    corner: (n, 6), columns GAP over what it can touch, RATE of approach, what the surface adds to rate and acceleration
    bound, WALL_GAP, WALL_RATE. contact: (3, 2 n, 3), ARM, NORMAL and surface VELOCITY of each contact of an impact.
    law: (2, 2 n), RESTITUTION and FRICTION of each. modal: (2, n_shapes), q and dq/dt. modes: (n_shapes, 3). weight:
    (2, 4) of the interpolation in x and y.
    """

    corner: NDArray[np.float64]
    contact: NDArray[np.float64]
    law: NDArray[np.float64]
    modal: NDArray[np.float64]
    modes: NDArray[np.float64]
    weight: NDArray[np.float64]


def read_body(scene: Scene) -> Body:
    """Read the part back from the compiled scene, so that both engines simulate the same thing."""
    model = build_mjcf(scene).compile()
    name = scene.parts[0].name
    part = model.body(name)
    with_plate = model.pair_geom1 == model.geom(f"plate_{name}").id
    geoms = model.pair_geom2[with_plate]
    corners = np.ascontiguousarray(model.geom_pos[geoms])
    radius = float(model.geom_size[geoms[0], 0])
    inertia = np.array(part.inertia, float)
    return Body(
        mass=float(part.mass[0]),
        inertia=inertia,
        axis=symmetry_axis(inertia),
        corners=corners,
        radius=radius,
        reach=float(np.linalg.norm(corners, axis=1).max()),
        restitution=scene.scenario.contact.restitution,
        friction=float(model.pair_friction[with_plate][0, 0]),
    )


def read_wall(guide: Guide | None) -> Wall:
    """The wall of a guide with play."""
    if guide is None or guide.radius is None or guide.restitution is None:
        return Wall(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.inf, 0.0, 0.0)
    return Wall(np.array([*guide.foot, 0.0]), guide.axis, guide.radius, guide.restitution, guide.friction)


def bound_surface(scene: Scene) -> Bounds:
    """Largest envelope of every modal coordinate over the run, sampled well below the ring-up time, plus 1 %.

    Where terms of different frequencies beat, sampling could miss the peak: there the moduli are added up.
    """
    surface, duration = scene.surface, scene.scenario.run.duration_s
    terms = surface.terms
    fade = np.abs(terms.rate.real).max(initial=0.0)
    n = int(min(200_000, 1000 + 20 * duration * fade))
    edges = np.concatenate([terms.start, terms.stop[np.isfinite(terms.stop)]])
    times = np.unique(np.concatenate([np.linspace(0.0, duration, n), edges]))
    envelope = 1.01 * np.abs(terms.phasor(times, surface.n_shapes)).max(axis=0)
    for shape in range(surface.n_shapes):
        of_shape = terms.shape == shape
        frequencies = np.abs(terms.rate.imag[of_shape])
        if np.ptp(frequencies) > BEAT * frequencies.max():
            envelope[shape] = np.abs(terms.coefficient[of_shape]).sum()
    antinode = np.abs(surface.table[..., 0]).max(axis=(1, 2))
    squared = np.array([(terms.rate.imag[terms.shape == j] ** 2).max() for j in range(surface.n_shapes)])
    return Bounds(crest=float(envelope @ antinode), acceleration=envelope * squared)


def new_scratch(n_corners: int, n_shapes: int) -> Scratch:
    """Room for a part with that many corners: each can touch plate and wall."""
    n = 2 * n_corners
    sizes = ((n_corners, 6), (3, n, 3), (2, n), (2, n_shapes), (n_shapes, 3), (2, 4))
    return Scratch(*(np.zeros(size) for size in sizes))


@njit(cache=True, nogil=True, error_model="numpy")
def point(motion, body, i, k):
    """Coordinate k of corner i in space [m]."""
    value = motion.position[k]
    for axis in range(3):
        value += motion.attitude[k, axis] * body.corners[i, axis]
    return value


@njit(cache=True, nogil=True, error_model="numpy")
def spin_of(motion, body, spin):
    """Write the angular velocity in world axes [rad/s] into spin (3,)."""
    spin[:] = 0.0
    for axis in range(3):
        along = 0.0
        for k in range(3):
            along += motion.attitude[k, axis] * motion.momentum[k]
        for k in range(3):
            spin[k] += motion.attitude[k, axis] * along / body.inertia[axis]
