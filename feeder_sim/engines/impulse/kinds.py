"""Kinds of parts as compiled code takes them: mass, inertia and hulls; the walls of a rim are a kind of their own."""

from __future__ import annotations

import functools
from collections.abc import Sequence, Sized
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.free_flight import symmetry_axis
from feeder_sim.engines.impulse.own_law import mark_of
from feeder_sim.engines.impulse.state import (
    EXPONENT_FIELDS,
    PIECE,
    POISSON_FIELDS,
    TANGENTIAL_FIELDS,
    ZENER_FIELDS,
    Kinds,
    kind_type,
)
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.plate.zener import log_restitution_table
from feeder_sim.scenario import Contact
from feeder_sim.scene.part import zener_inelasticities
from feeder_sim.scene.scene import Scene

RIM_HEIGHT, RIM_THICKNESS = 0.5, 0.02  # [m]; above and below the plate


def read_kinds(scene: Scene) -> Kinds:
    """Collect the kinds of parts; with a rim, a last one for its walls, see `rim_walls`.

    Spheres at the corners of MuJoCo's parts have a radius of a micrometre; so have the parts here, and both engines
    simulate the same thing.
    """
    kinds, contact = scene.kinds, scene.scenario.contact
    mass = [kind.mass for kind in kinds]
    inertia = [kind.inertia for kind in kinds]
    corners = [np.asarray(kind.in_principal_axes(kind.corners), float) for kind in kinds]
    edges = [_hull(points.tobytes())[0] for points in corners]
    planes = [_hull(points.tobytes())[1] for points in corners]
    pieces = [[np.asarray(kind.in_principal_axes(piece), float) for piece in kind.pieces] for kind in kinds]
    radius = [kind.corner_radius or CORNER_RADIUS for kind in kinds]
    if scene.rim:
        mass.append(np.inf)
        inertia.append(np.full(3, np.inf))
        corners.append(_rim_box(scene))
        edges.append(np.empty((0, 4), np.int64))  # parts lean on its faces only
        planes.append(hull_of(corners[-1])[1])
        pieces.append([])
        radius.append(0.0)
    axis = [symmetry_axis(moments) for moments in inertia]
    circles = np.zeros((len(mass), 2))
    circles[: len(kinds)] = [(kind.circle_radius, kind.corners[:, 2].max()) for kind in kinds]
    record = np.zeros(len(mass), kind_type(_law_fields(contact)))
    record["circle_radius"], record["circle_height"] = circles.T
    record["mass"], record["inertia"], record["radius"], record["axis"] = mass, inertia, radius, axis
    record["reach"] = [  # pieces are thinned by themselves, and may reach farther than the corners
        max(np.linalg.norm(points, axis=1).max() for points in (own, *of))
        for own, of in zip(corners, pieces, strict=True)
    ]
    record["friction"] = contact.friction, contact.part_friction
    record["rolling"] = 1e-6 * contact.rolling_friction_um
    _write_restitution(record, scene)
    record["corner_from"], record["corner_to"] = _places(corners)
    record["edge_from"], record["edge_to"] = _places(edges)
    first, last = _places(pieces)
    has, own = np.array([len(of) > 0 for of in pieces]), np.arange(len(mass))  # else its hull is its only piece
    record["piece_from"] = np.where(has, len(mass) + first, own)
    record["piece_to"] = np.where(has, len(mass) + last, own + 1)
    bodies = corners + [points for of in pieces for points in of]
    for points in (points for of in pieces for points in of):
        edges.append(_hull(points.tobytes())[0])
        planes.append(_hull(points.tobytes())[1])
    piece = _piece_records(bodies, edges, planes)
    piece["centre"][: len(mass)], piece["reach"][: len(mass)] = 0.0, record["reach"]
    return Kinds(record, np.concatenate(bodies), np.concatenate(edges), np.concatenate(planes), piece)


def _law_fields(contact: Contact) -> list[Any]:
    """Marks of the laws of impact that a contact asks for."""
    fields = ZENER_FIELDS if contact.restitution == "zener" else []
    fields = fields + (EXPONENT_FIELDS if contact.restitution_exponent else [])
    if contact.law == "poisson":
        fields = fields + POISSON_FIELDS
    elif contact.law != "newton":
        fields = [*fields, (mark_of(contact.law), "f8")]
    return fields + (TANGENTIAL_FIELDS if contact.tangential_restitution is not None else [])


