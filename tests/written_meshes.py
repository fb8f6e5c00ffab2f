"""A body as STL, OBJ, PLY or OFF, in one of the many forms that programs give it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from random import Random

import numpy as np
from drawn_meshes import Body, Face, Floats


def numbers(rng: Random) -> Callable[[float], str]:
    """How a file writes all its numbers: the same corner is the same everywhere."""
    style = rng.choice(["{!r}", "{:.9g}", "{:.9e}", "{:+.9E}"])
    return lambda value: style.format(float(value))


def normal(body: Body, face: Face) -> Floats:
    a, b, c = body.corners[list(face[:3])]
    turned = np.cross(b - a, c - a)
    return turned / (np.linalg.norm(turned) or 1.0)


def without_area(body: Body, rng: Random) -> Body:
    """With facets of no area, two of whose corners are the same; in triangles."""
    faces = list(body.triangles())
    for _ in range(rng.randint(1, 4)):
        a, b, _c = rng.choice(faces)
        faces.insert(rng.randrange(len(faces) + 1), rng.choice([(a, b, b), (a, a, b), (b, a, b), (a, a, a)]))
    return Body(body.name, body.corners, tuple(faces), body.volume)


def with_sliver(body: Body, rng: Random) -> Body:
    """An edge gets a corner within it on one side only; a facet of no area stands between; in triangles."""
    faces = list(body.triangles())
    i = rng.randrange(len(faces))
    a, b, c = faces.pop(i)
    corners = np.vstack([body.corners, 0.5 * (body.corners[a] + body.corners[b])])
    m = len(corners) - 1
    return Body(body.name, corners, (*faces, (a, m, c), (m, b, c), (a, b, m)), body.volume)


def ascii_stl(body: Body, rng: Random) -> bytes:
    number = numbers(rng)
    upper, zero = rng.random() < 0.3, rng.random() < 0.4
    name = rng.choice(["part", "", "Exported from CAD 1.2 (mm)", "a facet of solid b"])
    lines = [f"solid {name}"]
    for face in body.triangles():
        up = [0.0, 0.0, 0.0] if zero else normal(body, face)
        lines += [f" facet normal {' '.join(number(x) for x in up)}", "  outer loop"]
        lines += [f"   vertex {' '.join(number(x) for x in body.corners[i])}" for i in face]
        lines += ["  endloop", " endfacet"]
    lines.append(f"endsolid {name}")
    text = rng.choice(["\n", "\n", "\r\n"]).join([*lines, ""])
    return (text.upper() if upper else text).encode()


def binary_stl(body: Body, rng: Random) -> bytes:
    facets, zero = body.triangles(), rng.random() < 0.4
    head = rng.choice([b"", b"solid part", b"solid \xff\xfe\x00facet normal", bytes(range(80, 160)), b"COLOR=\x01\x02"])
    data = head.ljust(80, rng.choice([b"\0", b" "]))[:80] + struct.pack("<I", len(facets))
    for face in facets:
        up = [0.0, 0.0, 0.0] if zero else normal(body, face)
        data += struct.pack("<12f", *up, *body.corners[list(face)].ravel())
        data += struct.pack("<H", rng.choice([0, 0, 0x8123]))
    return data


def obj(body: Body, rng: Random) -> bytes:
    """With texture coordinates and normals of facets, groups, objects, materials, negative indices, own corners."""
    number = numbers(rng)
    textured, normals, soup, negative = (rng.random() < p for p in (0.5, 0.5, 0.3, 0.3))
    colours = rng.random() < 0.15
    lines = ["# made by a modeller", "mtllib part.mtl", "o part"]
    vertices: list[int] = []
    textures = ups = 0

    def vertex(i: int) -> str:
        more = " 0.5 0.25 1.0" if colours else ""
        return f"v {' '.join(number(x) for x in body.corners[i])}{more}"

    if not soup:
        lines += [vertex(i) for i in range(len(body.corners))]
        vertices = list(range(len(body.corners)))
    for k, face in enumerate(body.faces):
        if rng.random() < 0.2:
            lines.append(rng.choice([f"usemtl m{k}", f"g group{k}", "s off", "s 1",
                                     f"o object{k}", "", "# next"]))  # fmt: skip
        words = []
        if normals:
            lines.append(f"vn {' '.join(number(x) for x in normal(body, face))}")
            ups += 1
        for i in face:
            if soup:
                lines.append(vertex(i))
                vertices.append(i)
            at = len(vertices) - 1 if soup else i
            corner = str(at - len(vertices) if negative else at + 1)
            if textured:
                lines.append(f"vt {number(rng.random())} {number(rng.random())}")
                textures += 1
            texture = ("-1" if negative else str(textures)) if textured else ""
            up = ("-1" if negative else str(ups)) if normals else ""
            words.append("/".join([corner, texture, up]).rstrip("/"))
        if soup and negative:  # what counts from the end counts from the line of the face
            words = [_moved(word, i - len(face) + 1) for i, word in enumerate(words)]
        if textured and negative:
            words = [_texture_moved(word, i - len(face) + 1) for i, word in enumerate(words)]
        lines.append("f " + rng.choice([" ", " ", "  "]).join(words))
    return rng.choice(["\n", "\r\n"]).join([*lines, ""]).encode()


def _moved(word: str, by: int) -> str:
    corner, *rest = word.split("/")
    return "/".join([str(int(corner) + by), *rest])


def _texture_moved(word: str, by: int) -> str:
    corner, texture, *rest = word.split("/")
    return "/".join([corner, str(int(texture) + by), *rest])


def ply(body: Body, rng: Random) -> bytes:
    """In text or binary of either order, with normals, texture coordinates, colours; faces of any number of corners."""
    number = numbers(rng)
    form = rng.choice(["ascii", "binary_little_endian", "binary_big_endian"])
    real, sized = rng.choice([("float", "f"), ("double", "d"), ("float32", "f")]), rng.choice(["float", "float32"])
    extra = rng.choice([(), ("nx", "ny", "nz"), ("s", "t"), ("u", "v"), ("nx", "ny", "nz", "s", "t"),
                        ("red", "green", "blue"), ("nx", "ny", "nz", "red", "green", "blue", "alpha")])  # fmt: skip
    soup, flags = rng.random() < 0.4, rng.random() < 0.2
    index = rng.choice([("int", "i"), ("uint", "I"), ("int32", "i"), ("ushort", "H")])
    colour = ("red", "green", "blue", "alpha")
    head = ["ply", f"format {form} 1.0", "comment made by a scanner"]
    order = [(i, face) for face in body.faces for i in face] if soup else [
        (i, next(f for f in body.faces if i in f)) for i in range(len(body.corners)) if any(i in f for f in body.faces)
    ]  # fmt: skip
    place = {i: k for k, (i, _) in enumerate(order)}
    faces = body.faces if not soup else ()
    start = 0
    written: list[Face] = [tuple(place[i] for i in face) for face in faces]
    for face in body.faces if soup else ():
        written.append(tuple(range(start, start + len(face))))
        start += len(face)
    head += [f"element vertex {len(order)}", *(f"property {real[0]} {x}" for x in "xyz")]
    head += [f"property {'uchar' if name in colour else sized} {name}" for name in extra]
    head += [f"element face {len(written)}"]
    head += ["property uchar flags"] if flags else []
    head += [f"property list uchar {index[0]} {rng.choice(['vertex_indices', 'vertex_index'])}", "end_header", ""]
    sign = ">" if form == "binary_big_endian" else "<"
    kinds = [real[1]] * 3 + ["B" if name in colour else "f" for name in extra]
    rows: list[tuple[list[str], list[float | int]]] = []
    for i, face in order:
        up = dict(zip(("nx", "ny", "nz"), normal(body, face), strict=True))
        more = [rng.randrange(256) if n in colour else float(up.get(n, rng.random())) for n in extra]
        rows.append((kinds, [*map(float, body.corners[i]), *more]))
    for corners in written:
        values: list[float | int] = [*([1] if flags else []), len(corners), *corners]
        rows.append((["B"] * (2 if flags else 1) + [index[1]] * len(corners), values))
    if form == "ascii":
        text = [" ".join(str(x) if isinstance(x, int) else number(x) for x in values) for _, values in rows]
        return "\n".join([*head[:-1], *text, ""]).encode()
    data = b"".join(struct.pack(sign + "".join(formats), *values) for formats, values in rows)
    return "\n".join(head).encode() + data


def off(body: Body, rng: Random) -> bytes:
    number = numbers(rng)
    lines = ["OFF", *(["# a comment"] if rng.random() < 0.3 else []), f"{len(body.corners)} {len(body.faces)} 0"]
    lines += [" ".join(number(x) for x in corner) for corner in body.corners]
    colour = rng.choice(["", "", " 255 0 0"])
    lines += [f"{len(face)} {' '.join(map(str, face))}{colour}" for face in body.faces]
    return rng.choice(["\n", "\r\n"]).join([*lines, ""]).encode()


WRITERS = {"ascii STL": (ascii_stl, ".stl"), "binary STL": (binary_stl, ".stl"), "OBJ": (obj, ".obj"),
           "PLY": (ply, ".ply"), "OFF": (off, ".off")}  # fmt: skip
