"""The plate in a replay: a flat surface coloured by its signed displacement amplitude, with nodal lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.wave import standing_share
from feeder_sim.records.recording import PlateRecord
from feeder_sim.replay.area import area_of, body_mesh

TIMELINE = "sim_time"
MM = 1e3
PLATE_GREY, NODE = (190, 190, 195), (20, 20, 20)
ENVELOPE_POINTS = 2001
STANDING = 0.9  # smallest standing share of a wave that is drawn as a standing one, with signs
COLOUR_STEP = 0.04  # of the largest amplitude; the plate is coloured again when an amplitude has changed by so much
NODE_HEIGHT_MM, BODY_GAP_MM = 0.02, 0.05  # of lines over the surface, and of the body below it, so that both show


def log_plate(stream: Any, plate: PlateRecord, terms: ModalTerms, last: float) -> None:
    """Log the top surface with its colours in time, the body below it, and the nodal lines.

    Args:
        stream: rerun's recording stream.
        plate: its dimensions, mode shapes and nodal lines.
        terms: modal coordinates in time.
        last: time of the last frame [s].
    """
    import rerun as rr

    half = np.array([plate.length, plate.width, plate.thickness]) * 0.5 * MM
    area = area_of(plate.x, plate.y, plate.outline)
    if plate.outline is None:
        body: Any = rr.Boxes3D(
            centers=[[0, 0, -half[2] - BODY_GAP_MM]], half_sizes=[half], colors=[PLATE_GREY], fill_mode="solid"
        )
    else:
        corners, faces = body_mesh(area, plate.outline, plate.thickness, BODY_GAP_MM / MM)
        body = rr.Mesh3D(vertex_positions=MM * corners, triangle_indices=faces, albedo_factor=PLATE_GREY)
    stream.log("plate/body", body, static=True)
    vertices = np.column_stack([MM * area.points, np.zeros(len(area.points))])
    mesh = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=area.triangles,
        vertex_normals=np.tile([0.0, 0.0, 1.0], (len(vertices), 1)),
    )
    stream.log("plate/surface", mesh, static=True)  # only the vertex colours below change in time
    times = np.linspace(0.0, last, ENVELOPE_POINTS)
    phasors = terms.phasor(times, len(plate.mode_shape))
    rows, groups = _colour_rows(np.abs(phasors)), _driven_together(plate)
    fields = {
        row: area.carried(
            np.sum([_amplitude(phasors[row, group], plate.mode_shape[group]) for group in groups], axis=0)
        )
        for row in rows
    }
    largest = max(max(float(np.abs(field).max()) for field in fields.values()), 1e-300)
    for row, field in fields.items():
        stream.set_time(TIMELINE, duration=float(times[row]))
        stream.log("plate/surface", rr.Mesh3D.from_fields(vertex_colors=diverging(field / largest)))
    if plate.nodal_lines:
        stream.log("plate/nodal_lines", drawn_lines(plate.nodal_lines), static=True)


def _driven_together(plate: PlateRecord) -> list[list[int]]:
    """Indices of mode shapes in groups that are driven at one frequency, so that their phases are fixed."""
    groups: list[set[int]] = [{shape} for shape in range(len(plate.mode_shape))]
    for frequency in {drive.drive_frequency for drive in plate.drives}:
        together = {drive.shape for drive in plate.drives if drive.drive_frequency == frequency}
        joined = [group for group in groups if group & together]
        groups = [group for group in groups if not group & together] + [set().union(*joined)]
    return [sorted(group) for group in groups]


def _amplitude(phasors: NDArray[np.complex128], shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement amplitude (nx, ny) [m] of a group of modes: signed for a standing wave, else the modulus.

    Args:
        phasors: complex modal coordinates of the group (n,) [m].
        shapes: deflection of its modes (n, nx, ny) [1].
    """
    field = np.tensordot(phasors, shapes, axes=1)
    if standing_share(field) < STANDING:
        return np.abs(field)
    in_phase = phasors * np.exp(-0.5j * np.angle((field**2).sum()))  # as nearly real as a common phase makes them
    sign = np.sign(in_phase[np.abs(in_phase).argmax()].real) or 1.0
    return np.asarray(sign * np.tensordot(in_phase, shapes, axes=1).real)


def drawn_lines(lines: Sequence[NDArray[np.float64]]) -> Any:
    """Polylines (n, 2) [m], drawn just above the plate."""
    import rerun as rr

    raised = [np.column_stack([line * MM, np.full(len(line), NODE_HEIGHT_MM)]) for line in lines]
    return rr.LineStrips3D(raised, colors=[NODE], radii=[0.12])


def _colour_rows(amplitude: NDArray[np.float64]) -> list[int]:
    """Rows of `amplitude` (n, n_shapes) that differ from the row before them in the list by `COLOUR_STEP`."""
    step = COLOUR_STEP * max(float(amplitude.max()), 1e-300)
    rows = [0]
    for i in range(1, len(amplitude)):
        if np.abs(amplitude[i] - amplitude[rows[-1]]).max() > step:
            rows.append(i)
    return rows


def diverging(value: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours (n, 4) from blue over white to red for values (n,) from -1 to 1."""
    low, middle, high = np.array([58, 96, 190]), np.array([242, 242, 242]), np.array([190, 52, 52])
    v = np.clip(value, -1.0, 1.0)[:, None]
    rgb = np.where(v < 0, middle + (middle - low) * v, middle + (high - middle) * v)
    return np.column_stack([rgb, np.full(len(v), 255)]).astype(np.uint8)