def _write_restitution(record: NDArray[np.void], scene: Scene) -> None:
    """Restitution on the plate and between parts, and what the laws of impact by choice need."""
    contact = scene.scenario.contact
    if contact.restitution == "zener":
        record["restitution"] = 1.0, contact.part_restitution  # that on the plate bounds what comes of it
        record["zener_inelasticity"], record["zener_table"] = zener_inelasticities(scene), log_restitution_table()
    else:
        record["restitution"] = contact.restitution, contact.part_restitution
    if contact.restitution_exponent:
        record["restitution_exponent"] = contact.restitution_exponent
        record["restitution_speed"] = contact.restitution_speed_m_s
    if contact.tangential_restitution is not None:
        record["tangential_restitution"] = contact.tangential_restitution


def _piece_records(
    corners: list[NDArray[np.float64]], edges: list[NDArray[np.int64]], planes: list[NDArray[np.float64]]
) -> NDArray[np.void]:
    """Records `PIECE` of convex bodies with these corners (n, 3), edges (m, 4) and planes (f, 4)."""
    piece = np.zeros(len(corners), PIECE)
    piece["corner_from"], piece["corner_to"] = _places(corners)
    piece["edge_from"], piece["edge_to"] = _places(edges)
    piece["plane_from"], piece["plane_to"] = _places(planes)
    piece["centre"] = [0.5 * (points.min(axis=0) + points.max(axis=0)) for points in corners]
    apart = zip(corners, piece["centre"], strict=True)
    piece["reach"] = [np.linalg.norm(points - centre, axis=1).max() for points, centre in apart]
    return piece


def _places(lists: Sequence[Sized]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each of several lists begins and ends when they stand one behind the other."""
    ends = np.cumsum([len(rows) for rows in lists])
    return np.concatenate([[0], ends[:-1]]), ends


@functools.lru_cache(maxsize=64)  # the same parts for every seed
def _hull(corners: bytes) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Edges and planes of a hull, from its corners as they lie in memory."""
    return hull_of(np.frombuffer(corners).reshape(-1, 3))


def hull_of(corners: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Edges (m, 4) and planes (f, 4) of the convex hull of corners (n, 3), see `Kinds`; none for corners in a plane."""
    if _in_plane(corners):
        return np.empty((0, 4), np.int64), np.empty((0, 4))
    from scipy.spatial import ConvexHull

    size = np.abs(corners).max()
    hull = ConvexHull(corners / size)
    planes, face = np.unique(hull.equations.round(12), axis=0, return_inverse=True)
    edges = []
    for triangle, neighbours in enumerate(hull.neighbors):
        for opposite, other in enumerate(neighbours):
            if triangle < other and face[triangle] != face[other]:  # else it is a diagonal
                ends = np.delete(hull.simplices[triangle], opposite)
                edges.append([*ends, face[triangle], face[other]])
    table = np.array(edges, np.int64)
    along = corners[table[:, 1]] - corners[table[:, 0]]
    wrong = np.einsum("ij,ij->i", along, np.cross(planes[table[:, 3], :3], planes[table[:, 2], :3])) < 0.0
    table[wrong, :2] = table[wrong, 1::-1]
    return table[np.lexsort(table.T[::-1])], planes * [1.0, 1.0, 1.0, size]


def _in_plane(corners: NDArray[np.float64]) -> bool:
    """Whether corners (n, 3) are too few for a body, or the outline of a part that stays in a plane."""
    return len(corners) < 4 or bool((np.ptp(corners, axis=0) == 0.0).any())


def _rim_box(scene: Scene) -> NDArray[np.float64]:
    """Corners (8, 3) of a box that is a wall along any side of the plate."""
    long = 0.5 * max(scene.surface.length, scene.surface.width) + RIM_THICKNESS
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    return signs * [long, 0.5 * RIM_THICKNESS, RIM_HEIGHT]


def rim_walls(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (walls, 3) [m] and attitudes (walls, 3, 3) of the walls of a rim; none without one."""
    if not scene.rim:
        return np.empty((0, 3)), np.empty((0, 3, 3))
    x, y = 0.5 * (scene.surface.length + RIM_THICKNESS), 0.5 * (scene.surface.width + RIM_THICKNESS)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    centres = np.array([[0.0, y, 0.0], [0.0, -y, 0.0], [x, 0.0, 0.0], [-x, 0.0, 0.0]])
    return centres, np.array([np.eye(3), np.eye(3), quarter, quarter])
