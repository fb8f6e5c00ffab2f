"""Makes `modes.csv` and `modes.h5` here: `python models/plate_hole/finite_elements.py` (needs the extra `dev`).

Stands for a finite element program of a user: the modes of a thin free plate of 160 x 120 x 3 mm with a round hole, by
scikit-fem with Argyris elements, whose nodes hold the deflection and its slopes. The table is what such a program is
asked to export; it is brought in as a user would do it, by `feeder-sim modes import`.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh
from scipy.spatial import Delaunay
from skfem import Basis, BilinearForm, ElementTriArgyris, MeshTri
from skfem.helpers import dd, ddot, dot, grad, trace

from feeder_sim.plate.materials import MATERIALS

FOLDER = Path(__file__).parent
LENGTH, WIDTH, THICKNESS = 0.160, 0.120, 0.003  # [m]
HOLE, RADIUS = np.array([0.035, 0.0]), 0.012  # [m]; its centre, from that of the plate
SPACING = 0.005  # [m]; of the nodes
MODES = 8
ALUMINIUM = MATERIALS["aluminium"]


@BilinearForm
def stiffness(w: Any, v: Any, _: Any) -> Any:
    nu = ALUMINIUM.poisson_ratio
    d = ALUMINIUM.youngs_modulus * THICKNESS**3 / (12.0 * (1.0 - nu**2))
    return d * ((1.0 - nu) * ddot(dd(w), dd(v)) + nu * trace(dd(w)) * trace(dd(v)))


@BilinearForm
def mass(w: Any, v: Any, _: Any) -> Any:
    rho = ALUMINIUM.density
    return rho * THICKNESS * w * v + rho * THICKNESS**3 / 12.0 * dot(grad(w), grad(v))


def mesh() -> MeshTri:
    """Triangles of the plate without the hole, whose nodes lie on rings around it and on a grid farther off."""
    x = np.linspace(-0.5, 0.5, 1 + round(LENGTH / SPACING)) * LENGTH
    y = np.linspace(-0.5, 0.5, 1 + round(WIDTH / SPACING)) * WIDTH
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    nodes = []
    radius = RADIUS
    for ring in range(3):
        angle = 2.0 * math.pi * (np.arange(24) + 0.5 * ring) / 24
        nodes.append(HOLE + radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        radius *= 1.27
    nodes.append(grid[np.linalg.norm(grid - HOLE, axis=1) > radius - 0.3 * SPACING])
    points = np.concatenate(nodes)
    triangles = Delaunay(points).simplices
    middle = points[triangles].mean(axis=1)
    (ax, ay), (bx, by) = ((points[triangles[:, k]] - points[triangles[:, 0]]).T for k in (1, 2))
    kept = (np.linalg.norm(middle - HOLE, axis=1) > RADIUS * math.cos(math.pi / 24)) & (
        np.abs(ax * by - ay * bx) > 1e-9
    )
    return MeshTri(points.T, triangles[kept].T)


def modes(plate: MeshTri) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Natural frequencies [Hz] (modes,), and (w, dw/dx, dw/dy) at the nodes (modes, 3, nodes)."""
    basis = Basis(plate, ElementTriArgyris())
    k, m = stiffness.assemble(basis), mass.assemble(basis)
    start = np.random.default_rng(0).standard_normal(k.shape[0])
    squared, vectors = eigsh(k, k=3 + MODES, M=m, sigma=-1e5, v0=start)
    order = np.argsort(squared)[3:]  # without the motions as a whole
    return np.sqrt(squared[order]) / (2.0 * math.pi), np.moveaxis(vectors[basis.nodal_dofs[:3]][..., order], -1, 0)


def table(plate: MeshTri, frequency: NDArray[np.float64], shapes: NDArray[np.float64]) -> str:
    """The modes as a table that `feeder-sim modes import` reads, with its origin in a corner of the plate."""
    shapes = shapes / np.abs(shapes[:, 0]).max(axis=1)[:, None, None]
    names = ["x_mm", "y_mm"]
    columns = [1e3 * (plate.p[0] + 0.5 * LENGTH), 1e3 * (plate.p[1] + 0.5 * WIDTH)]
    for i, (w, along_x, along_y) in enumerate(shapes):
        names += [f"mode_{i + 1}", f"slope_x_{i + 1}_per_mm", f"slope_y_{i + 1}_per_mm"]
        columns += [w, 1e-3 * along_x, 1e-3 * along_y]
    lines = ["# free plate with a round hole, finite elements (models/plate_hole/finite_elements.py)"]
    lines += ["# frequency_hz, " + ", ".join(f"{f:.2f}" for f in frequency), ", ".join(names)]
    lines += [", ".join(f"{value:.6g}" for value in row) for row in np.column_stack(columns)]
    return "\n".join(lines) + "\n"


def main() -> None:
    from feeder_sim.cli.main import main as feeder_sim

    plate = mesh()
    (FOLDER / "modes.csv").write_text(table(plate, *modes(plate)), encoding="utf-8")
    options = ["--thickness", "3", "--outline", str(FOLDER / "outline.toml"), "--force"]
    sys.argv = ["feeder-sim", "modes", "import", str(FOLDER / "modes.csv"), "--out", str(FOLDER / "modes.h5"), *options]
    feeder_sim()


if __name__ == "__main__":
    main()
