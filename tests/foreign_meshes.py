"""Meshes that others could have written: ordinary ones, odd ones and hostile ones."""

from __future__ import annotations

import struct
from pathlib import Path
from random import Random

import numpy as np
from drawn_meshes import Body, box, random_body, summed_volume
from foreign_files import ForeignFile, damaged
from written_meshes import WRITERS, obj, off, ply, with_sliver, without_area

# What is odd in a mesh: it is refused, or has the volume of the body.
ODD = (
    "sliver", "hole", "turned facet", "inside out", "two bodies", "facet twice", "OFF in one line", "COFF",
    "lines and points", "cut line", "edges in PLY", "two solids", "concave face", "unused corners", "no normal",
)  # fmt: skip
SAME = 1e-4  # share of the volume


def taken_volume(path: Path) -> float:
    """What the package takes for the volume of a mesh file in millimetres [mm3]."""
    from feeder_sim.part.mesh_file import closed_mesh

    return float(closed_mesh(path, 1.0).volume)


def volume_difference(volume: float, file: ForeignFile) -> str:
    """How the volume differs from that of the body; "" if it does not."""
    assert file.truths is not None
    if any(abs(volume - truth) <= SAME * truth for truth in file.truths):
        return ""
    return f"has {volume:.6g} mm3, drawn are {file.truths}"


def ordinary_mesh(rng: Random) -> ForeignFile:
    """A mesh without fault, though in STL and OBJ with facets of no area now and then."""
    body = random_body(rng)
    assert abs(summed_volume(body) - body.volume) < 1e-9 * body.volume
    name = rng.choice(sorted(WRITERS))
    write, suffix = WRITERS[name]
    said = f"{body.name} as {name}"
    if name != "OFF" and rng.random() < 0.25:
        body, said = without_area(body, rng), f"{said} with facets of no area"
    return ForeignFile(write(body, rng), suffix, said, (body.volume,), ordinary=True)


def odd_mesh(rng: Random, odd: str) -> ForeignFile:
    """A mesh with one thing in it that is not as it should be, or not in every program."""
    body = random_body(rng).in_triangles()
    name = rng.choice(sorted(WRITERS))
    write, suffix = WRITERS[name]
    faces = list(body.faces)
    truths: tuple[float, ...] = (body.volume,)
    if odd == "sliver":
        body = with_sliver(body, rng)
    elif odd == "hole":
        body, truths = Body(body.name, body.corners, tuple(faces[1:]), body.volume), ()
    elif odd == "turned facet":
        body = Body(body.name, body.corners, (faces[0][::-1], *faces[1:]), body.volume)
    elif odd == "inside out":
        body = Body(body.name, body.corners, tuple(f[::-1] for f in faces), body.volume)
    elif odd == "two bodies":
        n = len(body.corners)
        far = tuple(tuple(n + i for i in f) for f in faces)
        corners = np.vstack([body.corners, body.corners + np.array([100.0, 0.0, 0.0])])
        body, truths = Body(body.name, corners, (*faces, *far), 2 * body.volume), (2 * body.volume,)
    elif odd == "facet twice":
        body = Body(body.name, body.corners, (*faces, faces[0]), body.volume)
    elif odd == "unused corners":
        body = Body(body.name, np.vstack([body.corners, [[500.0, 0.0, 0.0]]]), body.faces, body.volume)
    elif odd == "concave face":
        return _concave(rng)
    else:
        name, suffix, content = _odd_text(odd, body, rng)
        return ForeignFile(content, suffix, f"{body.name} as {name} with {odd}", truths)
    return ForeignFile(write(body, rng), suffix, f"{body.name} as {name} with {odd}", truths)


def _concave(rng: Random) -> ForeignFile:
    """An L whose caps are one polygon each, that no fan from its first corner fills."""
    outline = np.array([[0, 0], [9, 0], [9, 3], [3, 3], [3, 9], [0, 9]], float)
    start = rng.randrange(6)
    outline = np.roll(outline, start, axis=0)
    corners = np.array([[*p, z] for z in (0.0, 4.0) for p in outline])
    sides = tuple((i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i) for i in range(6))
    body = Body("L", corners, (*sides, tuple(range(6, 12)), tuple(range(5, -1, -1))), 180.0)
    name = rng.choice(["OBJ", "PLY", "OFF"])
    write, suffix = WRITERS[name]
    return ForeignFile(write(body, rng), suffix, f"L as {name} with concave faces", (body.volume,))


