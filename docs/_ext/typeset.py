"""Signs that files of plain text write with letters."""

from __future__ import annotations

import re

CODE = re.compile(r"(`[^`]*`)")


def typeset(text: str) -> str:
    """Markdown with µm and ±, except in code."""
    pieces = CODE.split(text)
    pieces[::2] = [
        re.sub(r"\bum\b", "µm", re.sub(r"(?<=\d )us\b", "µs", piece)).replace("+-", "±") for piece in pieces[::2]
    ]
    return "".join(pieces)
