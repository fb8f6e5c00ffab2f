"""The plate in a replay: a flat surface coloured by its signed displacement amplitude, with nodal lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalDrive, ModalTerms
from feeder_sim.plate.wave import standing_share
from feeder_sim.records.recording import PlateRecord
from feeder_sim.replay.area import Area, area_of, body_mesh
from feeder_sim.scene.timetable import TimedStage

# The surface in slow motion in a replay: a few periods of every stage, magnified, on a timeline of their own.

SLOW = "slow_motion"
PERIOD_S = 2.0  # [s] on the slow timeline for one period of the plate
PERIODS = 2  # shown of every stage
PICTURES = 20  # per period
POINTS = 61  # largest number of grid points per axis of the plate
HEIGHT = 0.06  # of the highest crest as drawn, over the length of the plate


def log_wave(
    stream: Any, plate: PlateRecord, terms: ModalTerms, stages: Sequence[TimedStage], last: float
) -> list[tuple[float, float]]:
    """Log the motion at the end of every different stage that was reached, one after the other on the slow timeline.

    On the real timeline the same view shows the surface at its largest amplitude, from the begin of each stage on.

    Args:
        stream: rerun's recording stream.
        plate: its mode shapes and drives.
        terms: modal coordinates in time.
        stages: of the shown seed.
        last: time of the last frame [s].

    Returns:
        For every different stage its begin on the slow timeline [s], and the time of the run that is shown last [s].
    """
    import rerun as rr

    rows, columns = (thinned(len(axis)) for axis in (plate.x, plate.y))
    area = area_of(plate.x[rows], plate.y[columns], plate.outline)
    shapes = np.stack([area.carried(shape) for shape in plate.mode_shape[:, rows[:, None], columns]])

    scale = HEIGHT * plate.length * MM

    def log(field: NDArray[np.float64]) -> None:
        """Log a deflection (n,), whose largest value over time is 1."""
        vertices = np.column_stack([MM * area.points, scale * field])
        mesh = rr.Mesh3D(vertex_positions=vertices, triangle_indices=area.triangles, vertex_colors=diverging(field))
        stream.log("wave/surface", mesh)

    front = [[0.0, -0.56 * MM * plate.width, -scale]]
    caption = rr.Points3D(front, radii=[0.0], colors=[(255, 255, 255)], labels=["surface, magnified"], show_labels=True)
    stream.log("wave/caption", caption, static=True)
    slow_stages: dict[frozenset[ModalDrive], tuple[float, float]] = {}
    for stage in stages:
        if not stage.excitations or stage.start > last:
            continue
        frequency = max(plate.drives[i].drive_frequency for i in stage.excitations)
        times = min(stage.stop, last) + (np.arange(PERIODS * PICTURES) / PICTURES - PERIODS) / frequency
        motion = np.tensordot(terms.phasor(times, len(shapes)).real, shapes, axes=1)
        motion /= max(float(np.abs(motion).max()), 1e-300)
        stream.set_time(TIMELINE, duration=stage.start)
        log(motion[np.abs(motion).max(axis=1).argmax()])
        stream.reset_time()
        if (drives := frozenset(plate.drives[i] for i in stage.excitations)) in slow_stages:
            continue
        begin = PERIODS * PERIOD_S * len(slow_stages)
        slow_stages[drives] = begin, float(times[-1])
        for i, field in enumerate(motion):
            stream.set_time(SLOW, duration=begin + PERIOD_S * i / PICTURES)
            if i == 0:
                text = f"cycle {stage.cycle}, {stage.name}: {frequency:.0f} Hz" if stage.name else f"{frequency:.0f} Hz"
                stream.log("stage", rr.TextLog(text))
            log(field)
        stream.reset_time()
    return list(slow_stages.values())


def thinned(n: int) -> NDArray[np.int64]:
    """Indices of at most `POINTS` of n grid lines, evenly spaced, including the first and the last."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(np.int64))


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
    for time, field in amplitude_fields(plate, area, terms, last):
        stream.set_time(TIMELINE, duration=time)
        stream.log("plate/surface", rr.Mesh3D.from_fields(vertex_colors=diverging(field)))
    if plate.nodal_lines:
        stream.log("plate/nodal_lines", drawn_lines(plate.nodal_lines), static=True)


def amplitude_fields(
    plate: PlateRecord, area: Area, terms: ModalTerms, last: float, *, step: float = COLOUR_STEP
) -> list[tuple[float, NDArray[np.float64]]]:
    """Times [s] up to `last` at which the amplitude has changed, and its field (n,) at the corners of `area`.

    Fields are over the largest amplitude of all. `step`: of the largest one, by which an amplitude has to change.
    """
    times = np.linspace(0.0, last, ENVELOPE_POINTS)
    phasors = terms.phasor(times, len(plate.mode_shape))
    rows, groups = _colour_rows(np.abs(phasors), step), _driven_together(plate)
    fields = {
        row: area.carried(
            np.sum([_amplitude(phasors[row, group], plate.mode_shape[group]) for group in groups], axis=0)
        )
        for row in rows
    }
    largest = max(max(float(np.abs(field).max()) for field in fields.values()), 1e-300)
    return [(float(times[row]), field / largest) for row, field in fields.items()]


def nodal_lines_of(plate: PlateRecord) -> list[list[NDArray[np.float64]]]:
    """Nodal lines (n, 2) [m] of every mode shape, as far as they are on the plate."""
    from contourpy import contour_generator

    of_shapes = [
        [np.asarray(line) for line in contour_generator(plate.x, plate.y, shape.T).lines(0.0) if len(line) > 1]
        for shape in plate.mode_shape
    ]
    if plate.outline is None:
        return of_shapes
    return [list(plate.outline.kept(lines)) if lines else [] for lines in of_shapes]


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


def _colour_rows(amplitude: NDArray[np.float64], step: float) -> list[int]:
    """Rows of `amplitude` (n, n_shapes) that differ from the row before them in the list by a step, of the largest."""
    step *= max(float(amplitude.max()), 1e-300)
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
