"""Notebooks as pages: their text, and their code as blocks. Running them is the business of a test."""

from __future__ import annotations

import json
from typing import Any

from myst_parser.parsers.sphinx_ import MystParser


class NotebookParser(MystParser):  # type: ignore[misc]
    """Reads a notebook as the Markdown page that it could be."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: Any) -> None:
        super().parse(as_markdown(inputstring), document)


def as_markdown(notebook: str) -> str:
    """The cells of a notebook, one after the other."""
    pages = []
    for cell in json.loads(notebook)["cells"]:
        text = "".join(cell["source"])
        pages.append(f"```python\n{text}\n```" if cell["cell_type"] == "code" else text)
    return "\n\n".join(pages) + "\n"


def setup(app: Any) -> dict[str, Any]:
    app.add_source_suffix(".ipynb", "notebook")
    app.add_source_parser(NotebookParser)
    return {"version": "1", "parallel_read_safe": True}
