"""What a page is made of, and its HTML: one file, no scripts, nothing that has to be loaded.

All text goes through the template's automatic escaping, so that a title or a name of a file cannot become HTML; a
policy in the page itself forbids scripts and everything that comes from elsewhere.
"""

from __future__ import annotations

import base64
import functools
import importlib.resources
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

TEMPLATE = "page.html.j2"


@dataclass(frozen=True)
class Tile:
    """A result at the top of the page: what it is, its value with unit, and how sure it is."""

    label: str
    value: str
    unit: str
    note: str


@dataclass(frozen=True)
class Text:
    """A paragraph; `tone` says how much it matters, and "code" keeps its lines."""

    kind: ClassVar[str] = "text"
    text: str
    tone: Literal["plain", "note", "caution", "failure", "code"] = "plain"


@dataclass(frozen=True)
class Table:
    """A table; columns from `numbers_from` on hold numbers. A first cell that is empty belongs to the row above."""

    kind: ClassVar[str] = "table"
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers_from: int = 1000


@dataclass(frozen=True)
class Picture:
    """An embedded picture: PNG or JPEG, its size [pixels], what it shows for who cannot see it, and its legend."""

    kind: ClassVar[str] = "picture"
    content: bytes
    size: tuple[int, int]
    alt: str
    caption: str

    @property
    def source(self) -> str:
        """The picture as an address that holds it."""
        of_type = "png" if self.content.startswith(b"\x89PNG") else "jpeg"
        return f"data:image/{of_type};base64,{base64.b64encode(self.content).decode()}"


@dataclass(frozen=True)
class Folded:
    """What is shown only when the reader asks for it; not in print."""

    kind: ClassVar[str] = "folded"
    summary: str
    blocks: tuple[Text | Table, ...]


Block = Text | Table | Picture | Folded


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A whole page: heading, a line below it, the most important results, notices, sections, last line."""

    title: str
    subtitle: str
    tiles: tuple[Tile, ...]
    notices: tuple[Text, ...]
    sections: tuple[Section, ...]
    foot: str

    @property
    def pictures(self) -> int:
        """Number of pictures."""
        return sum(isinstance(block, Picture) for section in self.sections for block in section.blocks)


def html_of(page: Page) -> str:
    """The page as HTML."""
    return str(_template().render(page=page))


@functools.cache
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    text = importlib.resources.files("feeder_sim.report").joinpath(TEMPLATE).read_text(encoding="utf-8")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, finalize=_visible, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(text)


def _visible(value: Any) -> Any:
    """Text without control characters and marks that turn its direction, but with its lines."""
    if type(value) is not str:
        return value
    shown = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape", "replace").decode() for c in value)
    return "".join(shown)
