"""Mesh files: reading one closed surface, and refusing in one line whatever is none, with what to do about it."""

from __future__ import annotations

import re
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.part.mesh_text import obj_facets, off_facets

# Whether the facets of a mesh cross each other: a mesh that intersects itself has no sure volume.
#
# Two facets cross where an edge of one passes through the inside of the other, away from its rim by more than round-
# off. So facets that share an edge or a corner, or just touch, do not cross. Pairs whose boxes overlap are found by
# going down a tree of boxes, on all pairs of a level at once.

Floats = NDArray[np.float64]
Pairs = NDArray[np.int64]

MOST_PAIRS = 30_000_000  # whose boxes overlap, looked at; a million facets of an even mesh have half as many
TOGETHER = 500_000  # pairs looked at at once
DEEP = 1e-5  # of the size: a crossing less deep may be round-off of single precision


def first_crossing(triangles: Floats) -> tuple[int, int, Floats] | None:
    """Two facets (n, 3, 3) that cross, by number, and a point of both (3,); None if none is found."""
    low = triangles.min(axis=(0, 1))
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    unit = (triangles - low) / size
    order = _in_space(unit)
    sorted_facets = unit[order]
    boxes = _tree(sorted_facets)
    waiting: list[tuple[int, Pairs]] = [(0, np.zeros((1, 2), np.int64))]
    looked_at = 0
    while waiting and looked_at < MOST_PAIRS:  # deepest first, so that few pairs wait
        level, pairs = waiting.pop()
        pairs = pairs[_overlap(boxes[level], pairs)]
        if level == len(boxes) - 1:
            looked_at += len(pairs)
            crossing = _cross(sorted_facets, pairs[pairs[:, 0] < pairs[:, 1]])
            if crossing is not None:
                i, j, place = crossing
                first, second = sorted((int(order[i]), int(order[j])))
                return first, second, place * size + low
            continue
        a, b = 2 * pairs[:, 0], 2 * pairs[:, 1]
        below = np.concatenate([np.column_stack([a + i, b + j]) for i in (0, 1) for j in (0, 1)])
        below = below[below[:, 0] <= below[:, 1]]
        waiting += [(level + 1, part) for part in np.array_split(below, 1 + len(below) // TOGETHER)]
    return None


def _in_space(triangles: Floats) -> NDArray[np.int64]:
    """An order of facets in which neighbours in the list are neighbours in space (Morton's)."""
    cell = np.clip(triangles.mean(axis=1) * 1023.0, 0, 1023).astype(np.int64)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _tree(triangles: Floats) -> list[Floats]:
    """Boxes (2^level, 2, 3), low and high, of ever smaller runs of facets; those of no facet overlap nothing."""
    depth = max(1, int(np.ceil(np.log2(len(triangles)))))
    leaves = np.empty((2**depth, 2, 3))
    leaves[:, 0], leaves[:, 1] = np.inf, -np.inf
    leaves[: len(triangles), 0], leaves[: len(triangles), 1] = triangles.min(axis=1), triangles.max(axis=1)
    levels = [leaves]
    for _ in range(depth):
        pairs = levels[0].reshape(-1, 2, 2, 3)
        levels.insert(0, np.stack([pairs[:, :, 0].min(axis=1), pairs[:, :, 1].max(axis=1)], axis=1))
    return levels


def _overlap(boxes: Floats, pairs: Pairs) -> NDArray[np.bool_]:
    a, b = boxes[pairs[:, 0]], boxes[pairs[:, 1]]
    return np.asarray(((a[:, 0] <= b[:, 1]) & (b[:, 0] <= a[:, 1])).all(axis=1))


def _cross(triangles: Floats, pairs: Pairs) -> tuple[int, int, Floats] | None:
    """The first pair of facets of which one has an edge through the other."""
    for first, second in (pairs.T, pairs.T[::-1]):
        plane, edge = triangles[first], triangles[second]
        normal = np.cross(plane[:, 1] - plane[:, 0], plane[:, 2] - plane[:, 0])
        area = np.linalg.norm(normal, axis=1)
        good = area > DEEP**2
        normal = normal / np.where(good, area, 1.0)[:, None]
        height = np.einsum("nk,njk->nj", normal, edge - plane[:, :1])
        for j in range(3):
            a, b = height[:, j], height[:, (j + 1) % 3]
            through = good & (a * b < 0.0) & (np.abs(a) > DEEP) & (np.abs(b) > DEEP)
            some = np.flatnonzero(through)
            if not len(some):
                continue
            share = (a[some] / (a[some] - b[some]))[:, None]
            place = edge[some, j] + share * (edge[some, (j + 1) % 3] - edge[some, j])
            inside = np.ones(len(some), bool)
            for k in range(3):
                along = plane[some, (k + 1) % 3] - plane[some, k]
                inwards = np.cross(normal[some], along)
                inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
                inside &= ((place - plane[some, k]) * inwards).sum(axis=1) > DEEP
            if inside.any():
                k = int(np.flatnonzero(inside)[0])
                return int(first[some[k]]), int(second[some[k]]), place[k]
    return None


MESH_SUFFIXES = (".stl", ".obj", ".ply", ".off")
FARTHEST_MM = 1e5  # as for all lengths of a scenario
SHORTEST_MM, LONGEST_MM = 0.1, 300.0  # longest sides of parts that plates feed
MOST_FACETS = 1_000_000  # read in 2 s and 1 GB
MOST_BYTES_OF_TEXT = 20_000_000  # of OBJ and OFF, whose numbers take 40 times as much while they are read
MOST_BYTES = 300 * MOST_FACETS  # what as many facets take as text
FLAT = 1e-6  # of the longest side
NO_AREA = 1e-9  # of a facet over the square of its longest side
TEXT = {".obj": obj_facets, ".off": off_facets}
NORMALS_AGREE = 1e-3  # share of the facets whose stored normals may point the other way: slivers
HEADER, FACET = 84, 50  # [byte] of a binary STL file
BINARY_FACET = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("attribute", "<u2")])
FEWER = "reduce them first (Blender: modifier Decimate; MeshLab: Quadric Edge Collapse Decimation)"
TURN = "turn them outwards (Blender: Mesh > Normals > Recalculate Outside; MeshLab: Re-Orient All Faces Coherently)"

