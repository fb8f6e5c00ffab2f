"""The plate in a replay: flat, coloured by the signed displacement amplitude of its surface, with nodal lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.trajectory import PlateRecord

TIMELINE = "sim_time"
MM = 1e3
PLATE_GREY, NODE = (190, 190, 195), (20, 20, 20)
COLOUR_STEP = 0.04  # the plate is recoloured when an envelope has moved by this fraction of its maximum


def log_plate(stream: Any, plate: PlateRecord, last: float) -> None:
    """Flat top surface with vertex colours up to the time `last`, the body below it, and the nodal lines."""
    import rerun as rr

    half = np.array([plate.length, plate.width, plate.thickness]) * 0.5 * MM
    body = rr.Boxes3D(centers=[[0, 0, -half[2] - 0.05]], half_sizes=[half], colors=[PLATE_GREY], fill_mode="solid")
    stream.log("plate/body", body, static=True)
    grid_x, grid_y = np.meshgrid(plate.x * MM, plate.y * MM, indexing="ij")
    vertices = np.column_stack([grid_x.ravel(), grid_y.ravel(), np.zeros(grid_x.size)])
    mesh = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=_grid_triangles(len(plate.x), len(plate.y)),
        vertex_normals=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)),
    )
    stream.log("plate/surface", mesh, static=True)  # only the vertex colours below change in time
    for row in _colour_rows(plate.drive_amplitude[plate.drive_time <= last]):
        displacement = np.tensordot(plate.drive_amplitude[row], plate.mode_shape, axes=1)
        stream.set_time(TIMELINE, duration=float(plate.drive_time[row]))
        colours = _diverging(displacement.ravel() / _largest(plate))
        stream.log("plate/surface", rr.Mesh3D.from_fields(vertex_colors=colours))
    if plate.nodal_lines:
        stream.log("plate/nodal_lines", drawn_lines(plate.nodal_lines), static=True)


def drawn_lines(lines: Sequence[NDArray[np.float64]]) -> Any:
    """Lines (n, 2) [m] just above the plate."""
    import rerun as rr

    raised = [np.column_stack([line * MM, np.full(len(line), 0.02)]) for line in lines]
    return rr.LineStrips3D(raised, colors=[NODE], radii=[0.12])


def _grid_triangles(nx: int, ny: int) -> NDArray[np.int64]:
    """Two triangles per cell of an (nx, ny) grid, counter-clockwise from above."""
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    lower = np.column_stack([corner, corner + ny, corner + ny + 1])
    upper = np.column_stack([corner, corner + ny + 1, corner + 1])
    return np.concatenate([lower, upper])


def _colour_rows(amplitude: NDArray[np.float64]) -> list[int]:
    """Indices of `amplitude` (n, n_shapes) at which the surface looks different from the last one drawn."""
    step = COLOUR_STEP * max(float(amplitude.max()), 1e-300)
    rows = [0]
    for i in range(1, len(amplitude)):
        if np.abs(amplitude[i] - amplitude[rows[-1]]).max() > step:
            rows.append(i)
    return rows


def _largest(plate: PlateRecord) -> float:
    """Largest displacement amplitude the plate reaches anywhere, any time [m]."""
    shape = np.abs(plate.mode_shape).reshape(len(plate.mode_shape), -1)
    return max(float((plate.drive_amplitude @ shape).max()), 1e-300)


def _diverging(value: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Blue - white - red for -1 .. 1, shape (n, 4)."""
    low, middle, high = np.array([58, 96, 190]), np.array([242, 242, 242]), np.array([190, 52, 52])
    v = np.clip(value, -1.0, 1.0)[:, None]
    rgb = np.where(v < 0, middle + (middle - low) * v, middle + (high - middle) * v)
    return np.column_stack([rgb, np.full(len(v), 255)]).astype(np.uint8)
