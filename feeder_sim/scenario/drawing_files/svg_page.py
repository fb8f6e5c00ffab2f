"""The page of an SVG: its unit, its viewport, and the attributes that the standard gives a meaning.

Source: SVG 1.1 (second edition) and SVG 2, chapters 7 and 8 (coordinate systems, units, preserveAspectRatio).
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from feeder_sim.scenario.drawing_files.strokes import MM, Account, Points

# Possessive: a long text that is no number is given up at once.
NUMBER = r"[-+]?(?:\d++\.?\d*+|\.\d++)(?:[eE][-+]?\d++)?+"
LENGTH = re.compile(rf"\s*+({NUMBER})\s*+(mm|cm|in|pt|pc|px|q|%)?\s*+", re.IGNORECASE)
PX = 25.4 / 96.0  # [mm], by CSS
PHYSICAL = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72.0, "pc": 25.4 / 6.0, "q": 0.25}  # [mm]
AGREE = 2e-3  # relative; widths are written with few digits
ALIGN = re.compile(r"(?:defer\s+)?(none|x(Min|Mid|Max)Y(Min|Mid|Max))(?:\s+(meet|slice))?")
SHARE = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}


def local(tag: Any) -> tuple[str, str]:
    """Namespace and name of an element; a comment has none."""
    if not isinstance(tag, str):
        return "", ""
    space, _, name = tag.rpartition("}")
    return space.removeprefix("{"), name


def length(text: str, reference: float, account: Account) -> float:
    """A length in units of the user.

    Args:
        text: of the attribute.
        reference: what a percentage is of.
        account: of the drawing, for messages.

    Raises:
        InputError: no length, or one in a unit of fonts.
    """
    match = LENGTH.fullmatch(text)
    if match is None:
        raise account.refusal(f"has a length {text!r}, must be a number, perhaps in mm, cm, in, pt, pc, px, Q or %")
    value, unit = float(match[1]), (match[2] or "px").lower()
    if unit == "%" and reference == 0.0:
        raise account.refusal(f"has a length of {text!r} of a page without a size, must be a number")
    if unit == "%":
        return 0.01 * value * reference
    return value * PHYSICAL.get(unit, PX) / PX


def view_box(element: Any, account: Account) -> tuple[float, float, float, float] | None:
    """Its corner and sides, None without one.

    Raises:
        InputError: no four numbers, or no sides.
    """
    text = element.get("viewBox")
    if text is None:
        return None
    parts = re.split(r"[\s,]+", text.strip())
    if len(parts) != 4 or not all(re.fullmatch(NUMBER, part) for part in parts):
        raise account.refusal(f"has a viewBox {text!r}, must be four numbers")
    x, y, width, height = map(float, parts)
    if not (0.0 < width < math.inf and 0.0 < height < math.inf):
        raise account.refusal(f"has a viewBox {text!r}, must be sides above 0")
    return x, y, width, height


def fitted(
    element: Any, box: tuple[float, float, float, float], width: float, height: float, account: Account
) -> Points:
    """The matrix (3, 3) that fits a viewBox into a viewport at the origin, by preserveAspectRatio."""
    match = ALIGN.fullmatch(element.get("preserveAspectRatio", "xMidYMid meet").strip())
    if match is None:
        raise account.refusal("has a preserveAspectRatio that the standard does not know")
    x, y = width / box[2], height / box[3]
    if match[1] != "none":
        x = y = max(x, y) if match[4] == "slice" else min(x, y)
    left = SHARE.get(match[2], 0.0) * (width - x * box[2])
    top = SHARE.get(match[3], 0.0) * (height - y * box[3])
    return np.array([[x, 0.0, left - x * box[0]], [0.0, y, top - y * box[1]], [0.0, 0.0, 1.0]])


def page_matrix(root: Any, unit: str | None, account: Account) -> tuple[Points, tuple[float, float]]:
    """From units of the user to [mm], y upwards from the lower edge of the page; and the viewport in these units.

    Raises:
        InputError: a page without a unit, or one that contradicts `drawing_unit`.
    """
    box = view_box(root, account)
    sides = [_side(root.get(name), account) for name in ("width", "height")]
    if any(kind in PHYSICAL for _, kind in sides):
        millimetres = [None if kind == "%" else value * PHYSICAL.get(kind, PX) for value, kind in sides]
        matrix, height = _physical(root, box, millimetres, account)
        if unit is not None and not np.allclose(np.abs(np.diag(matrix)[:2]), MM[unit], rtol=AGREE):
            raise account.refusal(
                f"says that a unit is {matrix[0, 0]:.5g} mm, drawing_unit is {unit!r}: must be no other"
            )
    elif unit is None:
        raise account.refusal(f"does not say its unit, must be drawing_unit with {', '.join(MM)}")
    else:
        x, y, _, tall = box or (0.0, 0.0, 0.0, 0.0 if sides[1][1] == "%" else sides[1][0])
        matrix = MM[unit] * np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, 1.0 / MM[unit]]])
        height = MM[unit] * tall
    upwards = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, height], [0.0, 0.0, 1.0]])
    of_page = [0.0 if kind == "%" else value * PHYSICAL.get(kind, PX) / PX for value, kind in sides]
    return upwards @ matrix, box[2:] if box is not None else (of_page[0], of_page[1])


def _side(text: str | None, account: Account) -> tuple[float, str]:
    """Width or height of the page, and its unit; one that is not given is 100 %.

    Raises:
        InputError: no length, or one of 0 and less.
    """
    match = LENGTH.fullmatch("100%" if text is None or text.strip() == "auto" else text)
    if match is None or not 0.0 < float(match[1]) < math.inf:
        raise account.refusal(f"has a page of width or height {text!r}, must be a length above 0")
    return float(match[1]), (match[2] or "px").lower()


def _physical(
    root: Any, box: tuple[float, float, float, float] | None, sides: list[float | None], account: Account
) -> tuple[Points, float]:
    """The matrix of a page that says its size, y downwards, and its height [mm]."""
    width, height = sides
    if box is None:
        return np.diag([PX, PX, 1.0]), height or 0.0
    if width is None or height is None:  # the other side follows from the viewBox
        scale = width / box[2] if width is not None else (height or 0.0) / box[3]
        width, height = scale * box[2], scale * box[3]
    return fitted(root, box, width, height, account), height
