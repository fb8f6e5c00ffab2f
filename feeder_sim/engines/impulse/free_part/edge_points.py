"""Where a part meets the edge of the plate: pure geometry over a plate that is flat at z = 0.

Each point has a normal, from the plate to the part, and a gap g along it. Seen along a straight piece of the plate's
edge that piece is a point, and the part a convex figure whose outline is made of its own edges and faces.

hull edge, piece      nearest points of two lines with directions d and e; normal (d x e) / |d x e|
hull face, vertex     a convex vertex of the plate's outline under a face; normal against the face's
circle, piece         an end circle of a cylinder, nearest to a piece that it crosses; d is its tangent
round face            of a cylinder, on a piece: the axis and the piece as two lines, or on a vertex; caps as faces
ball                  nearest points of the edge where its centre is beside the plate: one in every direction around it

Two features that are nearest to each other have dg/dt = v . n to first order, with v of the part's point: the part may
slide along either. Corners over the plate are not points of its edge and are found elsewhere.

What counts: a normal that leans outwards from the plate or nearly upright, and a feature that carries the part along
it. Closed points lie on both features. Those whose gap is open may lie beyond an end of one by as much as the gap, so
that a point is there before it closes. Left out, since they close no gap, are corners and end circles over the edge
from beside, and edges of a hull over a vertex: they may be nearer than what is found.

The side of the plate is not modelled, as if the plate were a sheet. A part that has left the top beside it falls freely
whatever the thickness: a normal less than a degree from level, which belongs to the side, is no contact, nor is a point
deeper than `BESIDE`, nor an edge of the plate that is on the far side of the part. Until then a part that leans on the
edge is held by it, however low its centre is.
"""

from __future__ import annotations

import math
from typing import Any

from feeder_sim.engines.impulse.circles import is_round
from feeder_sim.engines.impulse.free_part.edge_cylinder import cylinder_on_line, under_cylinder
from feeder_sim.engines.impulse.free_part.edge_hull import balls_on_piece, hull_edge_on_line, hull_on_line, under_plane
from feeder_sim.engines.impulse.free_part.edge_piece import (
    BESIDE,
    PARALLEL,
    ROUND,
    WITH_PART,
    nearby,
    row,
    store,
    turned_back,
)
from feeder_sim.engines.impulse.state import arm_of
from feeder_sim.engines.impulse.vectors import difference, plus
from feeder_sim.machine_code import compiled, inlined, is_none, overload
from feeder_sim.part.rigid_part import CORNER_RADIUS

INLINED: Any = {"forceinline": True}  # a call with all arrays takes 0.2 us, to see that no edge is near 2 ns


def edge_points(part, kind, kinds, surface, reach, points):
    """Find where a part is nearer to the edge of the plate than `reach` [m].

    points: records `EDGE_POINT` to fill; where there are more, the nearest ones. Returns their number.
    """
    raise NotImplementedError("for compiled code only")


@overload(edge_points, **INLINED)
def _edge_points(part, kind, kinds, surface, reach, points):
    if is_none(surface.types[surface.fields.index("outline")]):
        return lambda part, kind, kinds, surface, reach, points: _near_rectangle(
            part, kind, kinds, surface, reach, points
        )
    return lambda part, kind, kinds, surface, reach, points: _near_outline(
        part, kind, kinds, surface.outline, reach, points
    )


@inlined
def _near_rectangle(part, kind, kinds, surface, reach, points):
    half = surface.grid_x[surface.grid_x.shape[0] - 1], surface.grid_y[surface.grid_y.shape[0] - 1]
    x, y, far = abs(part.position[0]), abs(part.position[1]), kind.reach + kind.radius + reach
    if (x + far < half[0] and y + far < half[1]) or x - far > half[0] or y - far > half[1] or _off(part, kind, reach):
        return 0
    return _on_sides(part, kind, kinds, half, reach, points)


@inlined
def _near_outline(part, kind, kinds, outline, reach, points):
    if _off(part, kind, reach):
        return 0
    u, v = (part.position[0] - outline.corner_x) / outline.cell, (part.position[1] - outline.corner_y) / outline.cell
    if 0.0 <= u <= outline.distance.shape[0] - 1.0 and 0.0 <= v <= outline.distance.shape[1] - 1.0:
        off = math.sqrt(0.5) * outline.cell  # no place is farther from its point of the grid
        if abs(outline.distance[int(u + 0.5), int(v + 0.5)]) > kind.reach + kind.radius + reach + off:
            return 0
    return _on_outline(part, kind, kinds, outline.edges, reach, points)


