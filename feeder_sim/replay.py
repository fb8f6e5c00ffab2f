"""Trajectory file -> .rrd for the rerun viewer: plate, nodal lines, part and path in 3D, plots beside them.

The scene is in millimetres. The plate is drawn flat; its colour is the signed displacement amplitude of the surface
(red and blue swing in opposite phase, white is at rest), so nothing is exaggerated. The instantaneous displacement at
kHz would only alias with the frame rate.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.guide import Guide, build_guide
from feeder_sim.plate.nodal_lines import NodalLines
from feeder_sim.scenario import parse_scenario
from feeder_sim.trajectory import Frames, PlateRecord, Recording, read_recording

TIMELINE = "sim_time"
MM = 1e3
PLATE_GREY, LINE_GREY = (190, 190, 195), (150, 150, 150)
NUT, PATH, NODE = (214, 140, 30), (30, 110, 60), (20, 20, 20)
GLASS = (110, 160, 190)
GUIDE_HEIGHT = 18.0  # [mm], as drawn
WINDOW_S = 1.0  # of the plots of a guided part, whose hops are many
COLOUR_STEP = 0.04  # the plate is recoloured when an envelope has moved by this fraction of its maximum


def build_replay(trajectory: Path, replay: Path, *, shown_seed: int = 0) -> None:
    """Build an .rrd from a trajectory file; also works on the file of a run that was killed.

    Args:
        trajectory: HDF5 file of a run.
        replay: file to write, replaced when it exists.
        shown_seed: index of the seed shown in 3D; the plots show all of them.

    Raises:
        InputError: the trajectory cannot be read.
    """
    import rerun as rr

    recording = read_recording(trajectory)
    if not 0 <= shown_seed < len(recording.seeds):
        raise InputError(
            f"is {shown_seed}, allowed is 0 to {len(recording.seeds) - 1}", file=trajectory, key="--show-seed"
        )
    if not len(recording.seeds[shown_seed]):
        raise InputError(f"seed {shown_seed} has no frames yet", file=trajectory)
    partial = replay.with_name(replay.name + ".partial")  # an interrupted build must not look like a replay
    stream = rr.RecordingStream("feeder_sim", recording_id=f"{trajectory.parent.name}-{shown_seed}")
    stream.save(partial, default_blueprint=_blueprint(recording, shown_seed))
    try:
        _log_plate(stream, recording.plate, max(frames.time[-1] for frames in recording.seeds if len(frames)))
        _log_guide(stream, _guide(recording))
        _log_parts(stream, recording, recording.seeds[shown_seed])
        _log_plots(stream, recording, shown_seed)
    finally:
        stream.flush()
        stream.disconnect()
    partial.replace(replay)


def _log_plate(stream: Any, plate: PlateRecord, last: float) -> None:
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
    lines = [np.column_stack([line * MM, np.full(len(line), 0.02)]) for line in plate.nodal_lines]
    if lines:
        stream.log("plate/nodal_lines", rr.LineStrips3D(lines, colors=[NODE], radii=[0.12]), static=True)


def _log_parts(stream: Any, recording: Recording, frames: Frames) -> None:
    """Each part as one static mesh with a moving transform, and the line its centre followed."""
    import rerun as rr
    import trimesh

    time = rr.TimeColumn(TIMELINE, duration=frames.time)
    for i, part in enumerate(recording.parts):
        mesh = trimesh.Trimesh(part.vertices * MM, part.faces, process=False)
        flat = mesh.vertices[mesh.faces].reshape(-1, 3)  # one normal per face, so that edges look sharp
        drawn = rr.Mesh3D(
            vertex_positions=flat,
            triangle_indices=np.arange(len(flat)).reshape(-1, 3),
            vertex_normals=np.repeat(mesh.face_normals, 3, axis=0),
            albedo_factor=NUT,
        )
        stream.log(f"parts/{part.name}", drawn, static=True)
        poses = rr.Transform3D.columns(
            translation=frames.position[:, i] * MM, quaternion=frames.quaternion[:, i][:, [1, 2, 3, 0]]
        )
        stream.send_columns(f"parts/{part.name}", indexes=[time], columns=poses)
        path = rr.LineStrips3D([frames.position[:, i] * MM], colors=[PATH], radii=[0.06])
        stream.log(f"paths/{part.name}", path, static=True)


def _guide(recording: Recording) -> Guide | None:
    """The guide of the recorded part."""
    part = parse_scenario(recording.scenario_text, file=recording.path).part[0]
    return build_guide(part.guide, part.start.position_mm) if part.guide else None


def _log_guide(stream: Any, guide: Guide | None) -> None:
    """The axis of a slide, or the rings of a tube and its outline."""
    import rerun as rr

    if guide is None:
        return
    foot, up = np.array([*guide.foot, 0.0]) * MM, guide.axis
    lines = [np.array([foot, foot + GUIDE_HEIGHT * up])]
    if guide.radius is not None:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        across = np.cross([0.0, 1.0, 0.0], up)
        ring = guide.radius * MM * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * [0.0, 1.0, 0.0])
        lines = [foot + ring + height * up for height in np.linspace(0.0, GUIDE_HEIGHT, 9)]
        lines += [np.array([foot + side, foot + side + GUIDE_HEIGHT * up]) for side in ring[::12]]
    stream.log("guide", rr.LineStrips3D(lines, colors=[GLASS], radii=[0.03]), static=True)


def _log_plots(stream: Any, recording: Recording, shown_seed: int) -> None:
    """Of the first part over time: distance to the nearest nodal line, the shown seed and all others; height of the
    shown one, and its vertical velocity in a guide.
    """
    import rerun as rr

    lines = NodalLines(recording.plate.nodal_lines)
    rest = float(recording.seeds[shown_seed].position[:, 0, 2].min())
    guided = _guide(recording) is not None
    hops = rr.components.AggregationPolicy.Off if guided else rr.components.AggregationPolicy.Max
    for seed, frames in enumerate(recording.seeds):
        shown = seed == shown_seed
        name = "shown" if shown else f"others/seed_{seed:03d}"
        style = rr.SeriesLines(
            colors=[NUT if shown else (*LINE_GREY, 140)],
            widths=[2.0 if shown else 1.0],
            names=[f"seed {seed}"],
            aggregation_policy=hops,  # a plot narrower than the record must not average the hops away
        )
        time = rr.TimeColumn(TIMELINE, duration=frames.time)
        columns = {"height_mm": (frames.position[:, 0, 2] - rest) * MM} if shown else {}
        if shown and guided:
            columns["velocity_mm_s"] = frames.velocity[:, 0, 2] * MM
        if lines.lines:
            columns["distance_mm"] = lines.distance(frames.position[:, 0, :2]) * MM
        for plot, values in columns.items():
            stream.log(f"plots/{plot}/{name}", style, static=True)
            stream.send_columns(f"plots/{plot}/{name}", indexes=[time], columns=rr.Scalars.columns(scalars=values))


def _blueprint(recording: Recording, shown_seed: int) -> Any:
    """Open ready to watch: the 3D scene on the left, the plots on the right, playing along sim_time."""
    import rerun.blueprint as rrb

    plate, guide = recording.plate, _guide(recording)
    antinode = plate.antinode * MM if np.isfinite(plate.antinode).all() else np.zeros(2)
    cell = [NodalLines(plate.nodal_lines).distance(plate.antinode[None])[0] * MM] if plate.nodal_lines else [30.0]
    target, far = [float(antinode[0]) + 0.5 * cell[0], float(antinode[1]), 0.0], 2.0 * cell[0]
    if guide is not None:
        target, far = [*(c * MM for c in guide.foot), 0.4 * GUIDE_HEIGHT], 1.6 * GUIDE_HEIGHT
    eye = rrb.EyeControls3D(
        position=[target[0], target[1] - far, (0.5 if guide else 1.2) * far], look_target=target, eye_up=[0.0, 0.0, 1.0]
    )
    scene = rrb.Spatial3DView(
        origin="/",
        contents=["+ /plate/**", "+ /guide/**", "+ /parts/**", "+ /paths/**"],
        name="Scene (mm), colour = displacement amplitude",
        eye_controls=eye,
        line_grid=False,
        background=[245, 245, 247],
    )
    height = float(np.ptp(recording.seeds[shown_seed].position[:, 0, 2])) * MM
    plots = [_plot("height_mm", "Height above rest (mm), shown seed", height)]
    if guide is not None:
        fastest = float(np.abs(recording.seeds[shown_seed].velocity[:, 0, 2]).max()) * MM
        plots = [
            _plot("velocity_mm_s", "Vertical velocity (mm/s), shown seed", fastest, lowest=-fastest, window=WINDOW_S),
            _plot("height_mm", "Height above rest (mm), shown seed", height, window=WINDOW_S),
        ]
    if plate.nodal_lines:
        plots.insert(0, _plot("distance_mm", "Distance to nodal line (mm): shown seed orange, others grey", cell[0]))
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(*plots), column_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
    )


def _plot(name: str, title: str, largest: float, *, lowest: float = 0.0, window: float | None = None) -> Any:
    """A time series view from the lowest to a little above the largest value, or of `window` [s] around now."""
    import rerun as rr
    import rerun.blueprint as rrb

    axis = rrb.ScalarAxis(range=(1.05 * lowest, 1.05 * max(largest, 1e-6)))
    legend = rrb.PlotLegend(visible=False)  # one orange line and a bundle of grey ones need none
    around = None
    if window:
        sides = [rr.TimeRangeBoundary.cursor_relative(seconds=side * window / 2.0) for side in (-1.0, 1.0)]
        around = rrb.TimeAxis(view_range=rr.TimeRange(*sides))
    return rrb.TimeSeriesView(origin=f"/plots/{name}", name=title, axis_x=around, axis_y=axis, plot_legend=legend)


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
