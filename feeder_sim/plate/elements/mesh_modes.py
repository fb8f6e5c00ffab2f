"""Modes of a plate that are known on a mesh, with the face of `PlateModes`.

Beside the plate, where surfaces are tabulated a little way out, the deflection goes on along its slope at the edge.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.outline import Outline, rectangle_of

CACHED_GRIDS = 2  # grids of points whose place in the mesh is remembered


@dataclass(frozen=True, eq=False, kw_only=True)
class MeshModes(PlateModes):
    """Modes on triangles of fourth degree; `coefficients` and `local` are empty.

    Attributes:
        points: corners of the triangles [m], shape (k, 2); triangles: (m, 3), counter-clockwise.
        nodes: where shapes are known [m], shape (n, 2).
        fields: w [1], beta_x, beta_y [1/m] there, shape (n_modes, 3, n).
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    nodes: NDArray[np.float64]
    fields: NDArray[np.float64]
    _places: dict[bytes, Any] = field(default_factory=dict, repr=False)

    def evaluate(self, index: int, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        return self._at(np.column_stack([x.ravel(), y.ravel()]), slice(index, index + 1))[0].reshape(3, *x.shape)

    def evaluate_grid(self, index: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.evaluate(index, *np.meshgrid(x, y, indexing="ij"))

    def evaluate_whole(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._at(points, slice(None))

    def _at(self, points: NDArray[np.float64], modes: slice) -> NDArray[np.float64]:
        """(w, beta_x, beta_y) of some modes at points (n, 2) [m], shape (modes, 3, n)."""
        key = points.tobytes()
        if key not in self._places:
            if len(self._places) >= CACHED_GRIDS:
                self._places.pop(next(iter(self._places)))
            self._places[key] = self._place(points)
        interpolation, beside = self._places[key]
        values = np.stack([(interpolation @ fields.T).T for fields in self.fields[modes]])
        values[:, 0] += values[:, 1] * beside[:, 0] + values[:, 2] * beside[:, 1]
        return np.asarray(values)

    def _place(self, points: NDArray[np.float64]) -> tuple[Any, NDArray[np.float64]]:
        """From the nodes to points (n, 2) [m], a sparse matrix; by how much each lies beside the plate (n, 2) [m]."""
        import scipy.sparse
        import shapely

        outline = self.outline or rectangle_of(self.plate.length, self.plate.width)
        here, outside = points.copy(), ~outline.holds(points)
        if outside.any():
            edge = shapely.multilinestrings([shapely.linearrings(ring) for ring in outline.rings])
            lines = shapely.shortest_line(shapely.points(points[outside]), edge)
            here[outside] = shapely.get_coordinates(lines).reshape(-1, 2, 2)[:, 1]
        places = shapely.points(here)
        cells = np.full(len(points), -1)
        hits, of_tree = self._tree.query(places, predicate="intersects")
        cells[hits] = of_tree
        cells[cells < 0] = self._tree.nearest(places[cells < 0])  # round-off at the edge
        basis = self._basis
        local = basis.mapping.invF(here.T[:, :, None], tind=cells)
        shapes = np.stack([basis.elem.gbasis(basis.mapping, local, k, tind=cells)[0] for k in range(basis.Nbfun)])
        rows = np.tile(np.arange(len(points)), basis.Nbfun)
        columns = self._order[basis.element_dofs[:, cells]].ravel()
        matrix = scipy.sparse.coo_matrix((shapes.ravel(), (rows, columns)), shape=(len(points), len(self.nodes)))
        return matrix.tocsr(), points - here

    @cached_property
    def _basis(self) -> Any:
        return quartic(self.points, self.triangles)

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        """Which node each unknown of the basis is: another version of its library may number them in another way."""
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(self.nodes).query(self._basis.doflocs.T)[1])

    @cached_property
    def _tree(self) -> Any:
        import shapely

        return shapely.STRtree(shapely.polygons(self.points[self.triangles]))


def quartic(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> Any:
    """Scikit-fem's basis of fourth degree on triangles (m, 3) of points (k, 2) [m]."""
    import skfem

    mesh = skfem.MeshTri(np.ascontiguousarray(points.T), np.ascontiguousarray(triangles.T))
    return skfem.Basis(mesh, skfem.ElementTriP4())


def shape_of(outline: Outline) -> Outline | None:
    """The outline of a plate as `PlateModes` has it: None of a whole rectangle."""
    full = outline.polygon.area > (1.0 - 1e-9) * float(np.prod(outline.size))
    return None if full and len(outline.exterior) == 4 and not outline.holes else outline
