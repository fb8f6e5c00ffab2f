"""What the impulse engine works on: parts, their motion, walls and scratch space as compiled code takes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from feeder_sim.engines.free_flight import rotate_freely, symmetry_axis
from feeder_sim.guide import Guide
from feeder_sim.mjcf import CORNER_RADIUS
from feeder_sim.scene import GRAVITY, Scene

GAP, RATE, SURFACE_RATE, SURFACE_ACCELERATION, WALL_GAP, WALL_RATE = range(6)  # columns of Scratch.corner
ARM, NORMAL, VELOCITY = range(3)  # of Scratch.contact
RESTITUTION, FRICTION = range(2)  # of Scratch.law
RIM_HEIGHT, RIM_THICKNESS = 0.5, 0.02  # [m]; above and below the plate


class Body(NamedTuple):
    """One part: mass [kg], principal inertia (3,), symmetry axis, corners (n, 3) [m] with a radius, their reach."""

    mass: float
    inertia: NDArray[np.float64]
    axis: int
    corners: NDArray[np.float64]
    radius: float
    reach: float
    restitution: float
    friction: float


class Kinds(NamedTuple):
    """All kinds of parts, one behind the other; a kind of infinite mass stands still.

    Attributes:
        mass [kg], inertia (kinds, 3), axis, radius, reach [m]: as in `Body`, of each kind.
        corners: of all kinds, shape (n, 3) [m]; those of kind k are first_corner[k] to first_corner[k + 1].
        edges: of the hulls, pairs of corners counted from the first of their kind, shape (m, 2); first_edge as above.
        planes: of the hulls' faces, (outward unit normal, offset) with normal . x + offset <= 0 inside, shape (f, 4);
            first_plane as above.
        law: (2, 2), RESTITUTION and FRICTION of contacts with the plate (0) and between parts (1).
    """

    mass: NDArray[np.float64]
    inertia: NDArray[np.float64]
    axis: NDArray[np.int64]
    radius: NDArray[np.float64]
    reach: NDArray[np.float64]
    first_corner: NDArray[np.int64]
    corners: NDArray[np.float64]
    first_edge: NDArray[np.int64]
    edges: NDArray[np.int64]
    first_plane: NDArray[np.int64]
    planes: NDArray[np.float64]
    law: NDArray[np.float64]


class Parts(NamedTuple):
    """State of all parts in world axes, each at a time of its own: `clock` [s].

    position, velocity, momentum (n, 3), attitude (n, 3, 3) as in `Motion`; kind (n,); there (n,): 1 while the part is
    in the scene.
    """

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    attitude: NDArray[np.float64]
    momentum: NDArray[np.float64]
    clock: NDArray[np.float64]
    kind: NDArray[np.int64]
    there: NDArray[np.int8]


class Motion(NamedTuple):
    """State of one part in world axes: position, velocity, attitude (columns: body axes), angular momentum."""

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
    """What the surface can do at most within a window of time.

    crest: height [m]; acceleration: of every mode shape at its antinode [m/s^2]; speed: of any point [m/s]; step: the
    shortest flight [s] that is followed, and rest_step that of a part that hardly moves.
    """

    crest: float
    acceleration: NDArray[np.float64]
    speed: float
    step: float
    rest_step: float


class Scratch(NamedTuple):
    """Few arrays, since every one of them makes each call of a compiled function dearer.

    corner: (n, 6), columns GAP over what it can touch, RATE of approach, what the surface adds to rate and acceleration
    bound, WALL_GAP, WALL_RATE. contact: (3, 2 n, 3), ARM, NORMAL and surface VELOCITY of each contact of an impact.
    law: (2, 2 n), RESTITUTION and FRICTION of each. modal: (2, n_shapes), q and dq/dt. modes: (n_shapes, 3). weight:
    (2, 4) of the interpolation in x and y. points: (n, 3), corners and crossings of hull edges with the plate's edge.
    """

    corner: NDArray[np.float64]
    contact: NDArray[np.float64]
    law: NDArray[np.float64]
    modal: NDArray[np.float64]
    modes: NDArray[np.float64]
    weight: NDArray[np.float64]
    points: NDArray[np.float64]


def read_kinds(scene: Scene) -> Kinds:
    """Collect the kinds of parts; with a rim, a last one for its walls, see `rim_walls`.

    Spheres at the corners of MuJoCo's parts have a radius of a micrometre; so have the parts here, and both engines
    simulate the same thing.
    """
    kinds, contact = scene.kinds, scene.scenario.contact
    mass = [kind.mass for kind in kinds]
    inertia = [kind.inertia for kind in kinds]
    corners = [np.asarray(kind.corners, float) for kind in kinds]
    edges = [hull_edges(points) for points in corners]
    planes = [hull_planes(points) for points in corners]
    radius = [kind.corner_radius or CORNER_RADIUS for kind in kinds]
    if scene.rim:
        mass.append(np.inf)
        inertia.append(np.full(3, np.inf))
        corners.append(_rim_box(scene))
        edges.append(np.empty((0, 2), np.int64))
        planes.append(hull_planes(corners[-1]))
        radius.append(0.0)
    return Kinds(
        mass=np.array(mass),
        inertia=np.array(inertia),
        axis=np.array([symmetry_axis(moments) for moments in inertia]),
        radius=np.array(radius),
        reach=np.array([np.linalg.norm(points, axis=1).max() for points in corners]),
        first_corner=np.cumsum([0, *(len(points) for points in corners)]),
        corners=np.concatenate(corners),
        first_edge=np.cumsum([0, *(len(lines) for lines in edges)]),
        edges=np.concatenate(edges),
        first_plane=np.cumsum([0, *(len(faces) for faces in planes)]),
        planes=np.concatenate(planes),
        law=np.array([[contact.restitution, contact.part_restitution], [contact.friction, contact.part_friction]]),
    )


def hull_edges(corners: NDArray[np.float64]) -> NDArray[np.int64]:
    """Edges of the convex hull of corners (n, 3), as pairs of indices (m, 2); none for fewer than four corners."""
    if len(corners) < 4:
        return np.empty((0, 2), np.int64)
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    sides = np.sort(np.concatenate([hull.simplices[:, [0, 1]], hull.simplices[:, [1, 2]], hull.simplices[:, [2, 0]]]))
    return np.unique(sides, axis=0).astype(np.int64)


def hull_planes(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Planes of the faces of the convex hull of corners (n, 3), shape (f, 4); none for fewer than four corners."""
    if len(corners) < 4:
        return np.empty((0, 4))
    from scipy.spatial import ConvexHull

    size = np.abs(corners).max()
    return np.unique((ConvexHull(corners / size).equations * [1.0, 1.0, 1.0, size]).round(12), axis=0)


