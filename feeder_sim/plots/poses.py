"""Picture of the stable poses of a part: each on a plate, seen obliquely, all to the same scale.

A small renderer of its own: faces, edges and shadow are sampled more densely than the pixels, and every pixel shows the
sample that is nearest to the eye. So what hides what is right for any mesh, which sorting of whole faces cannot give.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
PIXELS, FINER = 320, 2  # of a picture's side; samples per pixel and direction
DENSITY = 1.5  # samples per step of the fine grid
AZIMUTH_DEG, ELEVATION_DEG = -60.0, 28.0  # of the eye
ACROSS_DEG = (28.0, 15.0, 42.0, 0.0, 57.0)  # between what is long and the width of the picture, best first
LIGHT = np.array([-0.35, -0.55, 1.0]) / np.linalg.norm([-0.35, -0.55, 1.0])
STEEL, INK, PLATE, SHADOW = (0.47, 0.58, 0.72), (0.10, 0.13, 0.18), (0.93, 0.92, 0.89), (0.76, 0.75, 0.73)
SHARP_DEG = 25.0  # edges between faces that meet at a larger angle are drawn
SAMPLES = 2_000_000  # at once
MARGIN = 1.12  # of the plate shown, over the reach of the part


def draw_poses(part: RigidPart, poses: Sequence[StablePose], path: Path, study: DropStudy | None = None) -> None:
    """Draw the stable poses of a part, with the shares of a drop study if there is one; the suffix is the file type."""
    selected = sorted(range(len(poses)), key=lambda i: -poses[i].chance)[:MOST]
    selected.sort()
    rows = math.ceil(len(selected) / PER_ROW)
    columns = math.ceil(len(selected) / rows)
    figure = empty_figure(2.6 * columns, 2.4 * rows + 0.4)
    figure.suptitle(_heading(part, len(poses), len(selected), study), fontsize=10)
    for axes in figure.subplots(rows, columns, squeeze=False).ravel():
        axes.set_axis_off()
    reach = MARGIN * max(_reach(part), 1e-9)
    pictures = np.stack([render(part, poses[i].attitude[0], poses[i].height, reach) for i in selected])
    used = np.flatnonzero((pictures < 1.0).any(axis=(0, 2, 3)))
    pictures = pictures[:, used[0] : used[-1] + 1]  # the same rows of all, which keeps them to one scale
    for axes, i, picture in zip(figure.axes, selected, pictures, strict=False):
        axes.imshow(picture, interpolation="antialiased")
        axes.set_title(_title(poses[i], i, study), fontsize=9)
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


def render(part: RigidPart, attitude: Floats, height: float, reach: float) -> Floats:
    """Picture (PIXELS, PIXELS, 3) of a part on a plate, for an attitude (4,) and a height of its centre [m].

    `reach` is what the picture shows around the centre [m].
    """
    from scipy.spatial.transform import Rotation

    at = Rotation.from_quat(attitude, scalar_first=True).apply(part.vertices)
    at = _turned_to_view(at + np.array([0.0, 0.0, height]), part.faces)
    triangles = at[part.faces]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normal, axis=1)
    triangles, normal = triangles[area > 0.0], normal[area > 0.0] / area[area > 0.0, None]
    canvas = _Canvas(reach)
    corner = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    canvas.faces(corner[[[0, 1, 2], [0, 2, 3]]], np.tile(PLATE, (2, 1)))
    thrown = triangles - (triangles[:, :, 2] / LIGHT[2])[:, :, None] * LIGHT  # to the plate, along the light
    canvas.faces(thrown, np.tile(SHADOW, (len(thrown), 1)), lift=0.012 * reach)
    shade = 0.45 + 0.55 * np.clip(normal @ LIGHT, 0.0, 1.0) + 0.12 * np.clip(normal @ canvas.eye, 0.0, 1.0)
    canvas.faces(triangles, np.clip(shade[:, None] * STEEL * 1.25, 0.0, 1.0), lift=0.013 * reach)
    canvas.lines(at[_sharp_edges(part)], INK, lift=0.021 * reach)
    return canvas.picture()


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


def _sharp_edges(part: RigidPart) -> NDArray[np.int64]:
    """Edges (n, 2) of the drawn mesh at which faces meet at an angle."""
    import trimesh

    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    sharp = mesh.face_adjacency_angles > math.radians(SHARP_DEG)
    return np.asarray(mesh.face_adjacency_edges[sharp], np.int64)


class _Canvas:
    """Samples seen by an eye far away; the nearest of each pixel is kept."""

    def __init__(self, reach: float) -> None:
        azimuth, elevation = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
        self.eye = np.array(
            [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
        )
        right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        self._axes = np.stack([right, np.cross(self.eye, right), self.eye])
        self._side = PIXELS * FINER
        self._scale = 0.5 * self._side / (math.sqrt(2.0) * reach)
        self._up = 0.5 * reach * math.cos(elevation)  # what is seen lies above the plate's middle
        self._depth = np.full(self._side**2, -np.inf)
        self._colour = np.ones((self._side**2, 3))

    def faces(self, triangles: Floats, colours: Floats, lift: float = 0.0) -> None:
        """Triangles (n, 3, 3) [m] in colours (n, 3), nearer to the eye by `lift` [m]."""
        projected = triangles @ self._axes.T
        longest = np.linalg.norm(projected[:, :, :2] - np.roll(projected[:, :, :2], 1, axis=1), axis=2).max(axis=1)
        steps = np.maximum(1, np.ceil(DENSITY * self._scale * longest)).astype(int)
        for chunk, n in _by_steps(steps):
            i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
            u, v = i[i + j <= n] / n, j[i + j <= n] / n
            weights = np.stack([1.0 - u - v, u, v], axis=1)
            points = np.einsum("sk,nkd->nsd", weights, projected[chunk])
            self._add_samples(points.reshape(-1, 3), np.repeat(colours[chunk], len(weights), axis=0), lift)

    def lines(self, ends: Floats, colour: Sequence[float], lift: float) -> None:
        """Lines (n, 2, 3) [m] of one colour."""
        if not len(ends):
            return
        projected = ends @ self._axes.T
        longest = float(np.linalg.norm(projected[:, 1, :2] - projected[:, 0, :2], axis=1).max())
        share = np.linspace(0.0, 1.0, 2 + math.ceil(DENSITY * self._scale * longest))
        for chunk in np.array_split(np.arange(len(projected)), 1 + len(projected) * len(share) // SAMPLES):
            points = projected[chunk, :1] + share[:, None] * (projected[chunk, 1:] - projected[chunk, :1])
            flat = points.reshape(-1, 3)
            self._add_samples(flat, np.tile(colour, (len(flat), 1)), lift)

    def _add_samples(self, points: Floats, colours: Floats, lift: float) -> None:
        column = np.floor(0.5 * self._side + self._scale * points[:, 0]).astype(int)
        row = np.floor(0.5 * self._side - self._scale * (points[:, 1] - self._up)).astype(int)
        inside = (column >= 0) & (column < self._side) & (row >= 0) & (row < self._side)
        pixel, depth = (row * self._side + column)[inside], points[inside, 2] + lift
        order = np.argsort(depth, kind="stable")  # of several in one pixel the nearest is written last
        nearer = order[depth[order] > self._depth[pixel[order]]]
        self._depth[pixel[nearer]], self._colour[pixel[nearer]] = depth[nearer], colours[inside][nearer]

    def picture(self) -> Floats:
        grid = self._colour.reshape(PIXELS, FINER, PIXELS, FINER, 3)
        return np.asarray(grid.mean(axis=(1, 3)))


def _by_steps(steps: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], int]]:
    """Numbers of triangles of about the same size, and the steps that their sides are sampled in."""
    order = np.argsort(steps, kind="stable")
    while len(order):
        n = max(int(steps[order[0]] * 1.25), int(steps[order[0]]))
        together = int(np.searchsorted(steps[order], n, side="right"))
        together = max(1, min(together, 2 * SAMPLES // ((n + 1) * (n + 2))))
        yield order[:together], n
        order = order[together:]
