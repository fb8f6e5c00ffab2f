"""The rooms of the package as a picture, drawn from the import contract that keeps them in order."""

from __future__ import annotations

import ast
import html
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
WIDTH, ROW, GAP = 760, 30, 6  # [px] of the picture, a room, and between rooms
CONTRACT = "Rooms import downward only"


def rooms_picture(subject: str) -> str:
    """An SVG: a row for each layer of the contract, the highest first; `subject` is not used.

    Raises:
        KeyError: pyproject.toml has no such contract.
    """
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = {contract["name"]: contract for contract in settings["tool"]["importlinter"]["contracts"]}
    layers = [[name.strip() for name in layer.split("|")] for layer in contracts[CONTRACT]["layers"]]
    height = len(layers) * (ROW + GAP) + GAP
    boxes = []
    for row, names in enumerate(layers):
        width = (WIDTH - GAP) / len(names)
        for column, name in enumerate(names):
            x, y = GAP + column * width, GAP + row * (ROW + GAP)
            boxes.append(
                f'<rect x="{x:.1f}" y="{y}" width="{width - GAP:.1f}" height="{ROW}" rx="4" fill="#e8eef6" '
                f'stroke="#1f5fa8"/><text x="{x + 8:.1f}" y="{y + 20}" font-size="13" fill="#1d2733">'
                f"<tspan font-weight='600'>{html.escape(name)}</tspan>{_subject(name, len(names))}</text>"
            )
    title = "Rooms of the package: each imports from those below it"
    picture = f'<svg role="img" aria-label="{title}" viewBox="0 0 {WIDTH} {height}" width="100%">{"".join(boxes)}</svg>'
    return f"```{{raw}} html\n{picture}\n```"


def _subject(name: str, beside: int) -> str:
    """What a room is about, where there is space for it: the first sentence of its docstring."""
    file = ROOT / "feeder_sim" / name / "__init__.py"
    if beside > 1 or not file.is_file():
        return ""
    text = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0]
    return f" &#8195;{html.escape(text.rstrip('.'))}"