Refusal = Callable[[str], InputError]


def closed_mesh(path: Path, unit_mm: float, *, key: str = "part.file") -> Any:
    """The one closed surface in a mesh file; what the file names besides, as colours and pictures, is left alone.

    Args:
        path: of the file.
        unit_mm: its unit of length [mm].
        key: of the scenario, for messages.

    Returns:
        A `trimesh.Trimesh` in the unit of the file, its facets turned outwards.

    Raises:
        InputError: the file is missing, unreadable or too large; its mesh is empty, of an unlikely size, flat, open,
            inside out, of several bodies, or intersects itself.
    """

    def refusal(problem: str) -> InputError:
        return InputError(problem, file=path, key=key)

    mesh = read_triangles(path, refusal)
    _check_size(mesh, unit_mm, refusal)
    mesh = _joined(mesh, refusal)
    _check_closed(mesh, unit_mm, refusal)
    _check_outside_out(mesh, path, refusal)
    if mesh.body_count > 1:
        raise refusal(f"holds {mesh.body_count} bodies or cavities, must be one body without closed cavities")
    crossing = first_crossing(np.asarray(mesh.triangles))
    if crossing is not None:
        first, second, place = crossing
        raise refusal(
            f"intersects itself: facets {first} and {second} cross at {_place(place, unit_mm)}; unite what overlaps "
            "(Blender: Boolean, Union) before it is written"
        )
    return mesh


def file_state(path: Path | None) -> tuple[int, int] | None:
    """What changes with a file, for what is kept of it; None without one."""
    if path is None or not path.is_file():
        return None
    status = path.stat()
    return status.st_mtime_ns, status.st_size


