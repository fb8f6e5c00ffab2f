"""Smooth fields through scattered points: least squares in the package's own basis, with a bending energy.

A field f = sum of c_ij P_i(x) P_j(y), orthonormal Legendre polynomials over the bounding box, minimises

    1/N sum of (f(x_k, y_k) - f_k)^2  +  weight * l^2 int f,xx^2 + 2 f,xy^2 + f,yy^2 dA,    l^2 = area of the box

The bending energy, over the whole box, keeps the field smooth where there are no points: over holes, beside the plate,
between the outermost points and the edge. Its weight is the one with the least generalised cross-validation score

    V = N |f - f_k|^2 / (N - 1.4 tr H)^2,    H: from the f_k to the f(x_k, y_k)

(Craven and Wahba, Numer. Math. 31 (1979) 377; the factor 1.4 against fits that follow the noise: Kim and Gu, J. R.
Stat. Soc. B 66 (2004) 337.) Exact data get a weight so small that it does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from feeder_sim.single_thread import solver_single_threaded

WEIGHTS = np.logspace(-16.0, -2.0, 85)
CAUTION = 1.4  # of the score
ROUND_OFF = 1e-19  # of the sum of squares of the data; smaller squared residuals are not told apart
AT_ONCE = 20_000  # points whose polynomials are held at a time


@dataclass(frozen=True)
class Fit:
    """Fields through points.

    Attributes:
        coefficients: of orthonormal Legendre products, shape (fields, terms, terms): order in x, order in y.
        residual: root mean square of what the field misses the points by, in the unit of the data, shape (fields,).
        condition: condition number of the least squares with the weight that was chosen, shape (fields,).
    """

    coefficients: NDArray[np.float64]
    residual: NDArray[np.float64]
    condition: NDArray[np.float64]


@solver_single_threaded
def fit_scattered(
    points: NDArray[np.float64], values: NDArray[np.float64], size: tuple[float, float], terms: int
) -> Fit:
    """Fit smooth fields to values at points.

    Args:
        points: (n, 2) [m] in a box centred on the origin; at least three that are not on a line.
        values: (fields, n).
        size: length and width of the box [m].
        terms: Legendre polynomials per axis.
    """
    from scipy.linalg import eigh, eigvalsh

    n, fields = len(points), len(values)
    gram, moments = np.zeros((terms**2, terms**2)), np.zeros((terms**2, fields))
    pieces = np.array_split(np.arange(n), 1 + n // AT_ONCE)
    for rows in pieces:
        basis = _products(points[rows], size, terms)
        gram += basis.T @ basis / n
        moments += basis.T @ values[:, rows].T / n
    energy = bending_energy(size, terms)
    least = WEIGHTS[0]
    stiffness, vectors = eigh(energy, gram + least * energy)  # vectors.T (gram + least energy) vectors = 1
    stiffness = np.maximum(stiffness, 0.0)
    projected = vectors.T @ moments
    squares = (values**2).mean(axis=1)
    best, score = np.full(fields, WEIGHTS[-1]), np.full(fields, np.inf)
    for weight in WEIGHTS:
        shrunk = 1.0 / (1.0 + (weight - least) * stiffness)
        follows = float(((1.0 - least * stiffness) * shrunk).sum())
        if CAUTION * follows >= n:
            continue
        estimates = shrunk[:, None] * projected
        missed = squares - 2.0 * (estimates * projected).sum(axis=0) + ((1.0 - least * stiffness) @ estimates**2)
        scores = np.maximum(missed, ROUND_OFF * squares) / (1.0 - CAUTION * follows / n) ** 2
        better = scores < score
        best[better], score[better] = weight, scores[better]
    coefficients = vectors @ (projected / (1.0 + (best - least)[None, :] * stiffness[:, None]))
    missed = np.zeros(fields)
    for rows in pieces:
        missed += ((_products(points[rows], size, terms) @ coefficients - values[:, rows].T) ** 2).sum(axis=0)
    conditions = {}
    for weight in np.unique(best):
        spread = eigvalsh(gram + weight * energy)
        conditions[weight] = float(np.sqrt(spread[-1] / max(spread[0], 1e-300)))
    return Fit(
        np.ascontiguousarray(coefficients.T.reshape(fields, terms, terms)),
        np.sqrt(missed / n),
        np.array([conditions[weight] for weight in best]),
    )


def bending_energy(size: tuple[float, float], terms: int) -> NDArray[np.float64]:
    """Matrix (terms^2, terms^2) of l^2 int f,xx^2 + 2 f,xy^2 + f,yy^2 dA over the box, for f in Legendre products."""
    length, width = size
    slope, curvature = _derivative_integrals(terms)
    lx, ly, identity = 2.0 / length, 2.0 / width, np.eye(terms)
    energy = lx**4 * np.kron(curvature, identity) + ly**4 * np.kron(identity, curvature)
    energy += 2.0 * (lx * ly) ** 2 * np.kron(slope, slope)
    return np.asarray(0.25 * (length * width) ** 2 * energy)


def slopes(coefficients: NDArray[np.float64], size: tuple[float, float]) -> NDArray[np.float64]:
    """Coefficients of df/dx and df/dy [1/m] of fields (fields, terms, terms), shape (fields, 2, terms, terms)."""
    terms = coefficients.shape[-1]
    scale = np.sqrt(np.arange(terms) + 0.5)
    derivative = np.zeros((terms, terms))  # P_j' = sum over i of derivative[i, j] P_i
    for j in range(1, terms):
        inner = legendre.legder(np.eye(terms)[j] * scale[j])
        derivative[: len(inner), j] = inner / scale[: len(inner)]
    along_x = 2.0 / size[0] * np.einsum("ij,fjk->fik", derivative, coefficients)
    along_y = 2.0 / size[1] * np.einsum("kj,fij->fik", derivative, coefficients)
    return np.stack([along_x, along_y], axis=1)


def _products(points: NDArray[np.float64], size: tuple[float, float], terms: int) -> NDArray[np.float64]:
    """Products of polynomials at points (n, 2) [m], shape (n, terms^2)."""
    scale = np.sqrt(np.arange(terms) + 0.5)
    px = legendre.legvander(2.0 * points[:, 0] / size[0], terms - 1) * scale
    py = legendre.legvander(2.0 * points[:, 1] / size[1], terms - 1) * scale
    return np.asarray((px[:, :, None] * py[:, None, :]).reshape(len(points), terms**2))


def _derivative_integrals(terms: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Int P_i' P_j' and int P_i'' P_j'' over [-1, 1] of the orthonormal Legendre polynomials."""
    nodes, weights = legendre.leggauss(terms + 1)
    scale = np.sqrt(np.arange(terms) + 0.5)
    first = np.stack([legendre.legval(nodes, legendre.legder(row)) for row in np.diag(scale)], axis=1)
    second = np.stack([legendre.legval(nodes, legendre.legder(row, 2)) for row in np.diag(scale)], axis=1)
    weighted = weights[:, None]
    return first.T @ (weighted * first), second.T @ (weighted * second)