def _odd_text(odd: str, body: Body, rng: Random) -> tuple[str, str, bytes]:
    """The same body in a form that few programs write."""
    if odd in ("OFF in one line", "COFF"):
        text = off(Body(body.name, body.corners, body.faces, body.volume), Random(1)).decode()
        if odd == "COFF":
            lines = text.replace("\r", "").replace("# a comment\n", "").splitlines()
            n = len(body.corners)
            lines = ["COFF", lines[1], *(f"{line} 255 0 0 255" for line in lines[2 : 2 + n]), *lines[2 + n :]]
            return "OFF", ".off", "\n".join([*lines, ""]).encode()
        return "OFF", ".off", text.replace("\r", "").replace("# a comment\n", "").replace("OFF\n", "OFF ", 1).encode()
    if odd == "edges in PLY":
        rows = [" ".join(repr(float(x)) for x in corner) for corner in body.corners]
        rows += [f"3 {a} {b} {c}" for a, b, c in body.faces] + ["0 1", "1 2"]
        head = ["ply", "format ascii 1.0", f"element vertex {len(body.corners)}",
                *(f"property double {x}" for x in "xyz"),
                f"element face {len(body.faces)}", "property list uchar int vertex_indices", "element edge 2",
                "property int vertex1", "property int vertex2", "end_header"]  # fmt: skip
        return "PLY", ".ply", "\n".join([*head, *rows, ""]).encode()
    if odd == "two solids":
        half = len(body.faces) // 2
        parts = (Body("", body.corners, part, 1.0) for part in (body.faces[:half], body.faces[half:]))
        return "ascii STL", ".stl", b"".join(WRITERS["ascii STL"][0](part, rng) for part in parts)
    text = obj(body, rng).decode().replace("\r", "")
    if odd == "lines and points":
        text += "l 1 2 3\np 1\n"
    elif odd == "cut line":
        text = "\n".join(line if i % 9 or " " not in line or line[0] != "f" else line.replace(" ", " \\\n ", 1)
                         for i, line in enumerate(text.split("\n")))  # fmt: skip
    return "OBJ", ".obj", text.encode()


def hostile_mesh(rng: Random) -> ForeignFile:
    """A damaged mesh, or one whose header lies."""
    kind = rng.choice(["damaged"] * 14 + ["STL count", "PLY count", "OFF count", "index", "list", "far", "same"])
    if kind == "damaged":
        return damaged(ordinary_mesh(rng) if rng.random() < 0.7 else odd_mesh(rng, rng.choice(ODD)), rng)
    body, many = box(9.0, 8.0, 7.0).in_triangles(), rng.choice([2**31 - 1, 2**32 - 1, 10**9, 10**15, -1])
    suffix, content = ".obj", obj(body, rng)
    if kind == "STL count":
        suffix, content = ".stl", WRITERS["binary STL"][0](body, rng)
        content = content[:80] + struct.pack("<I", many % 2**32) + content[84:]
    elif kind == "PLY count":
        word = rng.choice([b"element vertex 8", b"element face 12"])
        suffix, content = ".ply", ply(body, rng)
        content = content.replace(word, word.rsplit(b" ", 1)[0] + f" {many}".encode())
    elif kind == "OFF count":
        suffix, content = ".off", off(body, rng)
        content = content.replace(b"8 12 0", rng.choice([f"{many} 12 0", f"8 {many} 0", f"8 12 {many}"]).encode())
    elif kind == "index":
        content += f"f 1 2 {many}\n".encode()
    elif kind == "list":
        suffix, content = ".off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n" + f"{many} 0 1 2\n".encode()
    elif kind == "far":
        content = content.replace(b"v ", f"v {rng.choice(['1e300', '1e38', 'nan', 'inf', '-1e20'])} ".encode(), 1)
    else:
        content = b"v 1 1 1\n" * 9 + b"f 1 2 3\nf 4 5 6\nf 7 8 9\n" * 5000
    return ForeignFile(content, suffix, f"{suffix}, hostile: {kind} {many}", None)
