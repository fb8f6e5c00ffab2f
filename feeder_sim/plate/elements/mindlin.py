"""Modes of a Mindlin plate by triangles of fourth degree, with layers, masses and supports.

Energies are those of feeder_sim.plate.modes, per element with the section of what lies there: the plate, and layers
bonded to it. Fourth degree in deflection and rotations alike does not lock (Mindlin plates of high order: Hughes, The
Finite Element Method, 1987, ch. 5). A support is a spring k against the deflection, spread over a place,

    2 U = k mean of w^2,

or holds the deflection (hinged) or all of the motion (clamped). With the loss factor eta of a spring, its share s_j of
the energy of mode j adds eta s_j / 2 to the damping ratio of the mode (Ungar and Kerwin, J. Acoust. Soc. Am. 34 (1962)
954).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from feeder_sim.plate.elements.mesh import triangulate
from feeder_sim.plate.elements.mesh_modes import MeshModes, quartic, shape_of
from feeder_sim.plate.mode_shapes import standing_wave
from feeder_sim.plate.outline import Outline
from feeder_sim.plate.rectangle import RectangularPlate
from feeder_sim.plate.ritz.attachments import Attachment, Layer, PointMass, added_section, bare_section
from feeder_sim.single_thread import solver_single_threaded

PER_WAVE = 0.33  # spacing of points over the shortest wavelength; frequencies are 0.1 % high there
LEAST_ELEMENTS = 12.0  # along the shorter side of the plate
SHIFT_HZ = 100.0  # below zero, about which modes are looked for: where a free plate has none
AT_REST_HZ = 0.1  # slower than that are motions of the plate as a whole, on nothing
ON_LINE = 2e-7  # [m]; where lines of the mesh cross, places are rounded
SAMPLES = 161  # per axis, among which the largest deflection is looked for
CLEAR_OF_NODE = 0.02  # of the antinode; a smaller deflection decides on no sign
Hold = Literal["spring", "hinged", "clamped"]


@dataclass(frozen=True)
class Support:
    """What carries the plate at a place.

    Attributes:
        hold: "spring", "hinged" or "clamped".
        points: (n, 2) [m], between which a spring is shared out, or on whose line or area the plate is held.
        weights: of the points, together 1, shape (n,).
        stiffness: of a spring [N/m], all of it.
        loss_factor: of a spring [1].
        place: what is held, as shapely has it.
    """

    hold: Hold
    points: NDArray[np.float64]
    weights: NDArray[np.float64]
    stiffness: float
    loss_factor: float
    place: Any


@solver_single_threaded
def element_modes(
    plate: RectangularPlate,
    outline: Outline,
    *,
    highest_frequency: float,
    attachments: Sequence[Attachment] = (),
    supports: Sequence[Support] = (),
    finer: float = 1.0,
) -> tuple[MeshModes, NDArray[np.float64]]:
    """Compute every mode up to a frequency, without motions of the plate as a whole that nothing holds.

    Args:
        plate: thickness, material, and the bounding box of its outline.
        outline: of the plate, centred.
        highest_frequency: [Hz], inclusive.
        attachments: what is fixed to the plate.
        supports: what carries it.
        finer: elements per length over the usual number.

    Returns:
        the modes; the damping ratio that supports give each of them, shape (n_modes,).

    Raises:
        ValueError: no mesh follows the outline and the layers, or there are no such waves in the plate.
    """
    import shapely

    layers = [attachment for attachment in attachments if isinstance(attachment, Layer)]
    wavelength = min(standing_wave(side, highest_frequency).wavelength for side in (plate, plate.turned))
    spacing = min(PER_WAVE * wavelength, min(outline.size) / LEAST_ELEMENTS) / finer
    lines = [shapely.LinearRing(layer.corners()) for layer in layers]
    holds = [support.place for support in supports if support.hold != "spring"]
    lines += [place.boundary if place.area else place for place in holds if place.geom_type != "Point"]
    corners = shapely.get_coordinates([place for place in holds if place.geom_type == "Point"])
    lines = [shapely.intersection(line, outline.polygon) for line in lines]
    points, triangles = triangulate(outline, lines, spacing, corners)
    basis = quartic(points, triangles)
    stiffness, mass = _matrices(basis, plate, layers, points[triangles].mean(axis=1))
    for each in attachments:
        if isinstance(each, PointMass):
            mass = mass + _point_mass(basis, each)
    springs = [_spring(basis, support) for support in supports if support.hold == "spring"]
    for spring in springs:
        stiffness = stiffness + spring
    free = np.setdiff1d(np.arange(3 * basis.N), _fixed_unknowns(basis, supports))
    expected = _expected(plate, outline, highest_frequency)
    squared, vectors = _solved(stiffness[free][:, free], mass[free][:, free], highest_frequency, expected)
    full_vectors = np.zeros((len(squared), 3 * basis.N))
    full_vectors[:, free] = vectors.T
    fields = full_vectors.reshape(len(squared), 3, basis.N)
    losses = [support.loss_factor for support in supports if support.hold == "spring"]
    shares = np.array([(full_vectors * (spring @ full_vectors.T).T).sum(axis=1) / squared for spring in springs])
    modes = MeshModes(
        plate=plate,
        natural_frequency=np.sqrt(squared) / (2.0 * math.pi),
        coefficients=np.zeros((len(squared), 3, 0, 0)),
        parity=np.full((len(squared), 2), -1),
        modal_mass=np.ones(len(squared)),
        outline=shape_of(outline),
        points=points,
        triangles=triangles,
        nodes=np.ascontiguousarray(basis.doflocs.T),
        fields=fields,
    )
    scale = _scale(modes, outline) if len(squared) else np.ones(0)
    loss = 0.5 * np.array(losses) @ shares if springs else np.zeros(len(squared))
    return replace(modes, modal_mass=scale**2, fields=fields * scale[:, None, None]), loss


def _scale(modes: MeshModes, outline: Outline) -> NDArray[np.float64]:
    """By which each mode has max |w| = 1 on the plate, and w > 0 next to the corner (+, +) at the edge."""
    x, y = (((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5) * side for side in outline.size)
    between = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    between = between[outline.holds(between)]
    everywhere = np.concatenate([modes.fields[:, 0], modes.evaluate_whole(between)[:, 0]], axis=1)
    largest = np.abs(everywhere).max(axis=1)
    along = np.flatnonzero(np.abs(outline.distance(modes.nodes)) < ON_LINE)
    along = along[np.argsort(-(modes.nodes[along] / np.array(outline.size)).sum(axis=1), kind="stable")]
    edge = modes.fields[:, 0, along]
    decides = (np.abs(edge) > CLEAR_OF_NODE * largest[:, None]).argmax(axis=1)
    sign = np.sign(edge[np.arange(len(edge)), decides])
    return np.asarray(np.where(sign == 0.0, 1.0, sign) / largest)


def _matrices(basis: Any, plate: RectangularPlate, layers: Sequence[Layer], middles: NDArray[np.float64]) -> Any:
    """Stiffness and mass (3 n, 3 n) of the plate with its layers; middles: of the elements (m, 2) [m]."""
    import scipy.sparse
    import shapely
    import skfem

    bare = bare_section(plate)
    names = ("d11", "d12", "d22", "d66", "s", "m", "j")

    def numbers(section: Any) -> NDArray[np.float64]:
        b = section.bending
        return np.array([b[0, 0], b[0, 1], b[1, 1], section.twisting, section.shear, section.mass, section.rotary])

    of_element = np.tile(numbers(bare)[:, None], (1, len(middles)))
    for layer in layers:
        under = shapely.intersects_xy(shapely.Polygon(layer.corners()), *middles.T)
        of_element[:, under] += numbers(added_section(plate, layer))[:, None]
    flat = basis.with_element(skfem.ElementTriP0())
    data = {name: flat.interpolate(row) for name, row in zip(names, of_element, strict=True)}

    def block(form: Any) -> Any:
        return skfem.BilinearForm(form).assemble(basis, **data)

    def moves(u: Any, v: Any, c: Any) -> Any:
        return c.s * (u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])

    def bends_x(u: Any, v: Any, c: Any) -> Any:
        return c.d11 * u.grad[0] * v.grad[0] + c.d66 * u.grad[1] * v.grad[1] + c.s * u * v

    def bends_y(u: Any, v: Any, c: Any) -> Any:
        return c.d22 * u.grad[1] * v.grad[1] + c.d66 * u.grad[0] * v.grad[0] + c.s * u * v

    def twists(u: Any, v: Any, c: Any) -> Any:  # rows of beta_x, columns of beta_y
        return c.d12 * u.grad[1] * v.grad[0] + c.d66 * u.grad[0] * v.grad[1]

    across, shears = block(twists), [block(lambda u, v, c, k=k: -c.s * u.grad[k] * v) for k in range(2)]
    weight, turn = block(lambda u, v, c: c.m * u * v), block(lambda u, v, c: c.j * u * v)
    rows = [
        [block(moves), shears[0].T, shears[1].T],
        [shears[0], block(bends_x), across],
        [shears[1], across.T, block(bends_y)],
    ]
    return scipy.sparse.bmat(rows).tocsc(), scipy.sparse.block_diag([weight, turn, turn]).tocsc()


def _point_mass(basis: Any, point: PointMass) -> Any:
    import scipy.sparse

    here = basis.probes(np.array(point.centre)[:, None])
    projection = here.T @ here
    turn = point.mass * point.offset**2 * projection
    return scipy.sparse.block_diag([point.mass * projection, turn, turn]).tocsc()


def _spring(basis: Any, support: Support) -> Any:
    import scipy.sparse

    here = basis.probes(support.points.T)
    stiffness = support.stiffness * (here.T @ scipy.sparse.diags(support.weights) @ here)
    return scipy.sparse.bmat([[stiffness, None], [None, scipy.sparse.csc_matrix((2 * basis.N, 2 * basis.N))]]).tocsc()


def _fixed_unknowns(basis: Any, supports: Sequence[Support]) -> NDArray[np.int64]:
    """Unknowns that supports hold."""
    import shapely

    nodes, fixed = shapely.points(basis.doflocs.T), [np.zeros(0, np.int64)]
    for support in supports:
        if support.hold != "spring":
            here = np.flatnonzero(shapely.distance(nodes, support.place) < ON_LINE)
            if not len(here):
                raise ValueError("a support that holds is where the mesh has no node")
            fixed += [here + k * basis.N for k in range(3 if support.hold == "clamped" else 1)]
    return np.unique(np.concatenate(fixed))


def _expected(plate: RectangularPlate, outline: Outline, highest: float) -> int:
    """A few more modes than there are up to a frequency [Hz], by Weyl's law with a term for free edges."""
    k = max(standing_wave(side, highest).wavenumber for side in (plate, plate.turned))
    polygon = outline.polygon
    return 3 + math.ceil(polygon.area * k**2 / (4.0 * math.pi) + polygon.length * k / (2.0 * math.pi))


def _solved(stiffness: Any, mass: Any, highest: float, expected: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Squared circular frequencies [1/s^2] and vectors, mass-normalised, of the modes up to a frequency [Hz]."""
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    n, shift = stiffness.shape[0], -((2.0 * math.pi * SHIFT_HZ) ** 2)
    # Shifted below all eigenvalues it is positive definite: ordered as symmetric, without pivots, it fills less.
    symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    factor = splu((stiffness - shift * mass).tocsc(), **symmetric)
    inverse = LinearOperator((n, n), factor.solve, dtype=float)
    start = np.random.default_rng(0).normal(size=n)  # the same bits every time
    while True:
        requested = min(expected, n - 2)
        squared, vectors = eigsh(stiffness, k=requested, M=mass, sigma=shift, OPinv=inverse, which="LM", v0=start)
        if squared.max() > (2.0 * math.pi * highest) ** 2 or requested == n - 2:
            break
        expected *= 2
    order = np.argsort(squared)
    squared, vectors = squared[order], vectors[:, order]
    selected = (squared > (2.0 * math.pi * AT_REST_HZ) ** 2) & (squared <= (2.0 * math.pi * highest) ** 2)
    return squared[selected], vectors[:, selected]
