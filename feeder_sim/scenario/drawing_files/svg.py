"""SVG: shapes of every group, copies by `use` included -> strokes.

A layer is a group, or one shape, with its name as id or as label in Inkscape; the nearest such name counts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, NamedTuple
from xml.etree import ElementTree

from feeder_sim.errors import MissingExtra
from feeder_sim.scenario.drawing_files.strokes import Account, Points, Stroke, layer_of, misspelt
from feeder_sim.scenario.drawing_files.svg_page import fitted, length, local, page_matrix, view_box
from feeder_sim.scenario.drawing_files.svg_shapes import SHAPES, followed, moved, path_of, transform_of

SPACE = "http://www.w3.org/2000/svg"
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
LINK = "{http://www.w3.org/1999/xlink}href"
GROUPS = ("g", "a", "svg")
TEXTS = ("text", "title", "desc")
PICTURES = ("image", "foreignObject", "video", "canvas")
DEFINITIONS = ("defs", "symbol", "clipPath", "mask", "marker", "pattern", "linearGradient", "radialGradient", "filter")
SILENT = (*DEFINITIONS, "style", "script", "metadata", "view", "cursor", "font")
GEOMETRY = {"d", "x", "y", "cx", "cy", "r", "rx", "ry", "width", "height"}  # attributes that are not read from styles
PLACING = {"transform", "transform-origin", "transform-box", "translate", "rotate", "scale", "offset-path", "zoom"}
SEEN = {"fill", "display", "visibility", "clip-path", "mask", *GEOMETRY, *PLACING}  # by rules of a style: understood
MOST_RULES = 2000
DEEPEST = 32  # copies in copies
SELECTOR = re.compile(r"[.#]?[-\w]+|\*")


class State(NamedTuple):
    """What an element has from its parents."""

    matrix: Points
    viewport: tuple[float, float]
    layer: str | None = None
    name: str = "without a name"  # of the nearest group that has one
    filled: bool = True
    removed: bool = False  # by display
    invisible: bool = False  # by visibility, which an inner element may set back
    cut: bool = False
    uses: tuple[str, ...] = ()


def read_svg(path: Path, unit: str | None, account: Account) -> Iterator[Stroke]:
    """Strokes of an SVG drawing, y upwards from the lower edge of the page.

    Args:
        path: of the drawing.
        unit: `drawing_unit`, for a drawing that does not say its own.
        account: to which every entity goes.

    Raises:
        InputError: a drawing that cannot be read, or not be understood.
        MissingExtra: svgelements is not installed.
    """
    try:
        import svgelements  # noqa: F401
    except ImportError:
        raise MissingExtra("drawing", key="plate.drawing") from None
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, LookupError, ValueError) as error:
        raise account.refusal("is not a readable SVG drawing") from error
    space, name = local(root.tag)
    if name != "svg" or space not in ("", SPACE):
        kind = f"{name} of {space!r}" if space else name
        raise account.refusal(f"is not an SVG drawing but {kind}, must be svg of {SPACE!r}")
    return _Reader(root, account).strokes(*page_matrix(root, unit, account))


class _Reader:
    """One pass over the elements of a page, with a stack of its own: groups may lie in thousands of groups."""

    def __init__(self, root: Any, account: Account) -> None:
        self.root, self.account = root, account
        self.space = local(root.tag)[0]
        self.by_id: dict[str, Any] = {}
        for element in root.iter():
            if element.get("id"):
                self.by_id.setdefault(element.get("id"), element)  # the first of several, as browsers do
        self.rules = _rules(root, account)

    def strokes(self, matrix: Points, viewport: tuple[float, float]) -> Iterator[Stroke]:
        if self.root.get("transform"):
            raise self.account.refusal("has a page with a transform, must be one on a group")
        page = self._state(self.root, State(matrix, viewport))._replace(layer=None, name="without a name")
        stack = [(child, page) for child in reversed(self.root)]
        while stack:
            element, parent = stack.pop()
            space, name = local(element.tag)
            if not name:  # a comment
                continue
            if space != self.space:
                self._foreign(element, name, parent)
                continue
            self.account.count()
            if name in SILENT:
                self.account.ignore("definitions", 0 if parent.uses else _shapes_in(element))
                continue
            state = self._state(element, parent)
            if name in SHAPES:
                yield from self._shape(element, name, state)
            elif name in GROUPS:
                inner = self._within(element, state) if name == "svg" else state
                stack += [(child, inner) for child in reversed(element)]
            elif name == "use":
                stack += self._copy(element, state)
            else:
                self._other(element, name, state)

    def _state(self, element: Any, parent: State) -> State:
        """What holds for an element and those in it."""
        style, name = self._style(element), local(element.tag)[1]
        names = [element.get(key) for key in (LABEL, "data-name", "id") if element.get(key)]
        layer = next((layer for layer in map(layer_of, names) if layer), None)
        if layer is None and parent.layer is None and (nearest := next(filter(misspelt, names), None)):
            names = [nearest]
        layer = parent.layer if layer is None or (parent.uses and parent.layer) else layer
        placing = (PLACING | (GEOMETRY if name in SHAPES else set())).intersection(style)
        if element.get("transform") and element.get("transform-origin"):
            placing.add("transform-origin")
        if placing and element is not self.root:
            raise self.account.refusal(
                f"has a {name} in {layer or (names[0] if names else parent.name)} whose {min(placing)} is given by a "
                "style, must be attributes"
            )

        def value(key: str) -> str:
            return str(style.get(key, element.get(key, ""))).strip().lower()

        fill = value("fill")
        painted = fill not in ("none", "transparent") if fill and fill != "inherit" else parent.filled
        return parent._replace(
            matrix=parent.matrix @ transform_of(element, self.account),
            layer=layer,
            name=names[0] if names else parent.name,
            filled=painted,
            removed=parent.removed or value("display") == "none",
            invisible=value("visibility") in ("hidden", "collapse") if value("visibility") else parent.invisible,
            cut=parent.cut or any(value(key) not in ("", "none") for key in ("clip-path", "mask")),
        )

    def _style(self, element: Any) -> dict[str, str]:
        """Properties of an element by rules of the page, then by its own style."""
        names = ["*", local(element.tag)[1], *(f".{name}" for name in element.get("class", "").split())]
        names.append(f"#{element.get('id', '')}")
        ranked = sorted((rule for name in names for rule in self.rules.get(name, ())), key=lambda rule: rule[0])
        style: dict[str, str] = {}
        for _, properties in ranked:
            style |= properties
        return style | _properties(element.get("style", ""))

    def _shape(self, element: Any, name: str, state: State) -> Iterator[Stroke]:
        if state.layer is None:
            self.account.ignore_foreign(state.name)
            return
        if state.removed or state.invisible:
            raise self.account.hidden(name, state.layer)
        if state.cut:
            raise self.account.refusal(f"has a clipped {name} in the layer {state.layer}, must be whole ones")
        path = path_of(element, name, state.viewport, self.account)
        pieces = list(followed(path, state.matrix, state.layer, self.account)) if path.strip() else []
        if not pieces:
            self.account.ignore("shapes that draw nothing")
        for points, closed in pieces:
            kind: Literal["line", "filled"] = "filled" if state.filled and name != "line" else "line"
            yield from self.account.add_stroke(state.layer, points, closed=closed, kind=kind)

    def _within(self, element: Any, state: State, size: Any = None) -> State:
        """In a viewport of its own; its sides are those of `size`, which copies it, where that has any."""
        wide, high = state.viewport
        x, y = (length(element.get(key, "0"), side, self.account) for key, side in (("x", wide), ("y", high)))
        side_texts = {
            key: (None if size is None else size.get(key)) or element.get(key, "100%") for key in ("width", "height")
        }
        width, height = (length(side_texts[key], s, self.account) for key, s in (("width", wide), ("height", high)))
        box = view_box(element, self.account)
        if box is None:
            return state._replace(matrix=state.matrix @ moved(x, y), viewport=(width, height))
        inner = fitted(element, box, width, height, self.account)
        return state._replace(matrix=state.matrix @ moved(x, y) @ inner, viewport=box[2:])

    def _copy(self, element: Any, state: State) -> list[tuple[Any, State]]:
        """The element that a `use` copies, or those in the symbol that it copies, in its place."""
        link = element.get("href") or element.get(LINK) or ""
        name = link.removeprefix("#")
        target = self.by_id.get(name) if link.startswith("#") else None
        if target is None and state.layer is not None:
            raise self.account.refusal(f"copies {link!r} into the layer {state.layer}, which the drawing lacks")
        if target is None:
            self.account.ignore_foreign(state.name)
            return []
        if name in state.uses or len(state.uses) >= DEEPEST:
            raise self.account.refusal(f"copies {link!r} into itself, or copies copies of copies")
        wide, high = state.viewport
        x, y = (length(element.get(key, "0"), side, self.account) for key, side in (("x", wide), ("y", high)))
        placed = state._replace(matrix=state.matrix @ moved(x, y), uses=(*state.uses, name))
        if local(target.tag)[1] not in ("symbol", "svg"):
            return [(target, placed)]
        if target.get("refX") or target.get("refY"):
            raise self.account.refusal(f"copies the symbol {link!r} by its refX or refY, must be its corner")
        inner = self._within(target, self._state(target, placed), element)
        return [(child, inner) for child in reversed(target)]

    def _other(self, element: Any, name: str, state: State) -> None:
        """An element that draws no line."""
        layer = state.layer or _layer_within(element)
        if name not in TEXTS and _shapes_in(element) and layer is not None:
            raise self.account.refusal(f"has shapes in a {name} in the layer {layer}, must be groups")
        self.account.ignore("texts" if name in TEXTS else "pictures" if name in PICTURES else "unknown elements")

    def _foreign(self, element: Any, name: str, parent: State) -> None:
        """An element of another namespace, as editors put in."""
        layer = parent.layer or _layer_within(element)
        if layer is not None and _shapes_in(element):
            raise self.account.refusal(
                f"has a {name} of another namespace in the layer {layer}, must be shapes of {SPACE!r}"
            )
        self.account.ignore("elements of other namespaces")


def _shapes_in(element: Any) -> int:
    return sum(local(inner.tag)[1] in SHAPES for inner in element.iter())


def _properties(text: str) -> dict[str, str]:
    """Properties of a style, by lower-case name."""
    pairs = (declaration.partition(":") for declaration in text.split(";"))
    return {key.strip().lower(): value.split("!")[0].strip() for key, colon, value in pairs if colon}


def _layer_within(element: Any) -> str | None:
    """The first layer that something in an element is named by."""
    names = (inner.get(key) for inner in element.iter() for key in (LABEL, "data-name", "id"))
    return next((layer for name in names if name and (layer := layer_of(name))), None)


def _rules(root: Any, account: Account) -> dict[str, list[tuple[int, dict[str, str]]]]:
    """Properties by selector: of a tag, a class or an id, each with its rank, by which the later of two counts.

    Raises:
        InputError: other selectors, or `!important`, of properties that decide what is drawn; too many rules.
    """
    rules: dict[str, list[tuple[int, dict[str, str]]]] = {}
    number = 0
    for element in root.iter():
        if local(element.tag)[1] != "style":
            continue
        for selectors, body in _rule_texts("".join(element.itertext())):
            properties = _properties(body)
            decides = sorted(SEEN.intersection(properties))
            for selector in (name.strip() for name in selectors.split(",")):
                number += 1
                if number > MOST_RULES:
                    raise account.refusal(f"has more than {MOST_RULES} rules of style, must be fewer")
                if SELECTOR.fullmatch(selector) and not (decides and "!important" in body.replace(" ", "")):
                    rank = MOST_RULES * (1 + ".#".find(selector[0])) + number
                    rules.setdefault(selector, []).append((rank, properties))
                elif decides and selector and not selector.startswith("@"):
                    raise account.refusal(
                        f"has a rule of style for {selector!r} that gives {decides[0]}, must be rules of one tag, "
                        "class or id, without !important"
                    )
    return rules


def _rule_texts(text: str) -> Iterator[tuple[str, str]]:
    """Selectors and properties of a style; what stands before them, such as @import, is left out."""
    text = "".join(piece.partition("*/")[2] if i else piece for i, piece in enumerate(text.split("/*")))
    for part in text.split("}"):
        head, brace, body = part.rpartition("{")
        if brace:
            yield head.rpartition("{")[2].rpartition(";")[2], body