def _rim_box(scene: Scene) -> NDArray[np.float64]:
    """Corners (8, 3) of a box that is a wall along any side of the plate."""
    long = 0.5 * max(scene.surface.length, scene.surface.width) + RIM_THICKNESS
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return signs * [long, 0.5 * RIM_THICKNESS, RIM_HEIGHT]


def rim_walls(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (walls, 3) [m] and attitudes (walls, 3, 3) of the walls of a rim; none without one."""
    if not scene.rim:
        return np.empty((0, 3)), np.empty((0, 3, 3))
    x, y = 0.5 * (scene.surface.length + RIM_THICKNESS), 0.5 * (scene.surface.width + RIM_THICKNESS)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    centres = np.array([[0.0, y, 0.0], [0.0, -y, 0.0], [x, 0.0, 0.0], [-x, 0.0, 0.0]])
    return centres, np.array([np.eye(3), np.eye(3), quarter, quarter])


def read_wall(guide: Guide | None) -> Wall:
    """The wall of a guide with play."""
    if guide is None or guide.radius is None or guide.restitution is None:
        return Wall(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.inf, 0.0, 0.0)
    return Wall(np.array([*guide.foot, 0.0]), guide.axis, guide.radius, guide.restitution, guide.friction)


def new_scratch(kinds: Kinds, n_shapes: int) -> Scratch:
    """Room for any part: each of its corners can touch plate and wall, each of its edges the edge of the plate."""
    n = int((np.diff(kinds.first_corner) + 2 * np.diff(kinds.first_edge)).max())
    sizes = ((n, 6), (3, 2 * n, 3), (2, 2 * n), (2, n_shapes), (n_shapes, 3), (2, 4), (n, 3))
    return Scratch(*(np.zeros(size) for size in sizes))


@njit(cache=True, nogil=True, error_model="numpy")
def body_of(kinds, k):
    """The kind k as a `Body`."""
    corners = kinds.corners[kinds.first_corner[k] : kinds.first_corner[k + 1]]
    return Body(
        kinds.mass[k],
        kinds.inertia[k],
        kinds.axis[k],
        corners,
        kinds.radius[k],
        kinds.reach[k],
        kinds.law[RESTITUTION, 0],
        kinds.law[FRICTION, 0],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def motion_of(parts, i):
    """The state of part i as a `Motion`; changing it changes the part."""
    return Motion(parts.position[i], parts.velocity[i], parts.attitude[i], parts.momentum[i])


@njit(cache=True, nogil=True, error_model="numpy")
def fly(motion, inertia, axis, duration):
    """Free flight over a duration [s], in place."""
    for k in range(3):
        motion.position[k] += motion.velocity[k] * duration
    motion.position[2] -= 0.5 * GRAVITY * duration * duration
    motion.velocity[2] -= GRAVITY * duration
    rotate_freely(motion.attitude, motion.momentum, inertia, axis, duration)


@njit(cache=True, nogil=True, error_model="numpy")
def fly_to(parts, kinds, i, t):
    """Bring part i to time t [s]."""
    duration, k = t - parts.clock[i], parts.kind[i]
    parts.clock[i] = t
    if duration > 0.0 and kinds.mass[k] < np.inf:
        fly(motion_of(parts, i), kinds.inertia[k], kinds.axis[k], duration)


@njit(cache=True, nogil=True, error_model="numpy")
def invert_inertia(attitude, inertia, out):
    """Write the inverse inertia tensor in world axes into out (3, 3) [1/(kg m^2)]; zero for infinite inertia."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0
            for k in range(3):
                out[i, j] += attitude[i, k] * attitude[j, k] / inertia[k]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
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
