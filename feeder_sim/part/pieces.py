"""Convex pieces of a concave part, in an OBJ file beside its mesh: by them parts hook and nest.

Layout, in the unit and axes of the mesh, one object per piece; Blender and other programs read it:

    # convex pieces of hook.stl
    # sha256 of the mesh: 5c0e...
    # made by coacd 1.0.14, threshold 0.02 of half the longest side, seed 0
    o piece_0
    v -4.5 -6 0
    f 1 2 3

They are made once, by `feeder-sim part FILE --pieces` (CoACD: Wei, Liu, Ling and Su, ACM Trans. Graphics 41 (2022) 42),
and checked whenever they are read, for anyone may change them.
"""

from __future__ import annotations

import hashlib
import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError, quoted

Floats = NDArray[np.float64]
Piece = tuple[Floats, NDArray[np.int64]]

MOST_PIECES = 256
LARGEST_FILE = 20_000_000  # [byte]
CONVEX = 1e-3  # of the size of a piece: how deep a vertex may lie inside its hull
OUTSIDE = 0.01  # of the longest side: how far a piece may reach out of the hull of the mesh
LEAST_VOLUME = 0.97  # of the mesh, in all pieces together
COARSEST, FINEST = 0.5, 0.01  # of half the longest side: errors that CoACD can be asked for
USUAL = 0.02
HASH = re.compile(r"^# sha256 of the mesh: ([0-9a-f]{64})\s*$", re.MULTILINE)


def pieces_beside(mesh_file: Path) -> Path:
    """Where the pieces of a mesh are by default: hook.stl has hook_pieces.obj."""
    return mesh_file.with_name(f"{mesh_file.stem}_pieces.obj")


def mesh_hash(mesh_file: Path) -> str:
    """SHA-256 of a mesh file."""
    return hashlib.sha256(mesh_file.read_bytes()).hexdigest()


def make_pieces(mesh: Any, unit_mm: float, error_mm: float | None = None) -> tuple[list[Piece], str]:
    """Cut a closed trimesh into convex pieces, and say how.

    Args:
        mesh: in the unit of its file.
        unit_mm: that unit [mm].
        error_mm: about how far the pieces may be from the mesh [mm]; 1 % of the longest side without it.

    Raises:
        InputError: coacd is not installed, or an error that it cannot be asked for.
    """
    half = 0.5 * float(np.ptp(mesh.vertices, axis=0).max())
    threshold = USUAL if error_mm is None else error_mm / (half * unit_mm)
    if not FINEST <= threshold <= COARSEST:
        low, high = (half * unit_mm * limit for limit in (FINEST, COARSEST))
        raise InputError(
            f"is {error_mm:g}, must be {low:.3g} to {high:.3g} for a part of this size", key="--piece-error-mm"
        )
    try:
        import coacd
    except ImportError as error:
        raise InputError("needs coacd, which is not installed: pip install coacd", key="--pieces") from error
    coacd.set_log_level("error")
    cut = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), threshold=threshold, seed=0)
    pieces = [_hull(np.asarray(vertices, float)) for vertices, _ in cut]
    from importlib.metadata import version

    return pieces, f"coacd {version('coacd')}, threshold {threshold:.4g} of half the longest side, seed 0"


