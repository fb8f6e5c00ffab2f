"""Fixtures and outlets of a drawing (DXF, SVG) -> the tables that say the same.

A `[[fixture]]` of `shape = "extrusion"` with a `drawing` in place of its points takes the next ring of the layer
`fixtures`, an `[[outlet]]` of the layer `outlets`, from left to right; a single one stands for all of them, with
numbers behind its name. Places are from the middle of the box around the outline, as on the plate of the same drawing,
or as drawn where it has no outline. The origin of a fixture is the middle of the box around it, and its `position_mm`
moves it from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.scenario.drawing import Drawing, Keys, order, placed, read_drawing

LAYERS_OF = {"fixture": "fixtures", "outlet": "outlets"}
STRAIGHT = 0.02  # [mm]; how far straight sides may be from the curves of a fixture or an outlet


def with_drawn_tables(data: Any, folder: Path) -> Any:
    """The keys of a scenario; fixtures and outlets with a drawing have what it says in place of it.

    Args:
        data: keys, as a file has them.
        folder: which names of drawings are relative to.

    Raises:
        InputError: a drawing that cannot be read, or has other fixtures or outlets than there are tables.
    """
    if not isinstance(data, dict):
        return data
    result, drawings, uses = dict(data), dict[str, Drawing](), set[tuple[str, str]]()
    for key, layer in LAYERS_OF.items():
        tables: Any = result.get(key)
        for name in dict.fromkeys(map(_drawing_of, tables)) if isinstance(tables, list | tuple) else ():
            if name is None:
                continue
            lacking = [_drawing_of(table) == name for table in tables]
            unit = _first_checked(tables, lacking, key).get("drawing_unit")
            drawing = drawings.get(name) or read_drawing(Path(folder) / name, unit, f"{key}.drawing_unit")
            rings = sorted((_ring(ring, drawing.middle) for ring in drawing.rings[layer]), key=order)
            tables = placed(tables, lacking, rings, f"[[{key}]] of it", layer, drawing.account, MERGES[key])
            drawings[name], result[key] = drawing, tables
            uses.add((name, layer))
    for name, drawing in drawings.items():
        for layer in drawing.rings:
            if (name, layer) not in uses:
                drawing.account.ignore_layer(layer, layer)
    if drawings:
        result["drawing_account"] = "; ".join(drawing.account.to_text() for drawing in drawings.values())
    return result


def _drawing_of(table: Any) -> str | None:
    name = table.get("drawing") if isinstance(table, dict) else None
    return None if name is None else str(name)


def _first_checked(tables: Sequence[Any], lacking: Sequence[bool], key: str) -> Keys:
    """The first table of a drawing.

    Raises:
        InputError: one of them has a shape in numbers, too, or another one than is drawn.
    """
    numbers = [i for i, lacks in enumerate(lacking) if lacks]
    for i in numbers:
        if any(tables[i].get(name) is not None for name in ("points_mm", "outline_mm", "box_mm")):
            raise InputError("is given beside a shape in numbers, must be one of both", key=f"{key}[{i}].drawing")
        if key == "fixture" and tables[i].get("shape") != "extrusion":
            raise InputError("is of a shape that is not drawn, must be extrusion", key=f"{key}[{i}].drawing")
    first: Keys = tables[numbers[0]]
    return first


def _ring(ring: Any, middle: tuple[float, float]) -> Keys:
    """Where the middle of a ring is, and its corners from there [mm]."""
    x0, y0, x1, y1 = ring.bounds
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    corners = list(ring.simplify(STRAIGHT).exterior.coords)[:-1]
    return {"at_mm": (x - middle[0], y - middle[1]), "points_mm": [[u - x, v - y] for u, v in corners]}


def _fixture(table: Keys, ring: Keys) -> Keys:
    """A fixture that is such a ring, moved by its own position, which may be given in the wrong form."""
    own = table.get("position_mm", (0.0, 0.0))
    if isinstance(own, list | tuple) and all(isinstance(value, int | float) for value in own):
        own = [*(a + b for a, b in zip(ring["at_mm"], own, strict=False)), *own[2:]]
    return _without_drawing(table) | {"points_mm": ring["points_mm"], "position_mm": own}


def _outlet(table: Keys, ring: Keys) -> Keys:
    x, y = ring["at_mm"]
    return _without_drawing(table) | {"outline_mm": [[x + u, y + v] for u, v in ring["points_mm"]]}


def _without_drawing(table: Keys) -> Keys:
    return {key: value for key, value in table.items() if key not in ("drawing", "drawing_unit")}


MERGES = {"fixture": _fixture, "outlet": _outlet}
