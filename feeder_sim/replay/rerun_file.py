"""A scenery as an .rrd for the rerun viewer, with shadows, and lines down to the plate from parts high above.

The shadow of a part is its convex hull pressed flat along the light, so it has the outline of the part as it lies or
tumbles. A mesh cannot be flat altogether, hence `FLAT`. By a shadow, and by the line, height can be read.

All instances of a mesh have one colour, so a part changes its colour by changing to another mesh.
"""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import rerun as rr
import trimesh
from numpy.typing import NDArray
from scipy.spatial import QhullError

from feeder_sim.replay.blueprint import blueprint
from feeder_sim.replay.layout import Style
from feeder_sim.replay.scenery import Cuboid, Curve, Item, Lines, Mesh, Parts, Scenery, Texts, Times

LIGHT = (0.45, -0.3)  # shift of a shadow in x and y over the height of what casts it
FLAT = 1e-4
HEIGHT_MM = 0.04  # of the shadows over the surface, so that they show; lines lie below
SHADOW = (10, 12, 18, 120)
DROP_LINE = (60, 64, 72)
HIGH = 1.5  # heights of a centre over the radius of a part, from which on it has a line down to the plate
NUMBERED = ("cycle", "stage")  # timelines of numbers; all others are of seconds


def rerun_content(scenery: Scenery, name: str, style: Style) -> bytes:
    """The whole .rrd, with the layout for the viewer or for pictures."""
    stream = rr.RecordingStream("feeder_sim", recording_id=name)
    memory = stream.memory_recording()
    stream.send_blueprint(blueprint(scenery, style), make_active=False, make_default=True)
    light = [[1.0, 0.0, LIGHT[0]], [0.0, 1.0, LIGHT[1]], [0.0, 0.0, FLAT]]
    stream.log("shadows", rr.Transform3D(mat3x3=light, translation=[0.0, 0.0, HEIGHT_MM]), static=True)
    for path, item, times in scenery.entries:
        if isinstance(item, Parts):
            _log_parts(stream, path, item, times)
            continue
        for timeline, time in times.items():
            stream.set_time(timeline, **{_measure(timeline): time})
        stream.log(path, _archetype(item), static=not times)
        stream.reset_time()
    for plot in scenery.plots:
        for curve in plot.curves:
            _log_curve(stream, f"{plot.path}/{curve.path}", curve)
    return bytes(memory.drain_as_bytes())


def _measure(timeline: str) -> Any:
    return "sequence" if timeline in NUMBERED else "duration"


def _columns(times: Times) -> list[Any]:
    return [rr.TimeColumn(timeline, **{_measure(timeline): values}) for timeline, values in times.items()]


def _archetype(item: Item) -> Any:
    """What rerun calls it."""
    match item:
        case Cuboid():
            half = [0.5 * item.sides]
            return rr.Boxes3D(centers=[item.centre], half_sizes=half, colors=[item.colour], fill_mode="solid")
        case Mesh():
            return rr.Mesh3D.from_fields(
                vertex_positions=item.vertices,
                triangle_indices=item.triangles,
                vertex_normals=item.normals,
                vertex_colors=item.vertex_colours,
                albedo_factor=item.colour,
            )
        case Lines(text=text):
            labels: dict[str, Any] = {} if text is None else {"labels": [text], "show_labels": True}
            return rr.LineStrips3D(item.strips, colors=[item.colour], radii=np.atleast_1d(item.radius), **labels)
        case Texts():
            dots: dict[str, Any] = {} if item.places is None else {"radii": [item.radius], "show_labels": True}
            return rr.Points3D.from_fields(positions=item.places, colors=item.colours, labels=item.texts, **dots)
        case str():
            return rr.TextLog(item)
    return rr.Clear(recursive=False)


def _log_curve(stream: Any, path: str, curve: Curve) -> None:

    policy: Any = {None: None, True: "Off", False: "Max"}[curve.every]
    style = rr.SeriesLines.from_fields(
        colors=[curve.colour], widths=[curve.width], names=[curve.name], aggregation_policy=policy
    )
    stream.log(path, style, static=True)
    stream.send_columns(path, indexes=_columns(curve.times), columns=rr.Scalars.columns(scalars=curve.values))


def _log_parts(stream: Any, path: str, parts: Parts, times: Times) -> None:
    """Log parts, as instances of one mesh for each of their colours; their shadows; and lines down from those high up.

    A colour that no part has in these frames is logged, too, or its mesh would stand in the middle of the plate.
    """
    name, columns = path.removeprefix("parts/"), _columns(times)
    if parts.mesh.colour is not None:
        stream.log(path, _faceted(parts.mesh, parts.mesh.colour), static=True)
        attitude = parts.quaternion[:, 0][:, [1, 2, 3, 0]]
        poses = rr.Transform3D.columns(translation=parts.position[:, 0], quaternion=attitude)
        stream.send_columns(path, indexes=columns, columns=poses)
    else:
        for i in parts.used:
            stream.log(f"{path}/{i}", _faceted(parts.mesh, parts.palette[i]), static=True)
            instances = _instances(parts, parts.present & (parts.colour == i))
            stream.send_columns(f"{path}/{i}", indexes=columns, columns=instances)
    stream.log(f"shadows/{name}", _shadow(parts.mesh), static=True)
    stream.send_columns(f"shadows/{name}", indexes=columns, columns=_instances(parts, parts.on_plate))
    radius = np.linalg.norm(parts.mesh.vertices, axis=1).max()
    high = parts.on_plate & (parts.position[..., 2] > HIGH * radius)
    if high.any():
        top = parts.position[high]
        strips = list(np.stack([top, top * [1.0, 1.0, 0.0]], axis=1))
        lines = rr.LineStrips3D.columns(strips=strips).partition(high.sum(axis=1))
        stream.log(f"drop_lines/{name}", rr.LineStrips3D.from_fields(colors=[DROP_LINE], radii=[-1.0]), static=True)
        stream.send_columns(f"drop_lines/{name}", indexes=columns, columns=lines)


def _instances(parts: Parts, visible: NDArray[np.bool_]) -> Any:
    """Poses of parts as instances of a mesh; those not visible (frames, parts) get the scale 0."""
    poses = rr.InstancePoses3D.columns(
        translations=np.where(visible[..., None], parts.position, 0.0).reshape(-1, 3),
        quaternions=parts.quaternion[..., [1, 2, 3, 0]].reshape(-1, 4),
        scales=np.repeat(visible.astype(np.float32).reshape(-1, 1), 3, axis=1),
    )
    return poses.partition(np.full(len(visible), visible.shape[1]))


def _faceted(mesh: Mesh, colour: Any) -> Any:
    """A mesh with one normal per face, so that edges look sharp."""
    solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    vertices = solid.vertices[solid.faces].reshape(-1, 3)  # no face shares a vertex with another
    return rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=np.arange(len(vertices)).reshape(-1, 3),
        vertex_normals=np.repeat(solid.face_normals, 3, axis=0),
        albedo_factor=colour,
    )


def _shadow(mesh: Mesh) -> Any:
    """What casts the shadow of a part: its convex hull, of which only the sides towards the light are drawn."""
    hull = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    with contextlib.suppress(QhullError):  # a drawn mesh may be flat, and is its own hull then
        hull = hull.convex_hull
    return rr.Mesh3D(
        vertex_positions=hull.vertices, triangle_indices=hull.faces, albedo_factor=SHADOW, face_rendering="Front"
    )