@inlined
def _off(part, kind, reach):
    """Whether a part is over the plane of the plate, or under it."""
    size = kind.reach + kind.radius
    return part.position[2] - size > reach or part.position[2] + size < -BESIDE


@compiled
def _on_sides(part, kind, kinds, half, reach, points):
    x, y, far, n = part.position[0], part.position[1], kind.reach + kind.radius + reach, 0
    a, b = half
    if x + far >= a:
        n = _on_piece(part, kind, kinds, ((-a, -b), (a, -b), (a, b)), reach, True, points, n)
    if y + far >= b:
        n = _on_piece(part, kind, kinds, ((a, -b), (a, b), (-a, b)), reach, True, points, n)
    if x - far <= -a:
        n = _on_piece(part, kind, kinds, ((a, b), (-a, b), (-a, -b)), reach, True, points, n)
    if y - far <= -b:
        n = _on_piece(part, kind, kinds, ((-a, b), (-a, -b), (a, -b)), reach, True, points, n)
    return n


@compiled
def _on_outline(part, kind, kinds, edges, reach, points):
    """The polygons stand one behind the other, first the outer one."""
    x, y, far, first, n = part.position[0], part.position[1], kind.reach + kind.radius + reach, 0, 0
    hull = kind.radius <= CORNER_RADIUS and not is_round(kind)
    if hull:
        n = _hull_on_outline(part, kind, kinds, edges, reach, points)
    for k in range(edges.shape[0]):
        ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        if k > 0 and (ax != edges[k - 1, 2] or ay != edges[k - 1, 3]):
            first = k
        if min(ax, bx) > x + far or max(ax, bx) < x - far or min(ay, by) > y + far or max(ay, by) < y - far:
            continue
        p = k - 1 if k > first else _last(edges, first)
        place = (edges[p, 0], edges[p, 1]), (ax, ay), (bx, by)
        if hull and not _is_convex(place):
            continue
        n = _on_piece(part, kind, kinds, place, reach, not hull, points, n)
    return n


@inlined
def _last(edges, first):
    """The last edge of the polygon that begins with an edge."""
    k = first
    while k + 1 < edges.shape[0] and edges[k + 1, 0] == edges[k, 2] and edges[k + 1, 1] == edges[k, 3]:
        k += 1
    return k


@compiled
def _hull_on_outline(part, kind, kinds, edges, reach, points):
    """Points of a hull between the vertices of an outline: most of its edges are near few of all pieces."""
    corners, n, near = kinds.corners[kind.corner_from : kind.corner_to], 0, nearby(kind, reach)
    left = front = math.inf
    right = back = -math.inf
    for e in range(kind.edge_from, kind.edge_to):
        c, d = _near_plane(part, corners, kinds.edges[e], near)
        if c[2] <= near:
            left, right = min(left, c[0], d[0]), max(right, c[0], d[0])
            front, back = min(front, c[1], d[1]), max(back, c[1], d[1])
    low, high = edges.shape[0], -1  # of the pieces that are near any
    for k in range(edges.shape[0]):
        ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        if (
            min(ax, bx) <= right + near
            and max(ax, bx) >= left - near
            and min(ay, by) <= back + near
            and max(ay, by) >= front - near
        ):
            low, high = min(low, k), k
    if high < 0:
        return 0
    for e in range(kind.edge_from, kind.edge_to):
        c, d = _near_plane(part, corners, kinds.edges[e], near)
        if c[2] > near:
            continue
        left, right = min(c[0], d[0]) - near, max(c[0], d[0]) + near
        front, back = min(c[1], d[1]) - near, max(c[1], d[1]) + near
        x, y = d[0] - c[0], d[1] - c[1]
        beside = near * math.sqrt(x * x + y * y)
        for k in range(low, high + 1):
            ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
            if min(ax, bx) > right or max(ax, bx) < left or min(ay, by) > back or max(ay, by) < front:
                continue
            p, q = x * (ay - c[1]) - y * (ax - c[0]), x * (by - c[1]) - y * (bx - c[0])
            if min(p, q) > beside or max(p, q) < -beside:
                continue
            length = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
            piece = (bx - ax) / length, (by - ay) / length, length, (ax, ay)
            ends = kinds.edges[e, 0], kinds.edges[e, 1]
            n = hull_edge_on_line(part, kind, corners, ends, piece, reach, points, n)
    return n


