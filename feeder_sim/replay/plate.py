"""The plate in a replay: a flat surface coloured by its signed displacement amplitude; nodal lines; its motion.

The motion is that at the end of every different stage, a few periods of it, magnified and slowed down, on a timeline of
its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.wave import standing_share
from feeder_sim.records.recording import PlateRecord
from feeder_sim.replay.area import Area, area_of, body_mesh
from feeder_sim.replay.scenery import MM, SLOW, TIMELINE, Cuboid, Entry, Lines, Mesh, Texts
from feeder_sim.replay.seed_view import PERIOD_S, PICTURES, SeedView
from feeder_sim.scene.fixture_path import path_of

POINTS = 61  # largest number of grid points per axis of the plate, where it is drawn again and again
HEIGHT = 0.06  # of the highest crest as drawn, over the length of the plate
FIXTURE_S = 0.05  # between two looks at a fixture that moves
PLATE_GREY, NODE, FIXTURE, OUTLET = (190, 190, 195), (20, 20, 20), (120, 130, 145), (179, 89, 0)
ENVELOPE_POINTS = 2001
STANDING = 0.9  # smallest standing share of a wave that is drawn as a standing one, with signs
COLOUR_STEP = 0.04  # of the largest amplitude; the plate is coloured again when an amplitude has changed by so much
COARSE_STEP = 0.12  # of it, on a page
NODE_HEIGHT_MM, BODY_GAP_MM = 0.02, 0.05  # of lines over the surface, and of the body below it, so that both show
COARSE_GAP = 1e-4  # of the length of the plate, on a page


def plate_entries(view: SeedView) -> Iterator[Entry]:
    """The body of the plate, its surface with its colours in time, and the nodal lines of its drive."""
    plate, last = view.plate, max(frames.time[-1] for frames in view.recording.seeds if len(frames))
    area = area_of(plate.x, plate.y, plate.outline)
    yield _body(plate, area, BODY_GAP_MM)
    up = np.tile([0.0, 0.0, 1.0], (len(area.points), 1))
    yield "plate/surface", Mesh(_raised(area.points), area.triangles, normals=up), {}
    for time, field in amplitude_fields(plate, area, view.terms, last, step=COLOUR_STEP):
        yield "plate/surface", Mesh(vertex_colours=diverging(field)), {TIMELINE: time}
    if plate.nodal_lines:
        yield "plate/nodal_lines", _nodal_lines(plate.nodal_lines), {}


def fixture_entries(view: SeedView) -> Iterator[Entry]:
    """What stands on the plate, where it is at rest or moves to by itself; walls of a rim would hide all else."""
    from scipy.spatial.transform import Rotation

    tables = {table.label(number): table for number, table in enumerate(view.scenario.fixtures)}
    for fixture in view.plate.fixtures:
        if fixture.name not in tables:
            continue
        corners = fixture.vertices[fixture.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        vertices, triangles = MM * corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3)
        entity, normals = f"fixtures/{fixture.name}", np.repeat(normals, 3, axis=0)
        if (path := path_of(tables[fixture.name], view.times.stages)) is None:
            yield entity, Mesh(vertices, triangles, FIXTURE, normals=normals), {}
            continue  # what is logged without a time hides all that is logged with one
        looks = [(t, {TIMELINE: t}) for t in np.arange(0.0, view.last, FIXTURE_S).tolist()]
        looks += [(float(view.slow_times(stage)[-1]), {SLOW: begin}) for begin, stage in view.slow_stages]
        for time, moment in looks:
            shift, angle = path.at(time)
            turn = Rotation.from_rotvec(angle * fixture.axis)
            place = MM * (fixture.centre + shift + turn.apply(corners.reshape(-1, 3) - fixture.centre))
            yield entity, Mesh(place, triangles, FIXTURE, normals=turn.apply(normals)), moment


def outlet_entries(view: SeedView) -> Iterator[Entry]:
    """Where parts leave, as a line just above the plate."""
    for name, corners in view.plate.outlets.items():
        closed = np.concatenate([corners, corners[:1]])
        yield f"outlets/{name}", Lines([_raised(closed, NODE_HEIGHT_MM)], OUTLET, 0.3, name), {}


def coarse_plate_entries(view: SeedView) -> Iterator[Entry]:
    """Body and surface in few triangles, with few colours in time, as pixels: fields that come again are the same."""
    plate = view.plate
    # The surface is flat, so that only its edge needs corners.
    x, y = (axis[:: 4 if plate.outline else len(axis) - 1] for axis in (plate.x, plate.y))
    edge = area_of(x, y, plate.outline)
    yield _body(plate, edge, COARSE_GAP * plate.length * MM)
    shape, (rows, columns) = (len(plate.x), len(plate.y)), (thinned(len(axis)) for axis in (plate.x, plate.y))
    low, high = (np.array([plate.x[i], plate.y[i]]) for i in (0, -1))
    pixel = 1.0 / np.array([len(rows), len(columns)])
    uv = 0.5 * pixel + (edge.points - low) / (high - low) * (1.0 - pixel)
    yield "plate/surface", Mesh(_raised(edge.points), edge.triangles, uv=uv), {}
    fields: dict[bytes, NDArray[np.float64]] = {}
    grid = area_of(plate.x, plate.y, None)
    for time, field in amplitude_fields(plate, grid, view.terms, view.last, step=COARSE_STEP):
        same = fields.setdefault(np.round(field / COARSE_STEP).astype(np.int8).tobytes(), field)
        colours = diverging(same)[:, :3].reshape(*shape, 3)[rows[:, None], columns]
        yield "plate/surface", Mesh(pixels=colours.transpose(1, 0, 2)[::-1]), {TIMELINE: time}


def _body(plate: PlateRecord, area: Area, gap_mm: float) -> Entry:
    """What is below the surface."""
    if plate.outline is None:
        sides = np.array([plate.length, plate.width, plate.thickness]) * MM
        return "plate/body", Cuboid((0.0, 0.0, -0.5 * sides[2] - gap_mm), sides, PLATE_GREY), {}
    corners, faces = body_mesh(area, plate.outline, plate.thickness, gap_mm / MM)
    return "plate/body", Mesh(MM * corners, faces, PLATE_GREY), {}


def stage_entries(view: SeedView) -> Iterator[Entry]:
    """Nodal lines of the modes that a stage drives, and its name."""
    lines_of_shape = nodal_lines_of(view.plate)
    for stage, begin in view.stages:
        shapes = sorted({view.plate.drives[i].shape for i in stage.excitations})
        lines = [line for shape in shapes for line in lines_of_shape[shape]]
        yield "plate/nodal_lines", _nodal_lines(lines) if lines else None, begin
        yield "stage", f"cycle {stage.cycle}, {stage.name}" if stage.cycle else stage.name, begin


def wave_entries(view: SeedView) -> Iterator[Entry]:
    """The surface in slow motion; on the real timeline it is that at its largest amplitude in a stage."""
    plate = view.plate
    rows, columns = (thinned(len(axis)) for axis in (plate.x, plate.y))
    area = area_of(plate.x[rows], plate.y[columns], plate.outline)
    shapes = np.stack([area.carried(shape) for shape in plate.mode_shape[:, rows[:, None], columns]])
    scale = HEIGHT * plate.length * MM

    def surface(field: NDArray[np.float64]) -> Mesh:
        """A deflection (n,), whose largest value over time is 1."""
        return Mesh(_raised(area.points, scale * field), area.triangles, vertex_colours=diverging(field))

    front = [[0.0, -0.56 * MM * plate.width, -scale]]
    yield "wave/caption", Texts(["surface, magnified"], front, [(255, 255, 255)], 0.0), {}
    begins = {stage.start: begin for begin, stage in view.slow_stages}
    for stage, start in view.stages:
        if not stage.excitations:
            continue
        motion = np.tensordot(view.terms.phasor(view.slow_times(stage), len(shapes)).real, shapes, axes=1)
        motion /= max(float(np.abs(motion).max()), 1e-300)
        yield "wave/surface", surface(motion[np.abs(motion).max(axis=1).argmax()]), {TIMELINE: start[TIMELINE]}
        if (begin := begins.get(stage.start)) is not None:
            frequency = f"{max(plate.drives[i].drive_frequency for i in stage.excitations):.0f} Hz"
            text = f"cycle {stage.cycle}, {stage.name}: {frequency}" if stage.name else frequency
            yield "stage", text, {SLOW: begin}
            for i, field in enumerate(motion):
                yield "wave/surface", surface(field), {SLOW: begin + PERIOD_S * i / PICTURES}


def thinned(n: int) -> NDArray[np.int64]:
    """Indices of at most `POINTS` of n grid lines, evenly spaced, including the first and the last."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).round().astype(np.int64))


def _raised(points: NDArray[np.float64], height: NDArray[np.float64] | float = 0.0) -> NDArray[np.float64]:
    """Points (n, 2) [m] at a height [mm]: (n, 3) [mm]."""
    return np.column_stack([MM * points, np.broadcast_to(height, len(points))])


def _nodal_lines(lines: Sequence[NDArray[np.float64]]) -> Lines:
    """Polylines (n, 2) [m], drawn just above the plate."""
    return Lines([_raised(line, NODE_HEIGHT_MM) for line in lines], NODE, 0.12)


def amplitude_fields(
    plate: PlateRecord, area: Area, terms: ModalTerms, last: float, *, step: float
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
    return [list(plate.outline.inside(lines)) if lines else [] for lines in of_shapes]


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
