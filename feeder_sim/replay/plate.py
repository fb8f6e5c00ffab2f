"""The plate in a replay: flat, coloured by the signed displacement amplitude of its surface, with nodal lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.wave import standing_share
from feeder_sim.records.trajectory import PlateRecord

TIMELINE = "sim_time"
MM = 1e3
PLATE_GREY, NODE = (190, 190, 195), (20, 20, 20)
ENVELOPE_POINTS = 2001
STANDING = 0.9  # share of a wave that swings in phase, from which on it is drawn as a standing one
COLOUR_STEP = 0.04  # the plate is recoloured when an envelope has moved by this fraction of its maximum


def log_plate(stream: Any, plate: PlateRecord, terms: ModalTerms, last: float) -> None:
    """Flat top surface with vertex colours up to the time `last` [s], the body below it, and the nodal lines."""
    import rerun as rr

    half = np.array([plate.length, plate.width, plate.thickness]) * 0.5 * MM
    body = rr.Boxes3D(centers=[[0, 0, -half[2] - 0.05]], half_sizes=[half], colors=[PLATE_GREY], fill_mode="solid")
    stream.log("plate/body", body, static=True)
    grid_x, grid_y = np.meshgrid(plate.x * MM, plate.y * MM, indexing="ij")
    vertices = np.column_stack([grid_x.ravel(), grid_y.ravel(), np.zeros(grid_x.size)])
    mesh = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=grid_triangles(len(plate.x), len(plate.y)),
        vertex_normals=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)),
    )
    stream.log("plate/surface", mesh, static=True)  # only the vertex colours below change in time
    times = np.linspace(0.0, last, ENVELOPE_POINTS)
    phasors = terms.phasor(times, len(plate.mode_shape))
    rows, groups = _colour_rows(np.abs(phasors)), _driven_together(plate)
    shown = {row: sum(_amplitude(phasors[row, group], plate.mode_shape[group]) for group in groups) for row in rows}
    largest = max(max(float(np.abs(field).max()) for field in shown.values()), 1e-300)
    for row, field in shown.items():
        stream.set_time(TIMELINE, duration=float(times[row]))
        stream.log("plate/surface", rr.Mesh3D.from_fields(vertex_colors=diverging(np.ravel(field) / largest)))
    if plate.nodal_lines:
        stream.log("plate/nodal_lines", drawn_lines(plate.nodal_lines), static=True)


def _driven_together(plate: PlateRecord) -> list[list[int]]:
    """Mode shapes in groups that are driven at one frequency, so that their phases to each other mean something."""
    groups: list[set[int]] = [{shape} for shape in range(len(plate.mode_shape))]
    for frequency in {drive.drive_frequency for drive in plate.drives}:
        together = {drive.shape for drive in plate.drives if drive.drive_frequency == frequency}
        joined = [group for group in groups if group & together]
        groups = [group for group in groups if not group & together] + [set().union(*joined)]
    return [sorted(group) for group in groups]


def _amplitude(phasors: NDArray[np.complex128], shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement amplitude of some modes together: signed where they make a standing wave, else the modulus."""
    field = np.tensordot(phasors, shapes, axes=1)
    if standing_share(field) < STANDING:
        return np.abs(field)
    turned = phasors * np.exp(-0.5j * np.angle((field**2).sum()))
    sign = np.sign(turned[np.abs(turned).argmax()].real) or 1.0
    return np.asarray(sign * np.tensordot(turned, shapes, axes=1).real)


def drawn_lines(lines: Sequence[NDArray[np.float64]]) -> Any:
    """Lines (n, 2) [m] just above the plate."""
    import rerun as rr

    raised = [np.column_stack([line * MM, np.full(len(line), 0.02)]) for line in lines]
    return rr.LineStrips3D(raised, colors=[NODE], radii=[0.12])


def grid_triangles(nx: int, ny: int) -> NDArray[np.int64]:
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


def diverging(value: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Blue - white - red for -1 .. 1, shape (n, 4)."""
    low, middle, high = np.array([58, 96, 190]), np.array([242, 242, 242]), np.array([190, 52, 52])
    v = np.clip(value, -1.0, 1.0)[:, None]
    rgb = np.where(v < 0, middle + (middle - low) * v, middle + (high - middle) * v)
    return np.column_stack([rgb, np.full(len(v), 255)]).astype(np.uint8)
