"""`ModalTerms.phasor` and the interpolation of `Surface` again, as compiled functions for the engines' inner loops.

All in scalars and tuples, which stay in registers.
"""

from __future__ import annotations

import math

from feeder_sim.machine_code import compiled, inlined

W, BETA_X, BETA_Y = range(3)  # components of the table of a `Surface`


@inlined
def modal_motion(t, term_shape, term_start, term_stop, coefficient, rate, q, velocity):
    """Write q_j(t) [m] and dq_j/dt [m/s] of every mode shape into q and velocity (n_shapes,).

    The arguments from term_shape to rate are the arrays of `ModalTerms`, shape (n_terms,); t is in [s].
    """
    q[:] = 0.0
    velocity[:] = 0.0
    for k in range(term_shape.shape[0]):
        if term_start[k] <= t < term_stop[k]:
            age = t - term_start[k]
            angle = rate[k].imag * age
            decay = math.exp(rate[k].real * age) if rate[k].real != 0.0 else 1.0
            c, s = decay * math.cos(angle), decay * math.sin(angle)
            real = coefficient[k].real * c - coefficient[k].imag * s
            imaginary = coefficient[k].real * s + coefficient[k].imag * c
            q[term_shape[k]] += real
            velocity[term_shape[k]] += rate[k].real * real - rate[k].imag * imaginary


@inlined
def grid_cell(position, grid):
    """Index of the first of the four points of a uniform grid [m] around a position [m], and its distance [spacings].

    A position outside the grid is moved to its end.
    """
    n = grid.shape[0]
    u = min(max((position - grid[0]) / (grid[1] - grid[0]), 0.0), n - 1.0)
    first = max(min(int(u) - 1, n - 4), 0)
    return first, u - first


@inlined
def cubic_weights(a):
    """Cubic Lagrange weights [1] of four grid points, at a distance a from the first [spacings]."""
    b, c, d = a - 1.0, a - 2.0, a - 3.0
    return -b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0


@inlined
def cubic_slopes(a, spacing):
    """The derivatives [1/m] of the weights of `cubic_weights`."""
    b, c, d = a - 1.0, a - 2.0, a - 3.0
    return (
        -(b * c + b * d + c * d) / (6.0 * spacing),
        (a * c + a * d + c * d) / (2.0 * spacing),
        -(a * b + a * d + b * d) / (2.0 * spacing),
        (a * b + a * c + b * c) / (6.0 * spacing),
    )


@inlined
def interpolate(table, shape, component, first_x, first_y, weight_x, weight_y):
    """Weighted sum of one component of a mode shape over 4 x 4 grid points."""
    return (
        weight_x[0] * _along_y(table, shape, component, first_x, first_y, weight_y)
        + weight_x[1] * _along_y(table, shape, component, first_x + 1, first_y, weight_y)
        + weight_x[2] * _along_y(table, shape, component, first_x + 2, first_y, weight_y)
        + weight_x[3] * _along_y(table, shape, component, first_x + 3, first_y, weight_y)
    )


@inlined
def _along_y(table, shape, component, x, first_y, weight_y):
    return (
        weight_y[0] * table[shape, component, x, first_y]
        + weight_y[1] * table[shape, component, x, first_y + 1]
        + weight_y[2] * table[shape, component, x, first_y + 2]
        + weight_y[3] * table[shape, component, x, first_y + 3]
    )


@compiled
def surface_modes(x, y, grid_x, grid_y, table, modes):
    """Interpolate (w [1], beta_x, beta_y [1/m]) of every mode shape at (x, y) [m] into modes (n_shapes, 3).

    The grids and the table are those of `Surface`.
    """
    first_x, a = grid_cell(x, grid_x)
    first_y, b = grid_cell(y, grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    for shape in range(table.shape[0]):
        for component in range(3):
            modes[shape, component] = interpolate(table, shape, component, first_x, first_y, weight_x, weight_y)