@inlined
def _near_plane(part, corners, ends, near):
    """The ends of that piece of an edge of a hull that is near the plane of the plate [m]; both above it if none is."""
    a, b = (
        plus(part.position, 1.0, arm_of(part, corners, ends[0])),
        plus(part.position, 1.0, arm_of(part, corners, ends[1])),
    )
    if min(a[2], b[2]) > near or max(a[2], b[2]) < -near:
        above = 0.0, 0.0, math.inf
        return above, above
    low, high = 0.0, 1.0  # of the way from a to b
    if a[2] != b[2]:
        one, other = (-near - a[2]) / (b[2] - a[2]), (near - a[2]) / (b[2] - a[2])
        low, high = max(low, min(one, other)), min(high, max(one, other))
    c, d = plus(a, low, difference(b, a)), plus(a, high, difference(b, a))
    return (c[0], c[1], 0.0), (d[0], d[1], 0.0)


@inlined
def _is_convex(place):
    """Whether the plate is less than half a turn around the first vertex of a piece."""
    before, begin, end = place
    x, y, u, v = end[0] - begin[0], end[1] - begin[1], begin[0] - before[0], begin[1] - before[1]
    turn = u * y - v * x
    return turn > 0.0 and turn * turn > PARALLEL * PARALLEL * (x * x + y * y) * (u * u + v * v)


@compiled
def _on_piece(part, kind, kinds, place, reach, lines, points, n):
    """Points on a straight piece of the edge, if `lines`, and on its first vertex.

    place: the vertex before it, its own first and last, (x, y) each, with the plate on the left [m].
    """
    before, begin, end = place
    x, y, u, v = end[0] - begin[0], end[1] - begin[1], begin[0] - before[0], begin[1] - before[1]
    far, convex = kind.reach + kind.radius + reach, _is_convex(place)
    length, other = math.sqrt(x * x + y * y), math.sqrt(u * u + v * v)
    along, back = (x / length, y / length, 0.0), (-u / other, -v / other, 0.0)
    piece = along[0], along[1], length, begin
    if kind.radius > CORNER_RADIUS:
        return balls_on_piece(part, kind, kinds, piece, back if convex else (0.0, 0.0, 0.0), reach, points, n)
    if lines:
        n = _on_line(part, kind, kinds, piece, reach, points, n)
    x, y, z = begin[0] - part.position[0], begin[1] - part.position[1], -part.position[2]
    if not convex or x * x + y * y + z * z > far * far:
        return n
    r = part.attitude
    vertex = turned_back(r, (x, y, z))
    cone = turned_back(r, along), turned_back(r, back), (r[2, 0], r[2, 1], r[2, 2])
    gap, face, round_by = _under_face(part, kind, kinds, vertex, cone)
    gap -= kind.radius
    if -BESIDE <= gap < reach:
        normal = -row(r, 0, face), -row(r, 1, face), -row(r, 2, face)
        arm = plus((x, y, z), gap, normal)
        turns, radius = WITH_PART, kind.radius
        if round_by > 0.0:
            turns, radius = (ROUND, (r[0, 2], r[1, 2], r[2, 2]), (0.0, 0.0, 0.0), 0.0), kind.radius + round_by
        n = store(n, arm, normal, begin, gap, turns, radius, points)
    return n


@inlined
def _on_line(part, kind, kinds, piece, reach, points, n):
    """Points on a piece between its vertices.

    piece: unit vector (x, y) along it, its length, its first vertex [m].
    """
    if is_round(kind):
        return cylinder_on_line(part, kind, piece, reach, points, n)
    return hull_on_line(part, kind, kinds, piece, reach, points, n)


@inlined
def _under_face(part, kind, kinds, vertex, cone):
    """Gap of a convex vertex under the part [m], infinite under no face; outward normal of that face; its radius [m].

    In body axes: vertex, from the centre of mass; cone: unit vectors along the edge from it to both sides, and up.
    """
    if is_round(kind):
        return under_cylinder(kind, vertex, cone)
    return under_plane(kinds, kinds.piece[part.kind], vertex, cone)
