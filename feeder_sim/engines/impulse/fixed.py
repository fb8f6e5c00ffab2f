"""Fixtures: convex bodies that stand, or go with a tray, whatever touches them.

They are parts of infinite mass behind the free ones, each a kind of its own. In impacts and forces a fixture is the
world, with the velocity that it has at the contact. One that goes with a tray is FIXED to it: its motion is that of the
surface, which of a tray is linear in the place, u(p) = move + turn x p, as the corners of its table tell. One that is
STEADY has a velocity and a spin that do not change within a window.

Of such a part `offset` and `orientation` are its place and attitude on the tray at rest, and `momentum` is how fast it
turns [rad/s].
"""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.contact_problem import (
    ARM_SECOND,
    FRICTION,
    IMPULSE,
    MOMENT,
    NORMAL,
    RESTITUTION,
    ROLLING,
    TARGET,
    VELOCITY,
    WORLD,
)
from feeder_sim.engines.impulse.state import FIXED
from feeder_sim.engines.impulse.vectors import combine, cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted
from feeder_sim.plate.compiled import BETA_X, BETA_Y, W

NOTHING = (0.0, 0.0, 0.0)


@uncounted
def _tray(t, surface):
    """Displacement [m], turn [rad], and the rates of both, of a tray at time t [s], about the middle of its table."""
    x, y, z, about_x, about_y, about_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    vx, vy, vz, spin_x, spin_y, spin_z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    moves = surface.half_thickness * surface.in_plane
    last_x, last_y = surface.grid_x.shape[0] - 1, surface.grid_y.shape[0] - 1
    low_x, low_y = surface.grid_x[0], surface.grid_y[0]
    length, width = surface.grid_x[last_x] - low_x, surface.grid_y[last_y] - low_y
    for k in range(surface.term_shape.shape[0]):
        if not surface.term_start[k] <= t < surface.term_stop[k]:
            continue
        age, s, growth = t - surface.term_start[k], surface.term_shape[k], surface.rate[k].real
        rate = surface.rate[k].imag
        if growth == 0.0 and rate == 0.0:  # the incline, on which the fixture stands already
            continue
        fade = math.exp(growth * age) if growth != 0.0 else 1.0
        c, d = fade * math.cos(rate * age), fade * math.sin(rate * age)
        q = surface.coefficient[k].real * c - surface.coefficient[k].imag * d
        dq = growth * q - rate * (surface.coefficient[k].real * d + surface.coefficient[k].imag * c)
        corner = surface.table[s, W, 0, 0]
        slope_x = (surface.table[s, W, last_x, 0] - corner) / length
        slope_y = (surface.table[s, W, 0, last_y] - corner) / width
        beta_x, beta_y = surface.table[s, BETA_X, 0, 0], surface.table[s, BETA_Y, 0, 0]
        twist = moves * (surface.table[s, BETA_X, 0, last_y] - beta_x) / width  # u_x = move - twist y
        shift_x, shift_y = -moves * beta_x + twist * low_y, -moves * beta_y - twist * low_x
        shift_z = corner - slope_x * low_x - slope_y * low_y
        x, y, z = x + shift_x * q, y + shift_y * q, z + shift_z * q
        vx, vy, vz = vx + shift_x * dq, vy + shift_y * dq, vz + shift_z * dq
        about_x, about_y, about_z = about_x + slope_y * q, about_y - slope_x * q, about_z + twist * q
        spin_x, spin_y, spin_z = spin_x + slope_y * dq, spin_y - slope_x * dq, spin_z + twist * dq
    return (x, y, z), (about_x, about_y, about_z), (vx, vy, vz), (spin_x, spin_y, spin_z)


@uncounted
def move_fixture(part, t, surface):
    """Bring a fixture to time t [s], whether it stands or moves."""
    if part.phase == FIXED:
        _carry(part, t, surface)
    else:
        _go_on(part, t)


@uncounted
def _carry(part, t, surface):
    """Put a fixture of a tray where it is at time t [s]."""
    move, about, velocity, spin = _tray(t, surface)
    place = vector(part.offset)
    turned, carried = cross(about, place), cross(spin, place)
    angle = math.sqrt(dot(about, about))
    for k in range(3):
        part.position[k] = place[k] + move[k] + turned[k]
        part.velocity[k] = velocity[k] + carried[k]
        part.momentum[k] = spin[k]
        axis = part.orientation[0, k], part.orientation[1, k], part.orientation[2, k]
        moved = plus(axis, 1.0, cross(about, axis)) if angle > 0.0 else axis
        size = math.sqrt(dot(moved, moved))
        part.attitude[0, k], part.attitude[1, k], part.attitude[2, k] = (
            moved[0] / size,
            moved[1] / size,
            moved[2] / size,
        )
    part.clock = t


@uncounted
def _go_on(part, t):
    """Bring a fixture that stands, or moves by itself, to time t [s]."""
    age, spin = t - part.clock, vector(part.momentum)
    part.clock = t
    rate = math.sqrt(dot(spin, spin))
    for k in range(3):
        part.position[k] += age * part.velocity[k]
    if rate == 0.0:
        return
    c, s = math.cos(rate * age), math.sin(rate * age)
    for k in range(3):
        axis = part.attitude[0, k], part.attitude[1, k], part.attitude[2, k]
        along = (1.0 - c) * dot(spin, axis) / (rate * rate)
        turned = combine(c, axis, s / rate, cross(spin, axis), along, spin)  # Rodrigues
        part.attitude[0, k], part.attitude[1, k], part.attitude[2, k] = turned


@inlined
def own_speed(part, kind):
    """No point of a fixture that moves by itself is faster [m/s]."""
    velocity, spin = vector(part.velocity), vector(part.momentum)
    return math.sqrt(dot(velocity, velocity)) + kind.reach * math.sqrt(dot(spin, spin))


@inlined
def velocity_at(part, arm):
    """Of a point of a fixture at the end of an arm from its centre [m/s]."""
    return plus(part.velocity, 1.0, cross(vector(part.momentum), arm))


@uncounted
def motion_at(part, t, surface):
    """Velocity [m/s] and spin [rad/s] of a fixture at a time t [s] that is not its own."""
    if part.phase != FIXED:
        return vector(part.velocity), vector(part.momentum)
    _, _, velocity, spin = _tray(t, surface)
    return plus(velocity, 1.0, cross(spin, vector(part.offset))), spin


@inlined
def place_at_fixture(c, arm, axis, part, fixture, kind, body, contacts):
    """Make contact c of a body with a fixture: at an arm of its part [m]; the axis leads from the part to the fixture.

    Returns the velocity of the fixture there [m/s].
    """
    arm_there = plus(difference(part.position, fixture.position), 1.0, arm)
    velocity = velocity_at(fixture, arm_there)
    contacts.body[c, 0], contacts.body[c, 1] = WORLD, body
    write_to(contacts.vector[ARM_SECOND, c], arm)
    write_to(contacts.vector[NORMAL, c], (-axis[0], -axis[1], -axis[2]))
    write_to(contacts.vector[VELOCITY, c], velocity)
    for k in (IMPULSE, MOMENT):
        write_to(contacts.vector[k, c], NOTHING)
    contacts.number[RESTITUTION, c] = contacts.number[ROLLING, c] = contacts.number[TARGET, c] = 0.0
    contacts.number[FRICTION, c] = kind.friction[1]
    return velocity
