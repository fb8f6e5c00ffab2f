"""Vectors and symmetric matrices as tuples, for compiled code: they stay in registers, where arrays would be allocated.

A vector is (x, y, z); a symmetric matrix is its upper triangle (xx, xy, xz, yy, yz, zz).
"""

from __future__ import annotations

from feeder_sim.machine_code import inlined


@inlined
def vector(a):
    """The vector in an array (3,)."""
    return a[0], a[1], a[2]


@inlined
def dot(a, b):
    """Scalar product of two vectors, tuples or arrays (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def difference(a, b):
    """The difference a - b, of tuples or arrays (3,)."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def times(m, a):
    """Product of a symmetric matrix and a vector."""
    return (
        m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
        m[1] * a[0] + m[3] * a[1] + m[4] * a[2],
        m[2] * a[0] + m[4] * a[1] + m[5] * a[2],
    )


@inlined
def combine(x, a, y, b, z, c):
    """The sum x a + y b + z c."""
    return x * a[0] + y * b[0] + z * c[0], x * a[1] + y * b[1] + z * c[1], x * a[2] + y * b[2] + z * c[2]


@inlined
def plus(a, share, b):
    """The sum a + share b."""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


@inlined
def write_to(array, a):
    """Write a vector into an array (3,)."""
    array[0], array[1], array[2] = a


@inlined
def add_to(array, share, a):
    """Add a multiple of a vector to an array (3,)."""
    array[0] += share * a[0]
    array[1] += share * a[1]
    array[2] += share * a[2]
