"""`ModalTerms.phasor` and the interpolation of `Surface` again, as compiled functions for the engines' inner loops."""

from __future__ import annotations

import math

from feeder_sim.machine_code import compiled, inlined


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
def grid_cell(position, origin, spacing, n, weight):
    """Write four cubic Lagrange weights [1] into weight (4,) and return the index of the first of the four grid points.

    The grid has n points, the first at origin [m]. A position [m] outside the grid is moved to its end.
    """
    u = min(max((position - origin) / spacing, 0.0), n - 1.0)
    first = min(max(int(u) - 1, 0), n - 4)
    a = u - first
    b, c, d = a - 1.0, a - 2.0, a - 3.0
    weight[0] = -b * c * d / 6.0
    weight[1] = a * c * d / 2.0
    weight[2] = -a * b * d / 2.0
    weight[3] = a * b * c / 6.0
    return first


@compiled
def surface_modes(x, y, grid_x, grid_y, table, weight, modes):
    """Interpolate (w [1], beta_x, beta_y [1/m]) of every mode shape at (x, y) [m] into modes (n_shapes, 3).

    The grids and the table are those of `Surface`; weight (2, 4) is overwritten.
    """
    weight_x, weight_y = weight[0], weight[1]
    first_x = grid_cell(x, grid_x[0], grid_x[1] - grid_x[0], grid_x.shape[0], weight_x)
    first_y = grid_cell(y, grid_y[0], grid_y[1] - grid_y[0], grid_y.shape[0], weight_y)
    modes[:] = 0.0
    for shape in range(table.shape[0]):
        for i in range(4):
            for j in range(4):
                share = weight_x[i] * weight_y[j]
                for component in range(3):
                    modes[shape, component] += share * table[shape, first_x + i, first_y + j, component]


@inlined
def surface_deflection(shape, first_x, first_y, weight_x, weight_y, table):
    """Deflection w [1] of one mode shape from the weights and first indices of `grid_cell`."""
    w = 0.0
    for i in range(4):
        along_y = 0.0
        for j in range(4):
            along_y += weight_y[j] * table[shape, first_x + i, first_y + j, 0]
        w += weight_x[i] * along_y
    return w


@compiled
def grid_slope(position, origin, spacing, n, weight):
    """Write the derivatives [1/m] of the weights of `grid_cell` into weight (4,); return the first grid index."""
    u = min(max((position - origin) / spacing, 0.0), n - 1.0)
    first = min(max(int(u) - 1, 0), n - 4)
    a = u - first
    b, c, d = a - 1.0, a - 2.0, a - 3.0
    weight[0] = -(b * c + b * d + c * d) / (6.0 * spacing)
    weight[1] = (a * c + a * d + c * d) / (2.0 * spacing)
    weight[2] = -(a * b + a * d + b * d) / (2.0 * spacing)
    weight[3] = (a * b + a * c + b * c) / (6.0 * spacing)
    return first


@compiled
def surface_normal(x, y, grid_x, grid_y, table, q, weight, normal):
    """Write the unit normal of the deflected surface at (x, y) [m] into normal (3,).

    The modal coordinates q (n_shapes,) are in [m]; weight (2, 4) is overwritten.
    """
    weight_x, weight_y = weight[0], weight[1]
    first_x = grid_slope(x, grid_x[0], grid_x[1] - grid_x[0], grid_x.shape[0], weight_x)
    first_y = grid_cell(y, grid_y[0], grid_y[1] - grid_y[0], grid_y.shape[0], weight_y)
    slope_x = _weighted_deflection(table, q, first_x, first_y, weight_x, weight_y)
    grid_cell(x, grid_x[0], grid_x[1] - grid_x[0], grid_x.shape[0], weight_x)
    grid_slope(y, grid_y[0], grid_y[1] - grid_y[0], grid_y.shape[0], weight_y)
    slope_y = _weighted_deflection(table, q, first_x, first_y, weight_x, weight_y)
    size = math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    normal[0], normal[1], normal[2] = -slope_x / size, -slope_y / size, 1.0 / size


@compiled
def _weighted_deflection(table, q, first_x, first_y, weight_x, weight_y):
    """Sum of q times the weighted deflection of all mode shapes over 4 x 4 grid points."""
    total = 0.0
    for shape in range(table.shape[0]):
        for i in range(4):
            for j in range(4):
                total += q[shape] * weight_x[i] * weight_y[j] * table[shape, first_x + i, first_y + j, 0]
    return total
