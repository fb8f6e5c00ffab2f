"""Where the surface is now, and how steep, for the impulse engine."""

from __future__ import annotations

from feeder_sim.machine_code import inlined
from feeder_sim.plate.compiled import (
    BETA_X,
    BETA_Y,
    W,
    cubic_slopes,
    cubic_weights,
    grid_cell,
    interpolate,
    modal_motion,
    surface_modes,
)


@inlined
def move_surface(part, surface, t, work):
    """Modal coordinates and their rates at time t; on a tangent surface, the mode shapes under the part's centre."""
    modal_motion(
        t,
        surface.term_shape,
        surface.term_start,
        surface.term_stop,
        surface.coefficient,
        surface.rate,
        work.modal[0],
        work.modal[1],
    )
    if surface.tangent:
        x, y = part.position[0], part.position[1]
        surface_modes(x, y, surface.grid_x, surface.grid_y, surface.table, work.modes)


@inlined
def slope_under(x, y, surface, work):
    """Slopes of the moved surface at (x, y) [m], along x and y [1]."""
    first_x, a = grid_cell(x, surface.grid_x)
    first_y, b = grid_cell(y, surface.grid_y)
    weight_x, weight_y = cubic_weights(a), cubic_weights(b)
    change_x = cubic_slopes(a, surface.grid_x[1] - surface.grid_x[0])
    change_y = cubic_slopes(b, surface.grid_y[1] - surface.grid_y[0])
    along_x = along_y = 0.0
    for s in range(work.modal.shape[1]):
        q = work.modal[0, s]
        if q == 0.0:
            continue
        if surface.tangent:
            along_x += q * work.modes[s, BETA_X]
            along_y += q * work.modes[s, BETA_Y]
        else:
            along_x += q * interpolate(surface.table, s, W, first_x, first_y, change_x, weight_y)
            along_y += q * interpolate(surface.table, s, W, first_x, first_y, weight_x, change_y)
    return along_x, along_y
