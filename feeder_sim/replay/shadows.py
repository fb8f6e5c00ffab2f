"""Shadows of parts on the plate, and lines down to it from parts high above, by which height can be read.

The shadow of a part is its convex hull pressed flat along the light, so it has the outline of the part as it lies or
tumbles. A mesh cannot be flat altogether, hence `FLAT`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.records.recording import PartRecord, PlateRecord
from feeder_sim.records.trajectory import Frames
from feeder_sim.replay.parts import radius_of
from feeder_sim.replay.plate import MM

LIGHT = (0.45, -0.3)  # shift of a shadow in x and y over the height of what casts it
FLAT = 1e-4
HEIGHT_MM = 0.04  # of the shadows over the surface, so that they show; lines lie below
SHADOW = (10, 12, 18, 120)
DROP_LINE = (60, 64, 72)
HIGH = 1.5  # heights of a centre over the radius of a part, from which on it has a line down to the plate


def log_shadow_plane(stream: Any) -> None:
    """Log what presses flat all that is logged below `shadows`."""
    import rerun as rr

    light = [[1.0, 0.0, LIGHT[0]], [0.0, 1.0, LIGHT[1]], [0.0, 0.0, FLAT]]
    stream.log("shadows", rr.Transform3D(mat3x3=light, translation=[0.0, 0.0, HEIGHT_MM]), static=True)


def shadow_mesh(part: PartRecord) -> Any:
    """What casts the shadow of a part: its convex hull, of which only the sides towards the light are drawn."""
    import rerun as rr
    import trimesh
    from scipy.spatial import QhullError

    hull = trimesh.Trimesh(part.vertices * MM, part.faces, process=False)
    with contextlib.suppress(QhullError):  # a drawn mesh may be flat, and is its own hull then
        hull = hull.convex_hull
    return rr.Mesh3D(
        vertex_positions=hull.vertices, triangle_indices=hull.faces, albedo_factor=SHADOW, face_rendering="Front"
    )


def log_shadows(
    stream: Any,
    plate: PlateRecord,
    entity: str,
    part: PartRecord,
    frames: Frames,
    members: Sequence[int],
    times: Sequence[Any],
) -> None:
    """Log the shadows of parts of one kind that are over the plate, and lines down to it from those high above.

    Args:
        stream: rerun's recording stream.
        plate: that the shadows fall on.
        entity: name of the kind.
        part: the mesh of the kind.
        frames: states of all parts.
        members: indices of the parts of the kind.
        times: columns of the timelines, with a row per frame.
    """
    import rerun as rr

    on_plate = frames.on_plate(plate, -plate.trough)[:, members]
    stream.log(f"shadows/{entity}", shadow_mesh(part), static=True)
    log_instances(stream, f"shadows/{entity}", frames, members, on_plate, times)
    position = frames.position[:, members] * MM
    high = on_plate & (position[..., 2] > HIGH * radius_of(part))
    if not high.any():
        return
    top = position[high]
    strips = list(np.stack([top, top * [1.0, 1.0, 0.0]], axis=1))
    columns = rr.LineStrips3D.columns(strips=strips).partition(high.sum(axis=1))
    stream.log(f"drop_lines/{entity}", rr.LineStrips3D.from_fields(colors=[DROP_LINE], radii=[-1.0]), static=True)
    stream.send_columns(f"drop_lines/{entity}", indexes=times, columns=columns)


def log_instances(
    stream: Any,
    entity: str,
    frames: Frames,
    members: Sequence[int],
    is_shown: NDArray[np.bool_],
    times: Sequence[Any],
) -> None:
    """Log the poses of parts as instances of the mesh of an entity; those not shown (n, m) get the scale 0."""
    import rerun as rr

    position = np.where(is_shown[..., None], frames.position[:, members] * MM, 0.0)
    poses = rr.InstancePoses3D.columns(
        translations=position.reshape(-1, 3),
        quaternions=frames.quaternion[:, members][..., [1, 2, 3, 0]].reshape(-1, 4),
        scales=np.repeat(is_shown.astype(np.float32).reshape(-1, 1), 3, axis=1),
    )
    stream.send_columns(entity, indexes=times, columns=poses.partition(np.full(len(frames), len(members))))
