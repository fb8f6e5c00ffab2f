"""Facets of the text formats OBJ and OFF, by the places of their corners alone.

trimesh splits the corners of an OBJ by what they have besides a place, counts its negative indices from the end of the
file, and reads no facet of an OFF with more than four corners beside one with fewer.

Sources: Wavefront's "Object Files (.obj)", appendix B1; geomview.org, "OFF files".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Facets = tuple[NDArray[np.float64], NDArray[np.int64]]


def obj_facets(text: str, most: int) -> Facets:
    """Places (n, 3) of corners, and their numbers in triangles (m, 3), of about `most` facets.

    Raises:
        ValueError: too many facets, a number that is none, or of no corner.
    """
    places: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            places.append([float(word) for word in words[1:4]])
        elif words[0] in ("f", "fo"):
            if len(triangles) > most or len(places) > 3 * most:
                raise ValueError(f"it has more than {most} facets")
            numbers = [int(word.partition("/")[0]) for word in words[1:]]
            if 0 in numbers:
                raise ValueError("a facet has a corner 0, corners are counted from 1")
            triangles += _fan([number - 1 if number > 0 else len(places) + number for number in numbers])
    return _checked(places, triangles)


def off_facets(text: str, most: int) -> Facets:
    """The same of an OFF, whose head may say that corners have normals, colours or more.

    Raises:
        ValueError: as above, or a head that is none.
    """
    lines = [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
    head = re.fullmatch(r"(?:ST)?C?N?OFF", lines[0][0].upper()) if lines else None
    if head is None:
        raise ValueError("its first line is not OFF")
    lines[0] = lines[0][1:]
    lines = lines[0 if lines[0] else 1 :]
    if not lines or len(lines[0]) < 2:
        raise ValueError("it does not say how many corners and facets it has")
    corners, facets = int(lines[0][0]), int(lines[0][1])
    if not (0 <= corners <= 3 * most and 0 <= facets <= most):
        raise ValueError(f"its head says {corners} corners and {facets} facets, must be {most} facets")
    if len(lines) < 1 + corners + facets:
        raise ValueError("it has fewer lines than its head says")
    places = [[float(word) for word in words[:3]] for words in lines[1 : 1 + corners]]
    triangles: list[tuple[int, int, int]] = []
    for words in lines[1 + corners : 1 + corners + facets]:
        numbers = [int(word) for word in words[1 : 1 + int(words[0])]]
        if len(numbers) != int(words[0]):
            raise ValueError("a facet has fewer corners than it says")
        triangles += _fan(numbers)
    return _checked(places, triangles)


def _fan(numbers: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """A facet of any number of corners as triangles."""
    return ((numbers[0], numbers[i], numbers[i + 1]) for i in range(1, len(numbers) - 1))


def _checked(places: Sequence[Sequence[float]], triangles: Sequence[tuple[int, int, int]]) -> Facets:
    if len({len(place) for place in places}) > 1:
        raise ValueError("some corners have fewer coordinates than others")
    numbers = np.array(triangles, np.int64).reshape(-1, 3)
    if len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(places):
        raise ValueError("a facet has a corner that the file lacks")
    if not places:
        raise ValueError("it has no corners")
    return np.array(places, float).reshape(len(places), -1), numbers
