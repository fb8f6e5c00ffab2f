"""The axis along which two convex pieces are farthest apart, or least in each other.

Such an axis is normal to a face of one of them, or to an edge of each (Gottschalk, Lin and Manocha, SIGGRAPH 1996). Of
two edges only those count whose arcs on the sphere of normals cross (Gregorius, GDC 2013): they support both pieces.
For pieces that nearly touch the direction between closest points, as a library finds them, is wrong by what these are
off, over the gap; an axis from faces and edges is exact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.state import Kinds
from feeder_sim.engines.impulse.vectors import cross, difference, dot, plus, vector, write_to
from feeder_sim.machine_code import inlined, uncounted

FACES_FIRST = 1e-9  # [m]; an axis of edges has to be better than one of faces by that
NEAR = 1e-5  # [m]; edges farther than that from the other piece do not touch it
# Origins of an axis: what it turns with. CENTRES: those of two balls; BALL: the centre of one, and an edge of the other
# part, or its corner; CLOSEST: points of which no more is known.
FACE_OF_FIRST, FACE_OF_SECOND, EDGES, CENTRES, BALL, CLOSEST = range(6)
PARALLEL = 1e-7  # sine of the angle between two edges, below which they have no axis


class Meeting(NamedTuple):
    """Room for two pieces that meet, all in world axes from the centre of mass of the first part.

    corner (2, n, 3): of either piece [m]; plane (2, f, 4): of its faces, outward normal and offset, see `Kinds`; point
    (m, 3): at which they touch; edge (2, e): of either piece, those that may touch the other. along (2, 3): the
    edges that the axis is normal to, where it is; of a ball one, (0, 0, 0) at a corner.
    """

    corner: NDArray[np.float64]
    plane: NDArray[np.float64]
    edge: NDArray[np.int64]
    point: NDArray[np.float64]
    along: NDArray[np.float64]


def new_meeting(kinds: Kinds) -> Meeting:
    corners = int((kinds.piece["corner_to"] - kinds.piece["corner_from"]).max())
    planes = int((kinds.piece["plane_to"] - kinds.piece["plane_from"]).max())
    edges = int((kinds.piece["edge_to"] - kinds.piece["edge_from"]).max())
    sizes = (2, corners, 3), (2, max(planes, 1), 4), (2 * corners, 3)
    corner, plane, point = (np.zeros(size) for size in sizes)
    return Meeting(corner, plane, np.zeros((2, edges), np.int64), point, np.zeros((2, 3)))


@uncounted
def place_pieces(a, piece_a, b, piece_b, kinds, room):
    """Write corners and planes of both pieces."""
    for end in range(2):
        part, piece = (a, piece_a) if end == 0 else (b, piece_b)
        from_a = difference(part.position, a.position)
        for c in range(piece.corner_to - piece.corner_from):
            corner = turned(part.attitude, kinds.corners[piece.corner_from + c])
            write_to(room.corner[end, c], plus(from_a, 1.0, corner))
        for f in range(piece.plane_to - piece.plane_from):
            plane = kinds.planes[piece.plane_from + f]
            normal = turned(part.attitude, plane)
            write_to(room.plane[end, f], normal)
            room.plane[end, f, 3] = plane[3] - dot(normal, from_a)


@inlined
def turned(attitude, v):
    """A vector in body axes, in those of the world."""
    return (
        attitude[0, 0] * v[0] + attitude[0, 1] * v[1] + attitude[0, 2] * v[2],
        attitude[1, 0] * v[0] + attitude[1, 1] * v[1] + attitude[1, 2] * v[2],
        attitude[2, 0] * v[0] + attitude[2, 1] * v[1] + attitude[2, 2] * v[2],
    )


@uncounted
def separating_axis(piece_a, piece_b, kinds, room):
    """Gap [m] of pieces that have been placed, negative for a depth, the axis along it, from a to b, and its origin."""
    gap, axis, origin = -np.inf, (0.0, 0.0, 1.0), FACE_OF_FIRST
    n = piece_a.corner_to - piece_a.corner_from, piece_b.corner_to - piece_b.corner_from
    for end in range(2):
        piece = piece_a if end == 0 else piece_b
        for f in range(piece.plane_to - piece.plane_from):
            plane, lowest = room.plane[end, f], np.inf
            for c in range(n[1 - end]):
                lowest = min(lowest, dot(plane, room.corner[1 - end, c]) + plane[3])
            if lowest > gap:
                gap, axis = lowest, vector(plane) if end == 0 else (-plane[0], -plane[1], -plane[2])
                origin = FACE_OF_FIRST if end == 0 else FACE_OF_SECOND
    edges_a, edges_b = _near_edges(0, piece_a, piece_b, kinds, room), _near_edges(1, piece_b, piece_a, kinds, room)
    for i in range(edges_a):
        for j in range(edges_b):
            first, second = kinds.edges[room.edge[0, i]], kinds.edges[room.edge[1, j]]
            apart, normal = _between_edges(first, second, room)
            if apart > gap + FACES_FIRST:
                gap, axis, origin = apart, normal, EDGES
                write_to(room.along[0], difference(room.corner[0, first[1]], room.corner[0, first[0]]))
                write_to(room.along[1], difference(room.corner[1, second[1]], room.corner[1, second[0]]))
    return gap, axis, origin


@inlined
def _near_edges(end, piece, other, kinds, room):
    """List the edges of the piece at an end that are not all outside a face of the other one; returns their number."""
    n = 0
    for e in range(piece.edge_from, piece.edge_to):
        p, q = room.corner[end, kinds.edges[e, 0]], room.corner[end, kinds.edges[e, 1]]
        near = True
        for f in range(other.plane_to - other.plane_from):
            plane = room.plane[1 - end, f]
            if min(dot(plane, p), dot(plane, q)) + plane[3] > NEAR:
                near = False
                break
        if near:
            room.edge[end, n] = e
            n += 1
    return n


@inlined
def _between_edges(first, second, room):
    """As `separating_axis`, of two edges; minus infinity where they do not support both pieces.

    An edge is (corner, corner, face, face), such that it runs along the second normal times the first.
    """
    p, q = room.corner[0, first[0]], room.corner[1, second[0]]
    along, other = difference(room.corner[0, first[1]], p), difference(room.corner[1, second[1]], q)
    a, b = room.plane[0, first[2]], room.plane[0, first[3]]
    c, d = room.plane[1, second[2]], room.plane[1, second[3]]
    at_c, at_d = -dot(c, along), -dot(d, along)
    if at_c * at_d >= 0.0:
        return -np.inf, (0.0, 0.0, 1.0)
    at_a, at_b = dot(a, other), dot(b, other)
    if at_a * at_b >= 0.0 or at_c * at_b <= 0.0:
        return -np.inf, (0.0, 0.0, 1.0)
    normal = cross(along, other)
    size = math.sqrt(dot(normal, normal))
    if size <= PARALLEL * math.sqrt(dot(along, along) * dot(other, other)):
        return -np.inf, (0.0, 0.0, 1.0)
    if dot(normal, a) + dot(normal, b) < 0.0:
        size = -size
    normal = normal[0] / size, normal[1] / size, normal[2] / size
    return dot(normal, difference(q, p)), normal
