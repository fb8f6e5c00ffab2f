"""Compiled twins of `Surface.displacement` and `ModalTerms.phasor`, for the engines' inner loops."""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True, nogil=True)
def modal_coordinates(t, term_shape, term_start, term_stop, coefficient, rate, q):
    """Write q_j(t) [m] of every mode shape into q (n_shapes,)."""
    q[:] = 0.0
    for k in range(term_shape.shape[0]):
        if term_start[k] <= t < term_stop[k]:
            age = t - term_start[k]
            angle = rate[k].imag * age
            value = coefficient[k].real * math.cos(angle) - coefficient[k].imag * math.sin(angle)
            if rate[k].real != 0.0:
                value *= math.exp(rate[k].real * age)
            q[term_shape[k]] += value


@njit(cache=True, nogil=True)
def grid_cell(position, origin, spacing, n, weight):
    """Write the four cubic Lagrange weights into weight (4,) and return the first grid index; clamped to the grid."""
    u = min(max((position - origin) / spacing, 0.0), n - 1.0)
    first = min(max(int(u) - 1, 0), n - 4)
    a = u - first
    b, c, d = a - 1.0, a - 2.0, a - 3.0
    weight[0] = -b * c * d / 6.0
    weight[1] = a * c * d / 2.0
    weight[2] = -a * b * d / 2.0
    weight[3] = a * b * c / 6.0
    return first


@njit(cache=True, nogil=True)
def surface_modes(x, y, grid_x, grid_y, table, weight_x, weight_y, modes):
    """Interpolate (w, beta_x, beta_y) of every mode shape at (x, y) into modes (n_shapes, 3); weights are scratch."""
    first_x = grid_cell(x, grid_x[0], grid_x[1] - grid_x[0], grid_x.shape[0], weight_x)
    first_y = grid_cell(y, grid_y[0], grid_y[1] - grid_y[0], grid_y.shape[0], weight_y)
    modes[:] = 0.0
    for shape in range(table.shape[0]):
        for i in range(4):
            for j in range(4):
                weight = weight_x[i] * weight_y[j]
                for component in range(3):
                    modes[shape, component] += weight * table[shape, first_x + i, first_y + j, component]