def read_triangles(path: Path, refusal: Refusal) -> Any:
    """The `trimesh.Trimesh` in a mesh file, whatever its triangles enclose, in the unit of the file.

    Raises:
        InputError: made by `refusal`; the file is missing, unreadable, too large, or holds no triangles.
    """
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise refusal(f"is {path.suffix!r}, must be {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise refusal("no such mesh file")
    _check_facets(path, refusal)
    return _loaded(path, refusal)


def _check_facets(path: Path, refusal: Refusal) -> None:
    """Refuse a file of too many facets before it is read, where its header tells their number or its size does."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(4096)
    number = 0
    if path.suffix.lower() == ".stl" and len(head) >= HEADER:
        (facet_count,) = struct.unpack("<I", head[80:HEADER])
        number = facet_count if size == HEADER + FACET * facet_count else 0
    elif path.suffix.lower() == ".ply":
        match = re.search(rb"element face (\d{1,12})\s", head)
        number = int(match.group(1)) if match else 0
    if number > MOST_FACETS:
        raise refusal(f"has {number} facets, must be up to {MOST_FACETS}: {FEWER}")
    if path.suffix.lower() in TEXT and size > MOST_BYTES_OF_TEXT:
        raise refusal(f"has {1e-6 * size:.0f} MB, must be up to {1e-6 * MOST_BYTES_OF_TEXT:.0f} MB: {FEWER}")
    if size > MOST_BYTES:
        raise refusal(f"has {1e-6 * size:.0f} MB, must be up to {1e-6 * MOST_BYTES:.0f} MB: {FEWER}")


def _loaded(path: Path, refusal: Refusal) -> Any:
    import trimesh

    suffix = path.suffix.lower()
    try:
        with warnings.catch_warnings(action="ignore"):  # of numbers that are refused below
            if suffix in TEXT:
                text = path.read_text(encoding="utf-8-sig", errors="replace")  # names may have any alphabet
                mesh = trimesh.Trimesh(*TEXT[suffix](text, MOST_FACETS), process=False)
                mesh.remove_unreferenced_vertices()
            else:
                mesh = trimesh.load_mesh(path, resolver={}, skip_materials=True)
    except (ImportError, UnicodeError) as error:  # the first of a module that guesses the alphabet of a text
        raise refusal("not a readable mesh: damaged, or its text is not in UTF-8") from error
    except Exception as error:  # the readers of the formats raise what they like
        raise refusal(f"not a readable mesh: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise refusal("holds no triangles")
    if mesh.vertices.shape[1:] != (3,):
        raise refusal(f"has vertices of {mesh.vertices.shape[1]} coordinates, must be 3")
    if len(mesh.faces) > MOST_FACETS:
        raise refusal(f"has {len(mesh.faces)} facets, must be up to {MOST_FACETS}: {FEWER}")
    return mesh


def _joined(mesh: Any, refusal: Refusal) -> Any:
    """The mesh with corners at one place as one, without facets of no area that nothing needs.

    A facet whose three corners lie on a line is needed where others meet each of its sides: it stays if the mesh is
    closed with it. `metadata["dropped_facets"]` counts the others.
    """
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    facets = np.asarray(mesh.faces)
    number = len(facets)
    a, b, c = facets.T
    mesh.update_faces((a != b) & (b != c) & (c != a))
    if len(mesh.faces) == 0:
        raise refusal("holds no triangles that have an area")
    if not mesh.is_watertight:
        sides = np.linalg.norm(np.roll(mesh.triangles, -1, axis=1) - mesh.triangles, axis=2).max(axis=1, initial=0.0)
        has_area = mesh.area_faces > NO_AREA * sides**2
        without = mesh.copy()
        without.update_faces(has_area)
        mesh = without if without.is_watertight else mesh
    mesh.remove_unreferenced_vertices()
    mesh.metadata["dropped_facets"] = number - len(mesh.faces)
    return mesh


def _check_size(mesh: Any, unit_mm: float, refusal: Refusal) -> None:
    """Refuse a size that no fed part has, as in a file of another unit."""
    reach = float(np.abs(mesh.vertices).max()) * unit_mm
    if not reach <= FARTHEST_MM:
        raise refusal(f"reaches {reach:g} mm from its origin, must be up to {FARTHEST_MM:g} mm")
    sides = np.ptp(mesh.vertices, axis=0) * unit_mm
    longest = float(sides.max())
    if not SHORTEST_MM <= longest <= LONGEST_MM:
        raise refusal(
            f"is {longest:.4g} mm long with file_unit_mm = {unit_mm:g}, must be {SHORTEST_MM:g} to {LONGEST_MM:g} "
            "mm: file_unit_mm is 0.001 for a file in micrometres, 25.4 for inches, 1000 for metres"
        )
    if float(sides.min()) <= FLAT * longest:
        size = " x ".join(f"{side:.4g}" for side in sides)
        raise refusal(f"is flat and encloses no volume ({size} mm), must be the surface of a solid body")


def _check_closed(mesh: Any, unit_mm: float, refusal: Refusal) -> None:
    """Refuse a surface with open edges, or with edges of more than two facets; say where the first is."""
    if mesh.is_watertight:
        return
    edges, facets = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    for problem, wrong in (
        ("is an open mesh, must be a closed (watertight) one: {} open edges", edges[facets == 1]),
        ("has {} edges where more than two facets meet", edges[facets > 2]),
    ):
        if len(wrong):
            place = np.asarray(mesh.vertices)[wrong[0]].mean(axis=0)
            raise refusal(
                f"{problem.format(len(wrong))}, the first at {_place(place, unit_mm)}; fill or mend it (Blender: 3D "
                "Print Toolbox, Make Manifold)"
            )
    raise refusal("is an open mesh, must be a closed (watertight) one")


def _check_outside_out(mesh: Any, path: Path, refusal: Refusal) -> None:
    """Refuse a closed surface that does not say plainly which side of it is outside."""
    if not mesh.is_winding_consistent:
        raise refusal(f"has facets that are turned against their neighbours: {TURN}")
    volume = float(mesh.volume)
    if volume < 0.0:
        raise refusal(f"is inside out, all its facets point inwards: {TURN}")
    if not volume > FLAT * float(np.ptp(mesh.vertices, axis=0).prod()):
        raise refusal("encloses no volume, must be the surface of a solid body")
    wrong, of = stored_normals_against(path)
    if wrong > NORMALS_AGREE * of:
        raise refusal(
            f"contradicts itself: {wrong} of {of} stored normals point against the order of the corners of their "
            f"facets; {TURN}"
        )


def stored_normals_against(path: Path) -> tuple[int, int]:
    """How many normals stored in an STL file point against the order of the corners, and how many there are.

    Normals of no length, which many programs write, say nothing and are not counted.
    """
    if path.suffix.lower() != ".stl":
        return 0, 0
    data = path.read_bytes()
    (facet_count,) = struct.unpack("<I", data[80:HEADER]) if len(data) >= HEADER else (0,)
    if len(data) == HEADER + FACET * facet_count:
        facets = np.frombuffer(data, BINARY_FACET, offset=HEADER)
        normal, corner = facets["normal"].astype(float), facets["corner"].astype(float)
    else:
        number = rb"[-+.\deE]+"
        normals = re.findall(rb"normal\s+(%b)\s+(%b)\s+(%b)" % (number, number, number), data, re.IGNORECASE)
        corners = re.findall(rb"vertex\s+(%b)\s+(%b)\s+(%b)" % (number, number, number), data, re.IGNORECASE)
        if not normals or 3 * len(normals) != len(corners):
            return 0, 0
        normal, corner = np.array(normals, float), np.array(corners, float).reshape(-1, 3, 3)
    turned = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    along = (normal * turned).sum(axis=1)
    is_defined = np.isfinite(along) & (along != 0.0)
    return int((along[is_defined] < 0.0).sum()), int(is_defined.sum())


def _place(point: NDArray[np.float64], unit_mm: float) -> str:
    """A point of the file in words."""
    return "({:.4g}, {:.4g}, {:.4g}) mm".format(*(point * unit_mm))