def _hull(points: Floats) -> Piece:
    """Corners (n, 3) and faces (m, 3), outside out, of the convex hull of points."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    a, b, c = np.moveaxis(points[hull.simplices], 1, 0)
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return points[hull.vertices], number[faces]


def write_pieces(path: Path, pieces: list[Piece], mesh_file: Path, creator: str) -> None:
    """Write pieces, in the unit of the mesh, as one OBJ object each; see the layout above."""
    lines = [f"# convex pieces of {mesh_file.name}", f"# sha256 of the mesh: {mesh_hash(mesh_file)}"]
    lines.append(f"# made by {creator}")
    first = 1
    for i, (vertices, faces) in enumerate(pieces):
        lines.append(f"o piece_{i}")
        lines += [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices + 0.0]
        lines += [f"f {a} {b} {c}" for a, b, c in faces + first]
        first += len(vertices)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_pieces(path: Path, mesh_file: Path, mesh: Any, *, key: str = "part.pieces") -> list[Floats]:
    """Corners (n, 3) of each convex piece of a mesh, in the unit of its file.

    Args:
        path: of the pieces.
        mesh_file: they were made of.
        mesh: the same, as read by trimesh.
        key: of the scenario.

    Raises:
        InputError: they are missing, unreadable, of another mesh, not convex, or not pieces of this mesh.
    """

    def refusal(problem: str) -> InputError:
        return InputError(problem, file=path, key=key)

    again = f"make them again: feeder-sim part {mesh_file} --pieces --force"
    if not path.is_file():
        raise refusal(f"no such file, make it: feeder-sim part {mesh_file} --pieces")
    if path.stat().st_size > LARGEST_FILE:
        raise refusal(f"has {path.stat().st_size} bytes, must be up to {LARGEST_FILE}; {again}")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise refusal("is no text in UTF-8, must be an OBJ file") from error
    match = HASH.search(text)
    if match is None:
        raise refusal(f'has no line "# sha256 of the mesh: ...", which says what it was made of; {again}')
    if match.group(1) != mesh_hash(mesh_file):
        raise refusal(f"was made of another {mesh_file.name}; {again}")
    pieces = _parsed(text, refusal)
    _check(pieces, mesh, refusal, again)
    return [vertices for vertices, _ in pieces]


def _parsed(text: str, refusal: Any) -> list[Piece]:
    """Vertices and faces of each object of an OBJ file, faces counted within it."""
    vertices: list[list[float]] = []
    groups: list[list[list[int]]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            if words[0] in ("o", "g"):
                groups.append([])
            elif words[0] == "v":
                vertices.append([float(word) for word in words[1:4]])
                if len(vertices[-1]) != 3 or not np.isfinite(vertices[-1]).all():
                    raise ValueError
            elif words[0] == "f":
                if not groups:
                    groups.append([])
                corners = [int(word.split("/")[0]) for word in words[1:]]
                corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                if len(corners) < 3 or not all(0 <= c < len(vertices) for c in corners):
                    raise ValueError
                groups[-1] += [[corners[0], b, c] for b, c in itertools.pairwise(corners[1:])]
        except (ValueError, OverflowError) as error:
            raise refusal(f"line {number} is {quoted(line)}, which no OBJ file has") from error
    groups = [group for group in groups if group]
    if not 1 <= len(groups) <= MOST_PIECES:
        raise refusal(f"has {len(groups)} pieces, must be 1 to {MOST_PIECES}")
    points, pieces = np.array(vertices), []
    for group in groups:
        used, faces = np.unique(np.array(group), return_inverse=True)
        pieces.append((points[used], faces.reshape(-1, 3)))
    return pieces


def _check(pieces: list[Piece], mesh: Any, refusal: Any, again: str) -> None:
    """Refuse what are no convex pieces of a mesh."""
    from scipy.spatial import ConvexHull, QhullError

    longest = float(np.ptp(mesh.vertices, axis=0).max())
    mesh_planes = ConvexHull(np.asarray(mesh.vertices) / longest).equations
    together = 0.0
    for i, (vertices, faces) in enumerate(pieces):
        size = float(np.ptp(vertices, axis=0).max())
        try:
            hull = ConvexHull(vertices / size)
        except (QhullError, ValueError) as error:
            raise refusal(f"piece {i} encloses no volume; {again}") from error
        depth = -(vertices / size @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        middle = (vertices / size)[faces].mean(axis=1)
        depth = np.concatenate([depth, -(middle @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)])
        if depth.max() > CONVEX:
            raise refusal(f"piece {i} is not convex: it lies {depth.max() * size:.3g} inside of its hull; {again}")
        out = longest * float((vertices / longest @ mesh_planes[:, :3].T + mesh_planes[:, 3]).max())
        if out > OUTSIDE * longest:
            raise refusal(f"piece {i} reaches {out:.3g} out of the hull of the mesh; {again}")
        together += float(hull.volume) * size**3
    if together < LEAST_VOLUME * mesh.volume:
        raise refusal(f"its pieces hold {100.0 * together / mesh.volume:.0f} % of the volume of the mesh; {again}")
