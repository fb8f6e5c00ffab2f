"""What a notebook shows of a value, in place of its repr."""

from __future__ import annotations

import html
from collections.abc import Iterable


def block(title: str, lines: Iterable[str]) -> str:
    """A title and lines of text below it, as HTML."""
    text = "\n".join(html.escape(line) for line in lines)
    return f"<b>{html.escape(title)}</b><pre style='margin: 0.3em 0'>{text}</pre>"


def counted(number: int, name: str) -> str:
    """A number of things: "1 seed", "3 seeds"."""
    return f"{number} {name}" if number == 1 else f"{number} {name}s"
