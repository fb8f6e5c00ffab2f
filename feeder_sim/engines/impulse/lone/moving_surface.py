"""Where the surface is, how it moves and slopes; and where points over it will be."""

from __future__ import annotations

import math

from feeder_sim.engines.impulse.lone.state import (
    ACCELERATION,
    CHANGE,
    FALL,
    GAP,
    HEIGHT,
    NOW,
    RATE,
    SLOPE_X,
    SLOPE_Y,
    SPEED,
    TURN_X,
    TURN_Y,
)
from feeder_sim.machine_code import inlined
from feeder_sim.plate.compiled import BETA_X, BETA_Y, W, cubic_slopes, cubic_weights, grid_cell, interpolate


@inlined
def move_surface(t, surface, modal):
    """Modal coordinates and three derivatives of every mode shape at time t [s], into modal (4, n_shapes); see NOW."""
    for s in range(modal.shape[1]):
        modal[NOW, s] = modal[SPEED, s] = modal[ACCELERATION, s] = modal[CHANGE, s] = 0.0
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
            x, y = growth * x - rate * y, growth * y + rate * x
            modal[ACCELERATION, s] += x
            modal[CHANGE, s] += growth * x - rate * y


@inlined
def shapes_at(x, y, surface, known, under):
    """What every mode shape does at (x, y) [m], into under (n_shapes, 5), see HEIGHT; only that if not `known`."""
    first_x, a = grid_cell(x, surface.grid_x)
    first_y, b = grid_cell(y, surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    table = surface.table
    for s in range(under.shape[0]):
        under[s, HEIGHT] = interpolate(table, s, W, first_x, first_y, weight_x, weight_y)
    if not known:
        return
    change_x = cubic_slopes(a, surface.grid_x[1] - surface.grid_x[0])
    change_y = cubic_slopes(b, surface.grid_y[1] - surface.grid_y[0])
    for s in range(under.shape[0]):
        under[s, SLOPE_X] = interpolate(table, s, W, first_x, first_y, change_x, weight_y)
        under[s, SLOPE_Y] = interpolate(table, s, W, first_x, first_y, weight_x, change_y)
        under[s, TURN_X] = interpolate(table, s, BETA_X, first_x, first_y, weight_x, weight_y)
        under[s, TURN_Y] = interpolate(table, s, BETA_Y, first_x, first_y, weight_x, weight_y)


@inlined
def shapes_under(x, y, part, surface, known, under):
    """As `shapes_at`; a tangent surface is the plane under the part's centre."""
    if not surface.tangent:
        shapes_at(x, y, surface, known, under)
        return
    shapes_at(part.position[0], part.position[1], surface, True, under)
    for s in range(under.shape[0]):
        under[s, SLOPE_X], under[s, SLOPE_Y] = under[s, TURN_X], under[s, TURN_Y]
        under[s, HEIGHT] += under[s, SLOPE_X] * (x - part.position[0]) + under[s, SLOPE_Y] * (y - part.position[1])


@inlined
def ahead(i, far, slip, more, vx, vy, work):
    """Gap [m], rate [m/s] and acceleration towards the surface [m/s^2] of point i after a time [s], at the worst.

    It goes sideways by (vx, vy) [m/s]; what is unsure of its rate [m/s] and of its acceleration [m/s^2]: slip, more.
    """
    row, under = work.point[i], work.under[i]
    fall = row[FALL] + more
    rate = row[RATE] - slip
    gap = row[GAP] + far * (rate - 0.5 * fall * far)
    rate -= fall * far
    h = fall
    for s in range(under.shape[0]):
        w = under[s, HEIGHT]
        q, dq = work.then[NOW, s], work.then[SPEED, s]
        rises = vx * under[s, SLOPE_X] + vy * under[s, SLOPE_Y]
        there = w + rises * far
        gap -= there * q - w * work.now[NOW, s] - far * (w * work.now[SPEED, s] + rises * work.now[NOW, s])
        rate -= there * dq - w * work.now[SPEED, s] + rises * (q - work.now[NOW, s])
        h += there * work.then[ACCELERATION, s] + 2.0 * rises * dq
    return gap, rate, h
