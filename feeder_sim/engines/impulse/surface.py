"""Where the surface is, how it moves and slopes, by modal coordinates at a time and mode shapes at a place."""

from __future__ import annotations

import math

from feeder_sim.machine_code import inlined
from feeder_sim.plate.compiled import BETA_X, BETA_Y, W, cubic_slopes, cubic_weights, grid_cell, interpolate

# Of Scratch.under: what each mode shape does under a point: deflection, its slopes, rotations, and how far it moves the
# plate along the normal of the point.
HEIGHT, SLOPE_X, SLOPE_Y, TURN_X, TURN_Y, ALONG = range(6)
NOW, SPEED, ACCELERATION, CHANGE = range(4)  # of Scratch.now and Scratch.then


@inlined
def move_surface(t, surface, modal):
    """Modal coordinates and derivatives of every mode shape at time t [s], into modal; see NOW.

    modal: (4, n_shapes), or (2, n_shapes), of NOW and SPEED alone.
    """
    modal[:] = 0.0
    for k in range(surface.term_shape.shape[0]):
        if surface.term_start[k] <= t < surface.term_stop[k]:
            age, s = t - surface.term_start[k], surface.term_shape[k]
            growth, rate = surface.rate[k].real, surface.rate[k].imag
            fade = math.exp(growth * age) if growth != 0.0 else 1.0
            c, d = fade * math.cos(rate * age), fade * math.sin(rate * age)
            x = surface.coefficient[k].real * c - surface.coefficient[k].imag * d
            y = surface.coefficient[k].real * d + surface.coefficient[k].imag * c
            modal[NOW, s] += x
            x, y = growth * x - rate * y, growth * y + rate * x
            modal[SPEED, s] += x
            if modal.shape[0] == 2:
                continue
            x, y = growth * x - rate * y, growth * y + rate * x
            modal[ACCELERATION, s] += x
            modal[CHANGE, s] += growth * x - rate * y


@inlined
def shapes_at(x, y, surface, under):
    """What every mode shape does at (x, y) [m], into under (n_shapes, 6), see HEIGHT; ALONG the vertical."""
    first_x, a = grid_cell(x, surface.grid_x)
    first_y, b = grid_cell(y, surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    change_x = cubic_slopes(a, surface.grid_x[1] - surface.grid_x[0])
    change_y = cubic_slopes(b, surface.grid_y[1] - surface.grid_y[0])
    table = surface.table
    for s in range(under.shape[0]):
        under[s, HEIGHT] = under[s, ALONG] = interpolate(table, s, W, first_x, first_y, weight_x, weight_y)
        under[s, SLOPE_X] = interpolate(table, s, W, first_x, first_y, change_x, weight_y)
        under[s, SLOPE_Y] = interpolate(table, s, W, first_x, first_y, weight_x, change_y)
        under[s, TURN_X] = interpolate(table, s, BETA_X, first_x, first_y, weight_x, weight_y)
        under[s, TURN_Y] = interpolate(table, s, BETA_Y, first_x, first_y, weight_x, weight_y)


@inlined
def shapes_under(x, y, part, surface, under):
    """As `shapes_at`; a tangent surface is the plane under the part's centre."""
    if not surface.tangent:
        shapes_at(x, y, surface, under)
        return
    shapes_at(part.position[0], part.position[1], surface, under)
    for s in range(under.shape[0]):
        under[s, SLOPE_X], under[s, SLOPE_Y] = under[s, TURN_X], under[s, TURN_Y]
        under[s, HEIGHT] += under[s, SLOPE_X] * (x - part.position[0]) + under[s, SLOPE_Y] * (y - part.position[1])
        under[s, ALONG] = under[s, HEIGHT]


@inlined
def move_surface_under(part, surface, t, work):
    """Write NOW and SPEED into work.now; on a tangent surface the last of work.under is at the part's centre."""
    move_surface(t, surface, work.now[:2])
    if surface.tangent:
        shapes_at(part.position[0], part.position[1], surface, work.under[work.under.shape[0] - 1])


@inlined
def height_at(under, modal):
    """Height of the surface at a place [m]."""
    height = 0.0
    for s in range(under.shape[0]):
        height += under[s, HEIGHT] * modal[NOW, s]
    return height


@inlined
def slope_at(under, modal):
    """Slope of the surface at a place [1]."""
    x = y = 0.0
    for s in range(under.shape[0]):
        x += under[s, SLOPE_X] * modal[NOW, s]
        y += under[s, SLOPE_Y] * modal[NOW, s]
    return x, y


@inlined
def flow_at(under, modal, surface):
    """Velocity of a place of the plate [m/s]: where it bends its surface moves sideways too."""
    moves, x, y, z = surface.half_thickness * surface.in_plane, 0.0, 0.0, 0.0
    for s in range(under.shape[0]):
        speed = modal[SPEED, s]
        x -= under[s, TURN_X] * speed
        y -= under[s, TURN_Y] * speed
        z += under[s, HEIGHT] * speed
    return moves * x, moves * y, z


@inlined
def normal_at(slope):
    """Unit normal of the surface where it has a slope [1]."""
    size = math.sqrt(1.0 + slope[0] * slope[0] + slope[1] * slope[1])
    return -slope[0] / size, -slope[1] / size, 1.0 / size


@inlined
def along_at(under, modal, which):
    """How the surface moves a point along its normal: by NOW [m], SPEED [m/s], ACCELERATION or CHANGE."""
    total = 0.0
    for s in range(under.shape[0]):
        total += under[s, ALONG] * modal[which, s]
    return total


@inlined
def most_push(under, bounds):
    """The largest acceleration of a point along its normal that the plate can have [m/s^2]."""
    most = 0.0
    for s in range(under.shape[0]):
        most += abs(under[s, ALONG]) * bounds.acceleration[s]
    return most
