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
    """Per corner: height over what it can touch, approach rate, what the surface adds to rate and acceleration bound.

    Then gap and rate to the wall, the contacts of an impact (2 n, 3) with their restitution and friction, the modal
    values, and interpolation weights.
    """

    gap: NDArray[np.float64]
    rate: NDArray[np.float64]
    surface_rate: NDArray[np.float64]
    surface_acceleration: NDArray[np.float64]
    wall_gap: NDArray[np.float64]
    wall_rate: NDArray[np.float64]
    restitution: NDArray[np.float64]
    friction: NDArray[np.float64]
    arm: NDArray[np.float64]
    normal: NDArray[np.float64]
    surface_velocity: NDArray[np.float64]
    q: NDArray[np.float64]
    q_rate: NDArray[np.float64]
    modes: NDArray[np.float64]
    weight_x: NDArray[np.float64]
    weight_y: NDArray[np.float64]


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
    per_corner = [np.zeros(n_corners) for _ in range(6)]
    contacts = [np.zeros(2 * n_corners), np.zeros(2 * n_corners), *(np.zeros((2 * n_corners, 3)) for _ in range(3))]
    modal = [np.zeros(n_shapes), np.zeros(n_shapes), np.zeros((n_shapes, 3)), np.zeros(4), np.zeros(4)]
    return Scratch(*per_corner, *contacts, *modal)


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
