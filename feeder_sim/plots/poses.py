"""Picture of the stable poses of a part: each on a plate, seen obliquely, all to the same scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.document.figure import MM, empty_figure
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.stable_poses import StablePose

if TYPE_CHECKING:
    from feeder_sim.studies.drops import DropStudy

Floats = NDArray[np.float64]

MOST = 24  # poses in one picture, the most frequent ones
PER_ROW = 5
FINEST, LIFT = 0.06, 0.05  # longest side of what is sorted; edges before faces; over the reach
ZOOM = 1.03  # the plate just fits
AZIMUTH_DEG, ELEVATION_DEG = -60.0, 28.0  # of the eye
ACROSS_DEG = (28.0, 15.0, 42.0, 0.0, 57.0)  # between what is long and the width of the picture, best first
LIGHT = np.array([-0.35, -0.55, 1.0]) / np.linalg.norm([-0.35, -0.55, 1.0])
STEEL, INK, PLATE, SHADOW = (0.47, 0.58, 0.72), (0.10, 0.13, 0.18), (0.93, 0.92, 0.89), (0.76, 0.75, 0.73)
SHARP_DEG = 25.0  # edges between faces that meet at a larger angle are drawn
MARGIN = 1.12  # of the plate shown, over the reach of the part


def draw_poses(part: RigidPart, poses: Sequence[StablePose], path: Path, study: DropStudy | None = None) -> None:
    """Draw the stable poses of a part, with the shares of a drop study if there is one; the suffix is the file type."""
    selected = sorted(range(len(poses)), key=lambda i: -poses[i].chance)[:MOST]
    selected.sort()
    rows = math.ceil(len(selected) / PER_ROW)
    columns = math.ceil(len(selected) / rows)
    figure = empty_figure(2.6 * columns, 2.4 * rows + 0.4)
    figure.suptitle(_heading(part, len(poses), len(selected), study), fontsize=10)
    reach = MARGIN * max(_reach(part), 1e-9)
    for place, i in enumerate(selected):
        axes = figure.add_subplot(rows, columns, place + 1, projection="3d", computed_zorder=False)
        axes.set_axis_off()
        draw_pose(axes, part, poses[i].attitude[0], poses[i].height, reach)
        axes.set_title(_title(poses[i], i, study), fontsize=9, y=0.98)
    figure.savefig(path, dpi=150)


def _heading(part: RigidPart, n: int, n_drawn: int, study: DropStudy | None) -> str:
    text = f"{part.name}: {n} stable pose{'s' if n > 1 else ''}"
    if n_drawn < n:
        text += f", the {n_drawn} most likely ones"
    if study is not None:
        text += f"; shares of {len(study.pose):,} drops"
        if study.other:
            text += f", {100.0 * study.other / len(study.pose):.2g} % in none of them"
    return text


def _title(pose: StablePose, i: int, study: DropStudy | None) -> str:
    share = f"{100.0 * pose.chance:.1f} % (put down slowly)"
    if study is not None:
        estimate = study.shares[i]
        share = f"{100.0 * estimate.value:.1f} ± {100.0 * estimate.standard_error:.1f} %"
    return f"{pose.name}   {share}\ncentre {pose.height * MM:.2f} mm high"


def _reach(part: RigidPart) -> float:
    """Largest distance of a drawn point from the centre of mass [m]."""
    return float(np.linalg.norm(part.vertices, axis=1).max())


def draw_pose(axes: Any, part: RigidPart, attitude: Floats, height: float, reach: float) -> None:
    """Draw a part on a plate, for an attitude (4,) and a height of its centre [m].

    `reach` is what the picture shows around the centre [m].
    """
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection
    from scipy.spatial.transform import Rotation

    at = Rotation.from_quat(attitude, scalar_first=True).apply(part.vertices)
    at = _turned_to_view(at + np.array([0.0, 0.0, height]), part.faces)
    azimuth, elevation = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
    level = math.cos(elevation)
    eye = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
    triangles = _small(at, part.faces, FINEST * reach)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normal, axis=1)
    triangles, normal = triangles[area > 0.0], normal[area > 0.0] / area[area > 0.0, None]
    thrown = triangles - (triangles[:, :, 2] / LIGHT[2])[:, :, None] * LIGHT  # to the plate, along the light
    shade = 0.45 + 0.55 * np.clip(normal @ LIGHT, 0.0, 1.0) + 0.12 * np.clip(normal @ eye, 0.0, 1.0)
    seen = normal @ eye > 0.0
    steel = np.clip(shade[seen, None] * STEEL * 1.25, 0.0, 1.0)
    lines = _sharp_edges(part, at, FINEST * reach) + LIFT * reach * eye
    colours = np.concatenate([steel, np.tile(INK, (len(lines), 1))])
    widths = np.repeat([0.3, 0.5], [len(steel), len(lines)])
    corners = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    axes.add_collection3d(Poly3DCollection([corners], facecolors=[PLATE], zorder=0))
    axes.add_collection3d(Poly3DCollection(thrown, facecolors=[SHADOW], edgecolors=[SHADOW], linewidths=0.3, zorder=1))
    # Faces and edges are sorted together, so that what is behind hides nothing.
    drawn = np.concatenate([triangles[seen], lines])
    axes.add_collection3d(Poly3DCollection(drawn, facecolors=colours, edgecolors=colours, linewidths=widths, zorder=2))
    axes.set_proj_type("ortho")
    axes.view_init(ELEVATION_DEG, AZIMUTH_DEG)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(0.0, reach))
    axes.set_box_aspect((2.0, 2.0, 1.0), zoom=ZOOM)


def _small(points: Floats, faces: NDArray[np.int64], longest: float) -> Floats:
    """Triangles (n, 3, 3) with sides up to a length, which can be sorted by their distance from the eye."""
    import trimesh

    smaller, numbers = trimesh.remesh.subdivide_to_size(points, faces, longest)
    return np.asarray(smaller[numbers])


def _turned_to_view(points: Floats, faces: NDArray[np.int64]) -> Floats:
    """Points (n, 3) turned about the vertical: what is long lies across the view, and no large face is seen edge on."""
    long = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), full_matrices=False)[2][0]
    a, b, c = np.moveaxis(points[faces], 1, 0)
    normal = np.cross(b - a, c - a)[:, :2]
    area, azimuth = np.linalg.norm(normal, axis=1), np.arctan2(normal[:, 1], normal[:, 0])

    def turn(across: float) -> float:
        return math.radians(AZIMUTH_DEG + 90.0 + across) - math.atan2(long[1], long[0])

    def slanted(across: float) -> float:
        to_eye = azimuth + turn(across) - math.radians(AZIMUTH_DEG)
        return round(float((area * np.minimum(np.abs(np.sin(2.0 * to_eye)), 0.8)).sum() / area.sum()), 3)

    angle = turn(max(ACROSS_DEG, key=slanted))
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def _sharp_edges(part: RigidPart, points: Floats, longest: float) -> Floats:
    """Edges at which faces meet at an angle, in pieces up to a length: triangles (n, 3, 3) without area."""
    import trimesh

    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    sharp = mesh.face_adjacency_edges[mesh.face_adjacency_angles > math.radians(SHARP_DEG)]
    return _small(points, sharp[:, [0, 1, 1]], longest) if len(sharp) else np.empty((0, 3, 3))
