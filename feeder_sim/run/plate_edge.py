"""Where parts are relative to the edge of the plate: over it, clear of the edge, fallen beside it, or lost.

The sides of the plate stop nothing. A part that tips over the edge may swing under the plate by twice its size until
the next frame, and go on falling below the plate. So a part that has once come down beside the plate counts as *fallen*
until it rises above the resting surface again. It is *lost* once it is off the plate and below the floor level.
"""

from __future__ import annotations

from typing import NamedTuple

from feeder_sim.engines.outline_arrays import OutlineArrays, edge_distance, off_plate, outline_arrays
from feeder_sim.machine_code import inlined
from feeder_sim.scene.scene import Scene


class Edge(NamedTuple):
    """The edge of a plate and what is around it.

    half_x, half_y: half the sides [m]; crest: largest height of the surface over the resting plate [m]; floor: its
    height [m]; rim: no part gets beside the plate; enclosed: no part can get over the edge; swing: by how much a part
    may swing under the plate [m]; frame_interval [s]; outline: of a plate that is no whole rectangle, else None.
    """

    half_x: float
    half_y: float
    crest: float
    floor: float
    rim: bool
    enclosed: bool
    swing: float
    frame_interval: float
    outline: OutlineArrays | None


def edge_of(scene: Scene, crest: float) -> Edge:
    """The edge of the plate of a scene whose surface rises by up to `crest` [m]."""
    return Edge(
        half_x=0.5 * scene.surface.length,
        half_y=0.5 * scene.surface.width,
        crest=crest,
        floor=1e-3 * scene.scenario.run.floor_mm,
        rim=scene.rim,
        enclosed=scene.rim or any(scene.guides),
        swing=2.0 * max(kind.size for kind in scene.kinds),
        frame_interval=scene.frame_interval,
        outline=outline_arrays(scene.surface.outline),
    )


@inlined
def over_plate(x, y, edge):
    """Whether a place is above or below the area of the plate."""
    return abs(x) < edge.half_x and abs(y) < edge.half_y and not off_plate(edge.outline, x, y)


@inlined
def clear_of_edge(x, y, velocity_x, velocity_y, size, edge):
    """Whether a part is so far from the edge that it cannot have been over it since the last frame."""
    margin_x = margin_y = size
    if not edge.enclosed:
        margin_x = edge.swing + abs(velocity_x) * edge.frame_interval
        margin_y = edge.swing + abs(velocity_y) * edge.frame_interval
    margin = max(margin_x, margin_y)
    far = edge_distance(edge.outline, x, y, margin) > margin
    return abs(x) < edge.half_x - margin_x and abs(y) < edge.half_y - margin_y and far


@inlined
def has_fallen(z, clear, before, edge):
    """Whether a part has come down beside the plate and not risen above it since; before: at the frame before."""
    return not edge.rim and ((before and z < 0.0) or (z < -edge.crest and not clear))
