"""What a notebook shows of a value, in place of its repr."""

from __future__ import annotations

import html
import importlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from feeder_sim.errors import MissingExtra, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_ROWS = 20  # of a table
LONGEST_LINE = 160  # characters of a repr that is made of many values


def line(text: str) -> str:
    """A repr in one line that is not too long."""
    return f"<{shortened(text, LONGEST_LINE)}>"


def block(title: str, lines: Iterable[str]) -> str:
    """A title and lines of text below it, as HTML."""
    text = "\n".join(html.escape(line) for line in lines)
    return f"<b>{html.escape(title)}</b><pre style='margin: 0.3em 0'>{text}</pre>"


def table(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """A title and a table below it, as HTML; the columns are those of the first row. Of many rows the first ones."""
    columns = list(rows[0]) if rows else []
    head = "".join(f"<th>{html.escape(column)}</th>" for column in columns)
    lines = ["".join(f"<td>{html.escape(cell(row[name]))}</td>" for name in columns) for row in rows[:MOST_ROWS]]
    more = f"<p>and {counted(len(rows) - MOST_ROWS, 'more row')}</p>" if len(rows) > MOST_ROWS else ""
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<b>{html.escape(title)}</b><table><tr>{head}</tr>{body}</table>{more}"


def cell(value: Any) -> str:
    """A value as a table shows it; a dash for none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def counted(number: int, name: str) -> str:
    """A number of things: "1 seed", "3 seeds"."""
    return f"{number} {name}" if number == 1 else f"{number} {name}s"


def library(name: str) -> Any:
    """A library of the extra `data`.

    Raises:
        InputError: it is missing.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingExtra("data", key=name) from error


def axes_for(ax: Axes | None) -> Axes:
    """Axes to draw into: those given, or new ones, which a notebook shows."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]
