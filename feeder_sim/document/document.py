"""What a page is made of, and its HTML: one file, nothing that has to be loaded, no scripts but those of a player.

All text goes through the template's automatic escaping, so that a title or a name of a file cannot become HTML; a
policy in the page itself forbids other scripts and everything that comes from elsewhere.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from feeder_sim.document.figure import Figure, Picture
from feeder_sim.document.player import Player, policy_for
from feeder_sim.document.words import cell_text, headed
from feeder_sim.errors import escaped

WIDEST_TEXT = 10_000  # characters of a line


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
    tone: Literal["plain", "note", "warning", "failure", "code"] = "plain"


@dataclass(frozen=True)
class Table:
    """A table; columns from `numbers_from` on hold numbers. A first cell that is empty belongs to the row above."""

    kind: ClassVar[str] = "table"
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers_from: int = 1000

    def lines(self) -> list[str]:
        """The table as lines of text, as wide as it needs to be."""
        from rich.table import Table as RichTable
        from rich.text import Text as RichText

        table = RichTable(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for i, name in enumerate(self.head):
            table.add_column(RichText(name), justify="right" if i >= self.numbers_from else "left", no_wrap=True)
        for row in self.rows:
            table.add_row(*map(RichText, row))
        return [*([self.caption] if self.caption else []), *_lines_of(table)]

    @staticmethod
    def of(rows: Sequence[Mapping[str, Any]], keys: Sequence[str] | None = None, *, numbers_from: int = 0) -> Table:
        """Of rows by key, all of the same keys: heads are made of these keys, with their units; of all, or of some.

        A value by name, such as {"front": 0.1}, is a column for each name.
        """
        split = [_split(row, keys or list(row)) for row in rows]
        heads = [key for key in split[0] if any(row[key] is not None for row in split)] if split else []
        cells = tuple(tuple(cell_text(key, row[key]) for key in heads) for row in split)
        return Table("", tuple(map(headed, heads)), cells, numbers_from)


def _split(row: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """A row with a key for every name of a value by name, between its words and its unit."""
    split: dict[str, Any] = {}
    for key in keys:
        if isinstance(row[key], Mapping):
            words, _, unit = key.rpartition("_")
            split |= {f"{words}_{name}_{unit}": value for name, value in row[key].items()}
        else:
            split[key] = row[key]
    return split


@dataclass(frozen=True)
class Folded:
    """What is shown only when the reader asks for it; not in print."""

    kind: ClassVar[str] = "folded"
    summary: str
    blocks: tuple[Text | Table, ...]


Block = Text | Table | Figure | Picture | Player | Folded


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Document:
    """A whole document: heading, a line below it, the most important results, notices, sections, last line."""

    title: str
    subtitle: str
    tiles: tuple[Tile, ...]
    notices: tuple[Text, ...]
    sections: tuple[Section, ...]
    foot: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)

    @property
    def pictures(self) -> int:
        """Number of pictures."""
        return sum(isinstance(block, Figure | Picture) for section in self.sections for block in section.blocks)

    @property
    def policy(self) -> str:
        """What the page may load and run."""
        return policy_for([b for section in self.sections for b in section.blocks if isinstance(b, Player)])

    def html(self) -> str:
        """The whole page, one file."""
        return str(_template("page").render(page=self))

    def _repr_html_(self) -> str:
        """What a notebook shows: all but what a page folds."""
        return str(_template("notebook").render(page=self))

    def text(self) -> str:
        """What a terminal shows: all but pictures, and what a page folds."""
        lines = [self.title, self.subtitle, ""]
        for tile in self.tiles:
            lines.append(f"{tile.label}: {tile.value} {tile.unit} {tile.note}".rstrip())
        lines += [*(notice.text for notice in self.notices), ""]
        for section in self.sections:
            printed = [block for block in section.blocks if isinstance(block, Text | Table)]
            lines += [section.title, "-" * len(section.title), ""] if printed else []
            for block in printed:
                lines += [*(block.lines() if isinstance(block, Table) else block.text.splitlines()), ""]
        return "\n".join(escaped(line) for line in [*lines, self.foot])


@functools.cache
def _template(name: str) -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("feeder_sim", "document"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_visible,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(f"{name}.html.j2")


def _lines_of(renderable: Any) -> list[str]:
    """What rich draws, as lines that are never wrapped."""
    from rich.console import Console

    console = Console(file=io.StringIO(), width=WIDEST_TEXT, color_system=None)
    console.print(renderable)
    assert isinstance(console.file, io.StringIO)
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


def _visible(value: Any) -> Any:
    """Text without control characters and marks that turn its direction, but with its lines."""
    if type(value) is not str:
        return value
    characters = (c if c.isprintable() or c == "\n" else c.encode("unicode_escape", "replace").decode() for c in value)
    return "".join(characters)
