"""Shapes of an SVG as points: every shape is the path that the standard says it equals, every path is followed.

Source: SVG 2, chapters 9 and 10. Bezier curves are divided so that their second differences bound the sagitta.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from feeder_sim.scenario.drawing_files.strokes import ROUND, SAGITTA, Account, Points
from feeder_sim.scenario.drawing_files.svg_page import NUMBER, length

SHAPES = ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon")
COMMANDS = re.compile(r"\s*[Mm][MmZzLlHhVvCcSsQqTtAaEe0-9+\-.,\s]*")
KINDS = "matrix|translate|scale|rotate|skewX|skewY"
TRANSFORM = re.compile(rf"\s*+({KINDS})\s*+\(\s*+({NUMBER}(?:[\s,]*+{NUMBER})*+)\s*+\)[\s,]*+")
CLOSED_AGAIN = re.compile(r"([Zz])[\s,]*+(?:[Zz][\s,]*+)++")
MOST_NUMBERS, MOST_REOPENED = 100_000, 1000  # of a path; svgelements takes the square of the second
ARGUMENTS = {"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3), "skewX": (1,), "skewY": (1,)}
MOST_PIECES = 20_000  # of one curve


def transform_of(element: Any, account: Account) -> Points:
    """The matrix (3, 3) of an element's `transform`.

    Raises:
        InputError: one that the standard does not know.
    """
    matrix, text = np.eye(3), element.get("transform", "")
    at = len(text) - len(text.lstrip())
    while at < len(text):
        match = TRANSFORM.match(text, at)
        numbers = [float(part) for part in re.findall(NUMBER, match[2])] if match is not None else []
        if match is None or len(numbers) not in ARGUMENTS[match[1]]:
            raise account.refusal(f"has a transform {text!r} that is none, must be one of {', '.join(ARGUMENTS)}")
        matrix = matrix @ _elementary(match[1], numbers)
        at = match.end()
    return matrix


def _elementary(name: str, numbers: list[float]) -> Points:
    if name == "matrix":
        a, b, c, d, e, f = numbers
        return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])
    if name == "translate":
        return moved(numbers[0], numbers[1] if len(numbers) > 1 else 0.0)
    if name == "scale":
        return np.diag([numbers[0], numbers[-1], 1.0])
    angle = math.radians(numbers[0])
    if name != "rotate":
        skew = np.eye(3)
        skew[(0, 1) if name == "skewX" else (1, 0)] = math.tan(angle)
        return skew
    turn = np.array(
        [[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    x, y = numbers[1:] or (0.0, 0.0)
    return moved(x, y) @ turn @ moved(-x, -y)


def moved(x: float, y: float) -> Points:
    """The matrix (3, 3) of a translation."""
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def path_of(element: Any, name: str, viewport: tuple[float, float], account: Account) -> str:
    """The path that a shape equals, "" for one that the standard does not draw.

    Raises:
        InputError: lengths or points that are none.
    """
    if name == "path":
        return element.get("d", "")
    if name in ("polyline", "polygon"):
        points = element.get("points", "").strip()
        return f"M {points}{' Z' if name == 'polygon' else ''}" if points else ""
    width, height = viewport
    diagonal = math.hypot(width, height) / math.sqrt(2.0)

    def side(key: str, reference: float) -> float:
        return length(element.get(key, "0"), reference, account)

    if name == "line":
        return f"M {side('x1', width)!r} {side('y1', height)!r} L {side('x2', width)!r} {side('y2', height)!r}"
    if name == "rect":
        x, y, w, h = side("x", width), side("y", height), side("width", width), side("height", height)
        radius_texts = {key: element.get(key) for key in ("rx", "ry") if element.get(key, "auto") != "auto"}
        rx = length(radius_texts["rx"], width, account) if "rx" in radius_texts else None
        ry = length(radius_texts["ry"], height, account) if "ry" in radius_texts else None
        rx, ry = rx if rx is not None else ry or 0.0, ry if ry is not None else rx or 0.0
        sizes = (w, h, rx, ry)
        path = _rectangle(x, y, w, h, min(rx, 0.5 * w), min(ry, 0.5 * h)) if w > 0.0 and h > 0.0 else ""
        return _not_negative(name, sizes, path, account)
    if name == "circle":
        rx = ry = side("r", diagonal)
    else:  # without one, or with auto, the other one counts
        radii = {key: element.get(key, "auto") for key in ("rx", "ry")}
        rx = length(radii["rx"], width, account) if radii["rx"] != "auto" else None
        ry = length(radii["ry"], height, account) if radii["ry"] != "auto" else None
        rx, ry = rx if rx is not None else ry or 0.0, ry if ry is not None else rx or 0.0
    x, y = side("cx", width), side("cy", height)
    half = f"A {rx!r} {ry!r} 0 1 1"
    path = f"M {x + rx!r} {y!r} {half} {x - rx!r} {y!r} {half} {x + rx!r} {y!r} Z" if rx > 0.0 and ry > 0.0 else ""
    return _not_negative(name, (rx, ry), path, account)


def _not_negative(name: str, sizes: tuple[float, ...], path: str, account: Account) -> str:
    """The path, if no size is negative, which is an error by the standard."""
    if min(sizes) < 0.0:
        raise account.refusal(f"has a {name} of a negative size, must be 0 and above")
    return path


def _rectangle(x: float, y: float, w: float, h: float, rx: float, ry: float) -> str:
    if rx <= 0.0 or ry <= 0.0:
        return f"M {x!r} {y!r} H {x + w!r} V {y + h!r} H {x!r} Z"
    arc, right, low = f"A {rx!r} {ry!r} 0 0 1", x + w, y + h
    return (
        f"M {x + rx!r} {y!r} H {right - rx!r} {arc} {right!r} {y + ry!r} V {low - ry!r} {arc} {right - rx!r} {low!r} "
        f"H {x + rx!r} {arc} {x!r} {low - ry!r} V {y + ry!r} {arc} {x + rx!r} {y!r} Z"
    )


def followed(path: str, matrix: Points, layer: str, account: Account) -> Iterator[tuple[Points, bool]]:
    """Points (n, 2) [mm] of every piece of a path, and whether it is closed.

    Raises:
        InputError: a path that the standard does not know, or that reaches too far.
    """
    import svgelements as svg

    path = CLOSED_AGAIN.sub(r"\1 ", path)  # closing twice is closing once
    reopened = len(re.findall(r"[Zz](?![\s,]*+(?:[Mm]|$))", path))
    if reopened > MOST_REOPENED or len(re.findall(NUMBER, path)) > MOST_NUMBERS:
        raise account.refusal(f"has a path of too many pieces in the layer {layer}, must be {MOST_NUMBERS} numbers")
    try:
        segments = list(svg.Path(path)) if COMMANDS.fullmatch(path) else None
    except (ValueError, IndexError, TypeError, ArithmeticError):
        segments = None
    if segments is None:
        raise account.refusal(f"has a path in the layer {layer} that is none: {path!r}")
    points: list[Points] = []
    for segment in segments:
        if isinstance(segment, svg.Move):
            if points:
                yield np.vstack(points), False
            points = []
        elif isinstance(segment, svg.Close):
            if points:
                yield np.vstack(points), True
            points = []
        else:
            start = [_placed(np.array([segment.start], float), matrix)] if not points else []
            points += [*start, _curve(segment, matrix, layer, account)]
    if points:
        yield np.vstack(points), False


def _placed(points: Points, matrix: Points) -> Points:
    return points @ matrix[:2, :2].T + matrix[:2, 2]


def _curve(segment: Any, matrix: Points, layer: str, account: Account) -> Points:
    """Points [mm] of one segment, without its first one."""
    names = [name for name in ("start", "control", "control1", "control2", "end") if hasattr(segment, name)]
    control = np.array([[float(at.x), float(at.y)] for at in (getattr(segment, name) for name in names)])
    stretch = float(np.linalg.norm(matrix[:2, :2], 2))
    if hasattr(segment, "sweep"):
        radius = stretch * float(max(segment.rx, segment.ry))
        account.check_reach(layer, np.array([[radius, radius]]))
        angle = 2.0 * math.acos(1.0 - min(SAGITTA / radius, ROUND)) if radius > 0.0 else math.pi
        pieces = abs(float(segment.sweep)) / angle
    else:
        placed = _placed(control, matrix)
        account.check_reach(layer, placed)
        bend = float(np.abs(np.diff(placed, 2, axis=0)).max(initial=0.0))
        degree = len(control) - 1
        pieces = math.sqrt(math.sqrt(2.0) * degree * (degree - 1) / 8.0 * bend / SAGITTA)
    number = int(min(max(math.ceil(pieces), 1), MOST_PIECES))
    inner = segment.npoint(np.linspace(0.0, 1.0, number + 1)[1:-1]) if number > 1 else np.empty((0, 2))
    return _placed(np.vstack([np.asarray(inner, float).reshape(-1, 2), control[-1]]), matrix)
