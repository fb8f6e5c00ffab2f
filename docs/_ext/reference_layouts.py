"""The layout of a file, word for word from the docstring of the module that reads and writes it."""

from __future__ import annotations

import importlib
import inspect


def file_layout(module: str) -> str:
    """The sentence that begins with "Layout" and the indented block after it, as Markdown.

    Raises:
        ValueError: the docstring has none.
    """
    lines = inspect.cleandoc(importlib.import_module(module).__doc__ or "").splitlines()
    first = next((i for i, line in enumerate(lines) if line.startswith("Layout")), None)
    if first is None:
        raise ValueError(f"the docstring of {module} has no line that begins with 'Layout'")
    block = []
    for line in lines[first + 1 :]:
        if line and not line.startswith(" "):
            break
        block.append(line)
    while block and not block[0]:
        block.pop(0)
    text = inspect.cleandoc("\n".join(["", *block])).rstrip()
    return f"{lines[first].rstrip(':')}:\n\n```text\n{text}\n```"
