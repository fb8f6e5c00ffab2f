"""The compiled pass of the guard: energy, speed and depth of every part at every frame, and what they must not be."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.surface_arrays import OutlineArrays, SurfaceArrays, edge_distance, off_plate
from feeder_sim.machine_code import borrow, entry_point, inlined, uncounted
from feeder_sim.plate.compiled import (
    BETA_X,
    BETA_Y,
    W,
    cubic_weights,
    grid_cell,
    interpolate,
    modal_motion,
    surface_modes,
)


class EnergyLimit(NamedTuple):
    """What bounds the energy of a part.

    plate_speed: largest of the surface [m/s]; start_speed: largest of a part that falls from where it starts [m/s];
    restitution [1]; factor: allowed over what the plate can give.
    """

    plate_speed: float
    start_speed: float
    restitution: float
    factor: float


@inlined
def energy_of(mass, inertia, height, velocity, spin, turned):
    """Kinetic energy of translation and spin, and potential energy over the resting plate [J], of one part.

    turned: its rotation matrix, row by row; spin in world axes.
    """
    energy = 0.5 * mass * (velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2) + mass * GRAVITY * height
    for axis in range(3):
        about = 0.0
        for k in range(3):
            about += turned[k][axis] * spin[k]
        energy += 0.5 * inertia[axis] * about * about
    return energy


@inlined
def largest_energy(mass, t, limit):
    """Largest energy [J] that a part may have at time t [s], of its start and of the plate.

    A part that meets a plate of speed u at its fastest at every impact has v = e v + (1 + e) u in the end, which is
    v = u (1 + e) / (1 - e). For e -> 1 that is without limit, but takes time: the mean force between plate and part
    is the weight, so that the plate gives m g u t until the time t, and m u v for the momentum that the part still
    has. With the energy m v^2 / 2 this makes v^2 = 2 u (v + g t). The smaller of both speeds counts.
    """
    speed, e = limit.plate_speed, limit.restitution
    from_plate = speed + math.sqrt(speed * speed + 2.0 * GRAVITY * speed * t)
    if e < 1.0:
        from_plate = min(from_plate, speed * (1.0 + e) / (1.0 - e))
    return limit.factor * 0.5 * mass * (from_plate + limit.start_speed) ** 2


# Where parts are relative to the edge of the plate: over it, clear of the edge, fallen beside it, or lost.
#
# The sides of the plate stop nothing. A part that tips over the edge may swing under the plate by twice its size until
# the next frame, and go on falling below the plate. So a part that has once come down beside the plate counts as
# *fallen* until it rises above the resting surface again. It is *lost* once it is off the plate and below the floor
# level.


class Edge(NamedTuple):
    """The edge of a plate and what is around it.

    half_x, half_y: half the sides [m]; crest: largest height of the surface over the resting plate [m]; floor: its
    height [m]; rim: no part gets beside the plate; enclosed: no part can get over the edge; swing: by how much a part
    may swing under the plate [m]; frame_interval [s]; outline: of a plate that is no whole rectangle, else None.
    """

    half_x: float
    half_y: float
    crest: float
    floor: float
    rim: bool
    enclosed: bool
    swing: float
    frame_interval: float
    outline: OutlineArrays | None


@inlined
def over_plate(x, y, edge):
    """Whether a place is above or below the area of the plate."""
    return abs(x) < edge.half_x and abs(y) < edge.half_y and not off_plate(edge.outline, x, y)


@inlined
def clear_of_edge(x, y, velocity_x, velocity_y, size, edge):
    """Whether a part is so far from the edge that it cannot have been over it since the last frame."""
    margin_x = margin_y = size
    if not edge.enclosed:
        margin_x = edge.swing + abs(velocity_x) * edge.frame_interval
        margin_y = edge.swing + abs(velocity_y) * edge.frame_interval
    margin = max(margin_x, margin_y)
    far = edge_distance(edge.outline, x, y, margin) > margin
    return abs(x) < edge.half_x - margin_x and abs(y) < edge.half_y - margin_y and far


@inlined
def has_fallen(z, clear, before, edge):
    """Whether a part has come down beside the plate and not risen above it since; before: at the frame before."""
    return not edge.rim and ((before and z < 0.0) or (z < -edge.crest and not clear))


Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
POSITION, QUATERNION, VELOCITY, SPIN, END = 0, 3, 7, 10, 13  # where each begins in the columns of `Motion.state`
ENERGY, MOST_ENERGY, SPEED, DEPTH, ALLOWED = range(5)  # columns of `States.value`
CLEAR, FALLEN, LOST, VIOLATION = range(4)  # columns of `States.mark`
FINE, NOT_FINITE, THROUGH_PLATE, TOO_MUCH_ENERGY, TOO_DEEP = range(5)  # in the order in which they count in a frame


class Motion(NamedTuple):
    """Frames as the pass takes them.

    time: (n,) [s]; state: position, quaternion, velocity and angular velocity of every part (n, parts, 13), in columns
    POSITION to SPIN; present: (n, parts).
    """

    time: Floats
    state: Floats
    present: Flags


class Bodies(NamedTuple):
    """Mass [kg], principal inertia (parts, 3) [kg m^2], size and corner radius [m] of every part; which rows of
    `corners` (m, 3) [m] it has.
    """

    mass: Floats
    inertia: Floats
    size: Floats
    radius: Floats
    corner_from: NDArray[np.int64]
    corner_to: NDArray[np.int64]
    corners: Floats


class DepthLimit(NamedTuple):
    """How deep a corner may be: see `_allowed_depth`.

    least: [m]; steps: times the speed of the part [s]; heap: added for several parts [m]; time_constant [s] and
    damping_ratio of compliant contact, 0 without.
    """

    least: float
    steps: float
    heap: float
    time_constant: float
    damping_ratio: float


class Limits(NamedTuple):
    """What the states must keep to; antinode: largest deflection of every mode shape (n_shapes,) [1]."""

    bodies: Bodies
    surface: SurfaceArrays
    antinode: Floats
    edge: Edge
    energy: EnergyLimit
    depth: DepthLimit


class States(NamedTuple):
    """What is found about each part at each of n frames; the first row is of the frame before them.

    value: (n + 1, parts, 5), in columns: energy of motion, spin and height over the resting plate [J]; the most that it
    may be; largest speed of a point of the part against the plate after a fall from its height [m/s]; depth of its
    deepest corner below the surface, 0 above it and near the edge [m]; the depth that is allowed.
    mark: (n + 1, parts, 4), in columns: whether it is away from the edge, and not too deep; has fallen; is lost, as in
    plate_edge.py; which violation it is, FINE to TOO_DEEP.
    """

    value: Floats
    mark: NDArray[np.int8]

    def first(self, n: int) -> States:
        """The first n rows."""
        return States(self.value[:n], self.mark[:n])

    def of_frames(self, column: int) -> Floats:
        """One of the values at every frame, shape (n, parts)."""
        return self.value[1:, :, column]


def new_states(n: int, before: States) -> States:
    """Room for the states of n frames, after the last row of `before`."""
    states = no_states(n + 1, before.value.shape[1])
    states.value[0], states.mark[0] = before.value[-1], before.mark[-1]
    return states


def no_states(n: int, parts: int) -> States:
    """States of n frames before a start."""
    return States(np.zeros((n, parts, 5)), np.zeros((n, parts, 4), np.int8))


@entry_point
def check_states(motion, limits, states, everything):
    """Fill the states of a block of frames, up to the first frame with a violation; returns its row, n without one.

    Args:
        motion: the frames, n of them.
        limits: what they must keep to.
        states: are filled after the row of the frame before.
        everything: go on after a violation, and find all depths; else only those that are too large, which saves most
            of the work.
    """
    n_shapes = limits.antinode.shape[0]
    modal, modes = np.empty((2, n_shapes)), np.empty((n_shapes, 3))
    return _check_frames(motion, limits, states, borrow(modal), borrow(modes), everything)


@uncounted
def _check_frames(motion, limits, states, modal, modes, everything):
    """As `check_states`, with room for modal coordinates and their rates, and for the shapes under a centre."""
    n, n_parts = motion.present.shape
    bodies, surface, edge, value, mark = limits.bodies, limits.surface, limits.edge, states.value, states.mark
    for row in range(n):
        time, now = motion.time[row], row + 1  # in the states
        fastest = _find_speeds(motion.state[row], motion.present[row], bodies.size, edge, limits.energy, value, row)
        moved, ends = False, False
        for i in range(n_parts):
            state, before = motion.state[row, i], mark[row, i]
            (x, y, z), v, spin = _vector(state, POSITION), _vector(state, VELOCITY), _vector(state, SPIN)
            present, finite, over = motion.present[row, i], _is_finite(state), over_plate(x, y, edge)
            clear = clear_of_edge(x, y, v[0], v[1], bodies.size[i], edge)
            fallen = has_fallen(z, clear, before[FALLEN] != 0, edge)
            turned = _rotation(state)
            energy = energy_of(bodies.mass[i], bodies.inertia[i], z, v, spin, turned)
            most = largest_energy(bodies.mass[i], time, limits.energy)
            allowed = _allowed_depth(max(value[now, i, SPEED], value[row, i, SPEED]), fastest, limits.depth)
            depth = 0.0
            if present and clear and finite:
                if not moved:
                    moved = True
                    modal_motion(
                        time,
                        surface.term_shape,
                        surface.term_start,
                        surface.term_stop,
                        surface.coefficient,
                        surface.rate,
                        modal[0],
                        modal[1],
                    )
                needed = 0.0 if everything else allowed
                depth = _depth((x, y, z), turned, i, bodies, surface, limits.antinode, modal[0], modes, needed)
            value[now, i, ENERGY], value[now, i, MOST_ENERGY] = energy, most
            value[now, i, DEPTH], value[now, i, ALLOWED] = depth, allowed
            mark[now, i, CLEAR], mark[now, i, FALLEN] = clear and depth <= allowed, fallen
            mark[now, i, LOST] = present and (fallen or not over) and z < edge.floor
            violation = FINE
            if present and not finite:
                violation = NOT_FINITE
            elif present and over and not fallen and z < -edge.crest:
                violation = THROUGH_PLATE
            # A part that has fallen may have hit the side of the plate; one that is just being thrown off still counts.
            elif present and before[FALLEN] == 0 and not energy <= most:
                violation = TOO_MUCH_ENERGY
            # A part that has tipped over the edge and swung back may be inside the plate's side. So only a part counts
            # that was away from the edge, and not too deep, at the frame before.
            elif present and before[CLEAR] != 0 and depth > allowed:
                violation = TOO_DEEP
            mark[now, i, VIOLATION] = violation
            ends = ends or violation != FINE
        if ends and not everything:
            return row
    return n


@uncounted
def _find_speeds(state, present, size, edge, energy, value, row):
    """Fill the speeds at one frame; returns the largest of the parts over the plate, now or at the frame before."""
    fastest = 0.0
    for i in range(present.shape[0]):
        v, spin = _vector(state[i], VELOCITY), _vector(state[i], SPIN)
        fall = 2.0 * GRAVITY * max(state[i, 2], 0.0)
        speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + fall)
        speed += math.sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]) * size[i]
        value[row + 1, i, SPEED] = speed + energy.plate_speed
        if present[i] and over_plate(state[i, 0], state[i, 1], edge):
            fastest = max(fastest, value[row + 1, i, SPEED], value[row, i, SPEED])
    return fastest


@inlined
def _vector(state, begin):
    return state[begin], state[begin + 1], state[begin + 2]


@inlined
def _is_finite(state):
    total = 0.0  # not finite as soon as one summand is not
    for k in range(END):
        total += 0.0 * state[k]
    return total == 0.0


@inlined
def _allowed_depth(speed, fastest, limit):
    """Largest depth [m] that a corner may have below the surface.

    Both engines let a corner enter by the distance that it moves in a step. Its speed between two frames is at most the
    larger of those that a part can reach from the frame before and from this one. In a heap a part may be pushed into
    the plate by others that fall or lie on it; a spring-damper brakes within its time constant, and sags.
    """
    allowed = limit.least + limit.steps * speed
    if limit.heap > 0.0:
        allowed += limit.heap + limit.steps * fastest
    sag = GRAVITY * limit.damping_ratio**2 * limit.time_constant
    return allowed + limit.time_constant * (speed + sag)


@inlined
def _rotation(state):
    """Rotation matrix, row by row, of a quaternion of any length."""
    w, (x, y, z) = state[QUATERNION], _vector(state, QUATERNION + 1)
    s = 2.0 / max(w * w + x * x + y * y + z * z, 1e-300)
    return (
        (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)),
    )


@uncounted
def _depth(centre, turned, i, bodies, surface, antinode, q, modes, needed):
    """Depth [m] of the deepest corner of part i below the surface, 0 above it; it counts if it is more than `needed`.

    q: modal coordinates (n_shapes,) [m]; modes: room for the shapes under the centre.
    """
    highest = -needed  # no corner above this height counts
    for shape in range(q.shape[0]):
        highest += abs(q[shape]) * antinode[shape]
    radius, deepest = bodies.radius[i], 0.0
    if centre[2] - bodies.size[i] >= highest:
        return deepest
    under_centre = False
    for k in range(bodies.corner_from[i], bodies.corner_to[i]):
        c = bodies.corners[k]
        z = centre[2] + turned[2][0] * c[0] + turned[2][1] * c[1] + turned[2][2] * c[2]
        if not surface.tangent and z - radius >= highest:  # a plane may be higher than the surface ever is
            continue
        dx = turned[0][0] * c[0] + turned[0][1] * c[1] + turned[0][2] * c[2]
        dy = turned[1][0] * c[0] + turned[1][1] * c[1] + turned[1][2] * c[2]
        height = 0.0
        if surface.tangent:
            if not under_centre:
                surface_modes(centre[0], centre[1], surface.grid_x, surface.grid_y, surface.table, modes)
                under_centre = True
            for shape in range(q.shape[0]):
                slope = modes[shape, BETA_X] * dx + modes[shape, BETA_Y] * dy
                height += q[shape] * (modes[shape, W] + slope)
        else:
            first_x, a = grid_cell(centre[0] + dx, surface.grid_x)
            first_y, b = grid_cell(centre[1] + dy, surface.grid_y)
            weight_x, weight_y = cubic_weights(a), cubic_weights(b)
            for shape in range(q.shape[0]):
                if q[shape] != 0.0:
                    height += q[shape] * interpolate(surface.table, shape, W, first_x, first_y, weight_x, weight_y)
        deepest = max(deepest, height - z + radius)
    return deepest
