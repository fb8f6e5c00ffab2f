"""A cylinder over the edge of the plate: where it crosses the upright plane through a straight piece of that edge.

In such a plane the cylinder's lowest point is one of its end circles, where it crosses the plane, or one of its round
face, where the face's normal lies across the edge. A cylinder whose axis is parallel to the edge crosses it with its
circles alone.
"""

from __future__ import annotations

import math

from feeder_sim.machine_code import uncounted

MOST = 5  # points in one plane: two on each circle, one on the round face
PARALLEL = 1e-9  # [1]


@uncounted
def cross_circles(part, kind, begin, end, n, work):
    """Append to work.corners, after the first n, where a cylinder crosses a piece of the edge; returns their number.

    begin, end: of the piece, seen from above (2,) [m]. Nothing for a kind with corners.
    """
    if n + MOST > work.corners.shape[0] or n + MOST > work.point.shape[0]:
        return n
    r, radius, height = part.attitude, kind.circle_radius, kind.circle_height
    along_x, along_y = end[0] - begin[0], end[1] - begin[1]
    length = math.sqrt(along_x * along_x + along_y * along_y)
    along_x, along_y = along_x / length, along_y / length
    from_x, from_y = part.position[0] - begin[0], part.position[1] - begin[1]
    beside, before = from_y * along_x - from_x * along_y, from_x * along_x + from_y * along_y
    # Components of the body axes across and along the edge.
    across = (
        r[1, 0] * along_x - r[0, 0] * along_y,
        r[1, 1] * along_x - r[0, 1] * along_y,
        r[1, 2] * along_x - r[0, 2] * along_y,
    )
    along = (
        r[0, 0] * along_x + r[1, 0] * along_y,
        r[0, 1] * along_x + r[1, 1] * along_y,
        r[0, 2] * along_x + r[1, 2] * along_y,
    )
    size = math.sqrt(across[0] * across[0] + across[1] * across[1])
    for side in (-1.0, 1.0):
        z = side * height
        near = -(beside + across[2] * z)  # R (across . e) in the plane
        if abs(near) >= radius * size:
            continue
        u, v = across[0] / size, across[1] / size
        near /= size
        far = math.sqrt(radius * radius - near * near)
        n = _append(near * u - far * v, near * v + far * u, z, before, along, length, n, work)
        n = _append(near * u + far * v, near * v - far * u, z, before, along, length, n, work)
    size = math.sqrt(along[0] * along[0] + along[1] * along[1])
    if size > PARALLEL and abs(across[2]) > PARALLEL:
        x, y = -radius * along[1] / size, radius * along[0] / size
        if r[2, 0] * x + r[2, 1] * y > 0.0:
            x, y = -x, -y
        z = -(beside + across[0] * x + across[1] * y) / across[2]
        if abs(z) < height:
            n = _append(x, y, z, before, along, length, n, work)
    return n


@uncounted
def _append(x, y, z, before, along, length, n, work):
    """Append a point in body axes [m] if it lies on the piece of the edge, and not beside it."""
    if 0.0 <= before + along[0] * x + along[1] * y + along[2] * z <= length:
        work.corners[n, 0], work.corners[n, 1], work.corners[n, 2] = x, y, z
        n += 1
    return n
