"""Cards of example scenarios: a picture, the title, the sentence that the file begins with, and the command."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from typeset import typeset

ROOT = Path(__file__).parents[2]
BRACKETS = re.compile(r"\s*\((?:\d{4}|[^()]*[A-Za-z][^()]*)\)")  # around a year or words; (0,3) is a mode
PICTURES = "figures/gallery"  # from docs/; made by docs/figures/gallery.py


def cards(names: str) -> str:
    """A grid of cards as Markdown, in the order of the names.

    Raises:
        OSError: there is no such scenario.
        ValueError: its picture is not there.
    """
    return "\n".join(["::::{grid} 1 2 3 3", ":gutter: 3", "", *(_card(name) for name in names.split(",")), "::::"])


def _card(name: str) -> str:
    text = (ROOT / "scenarios" / f"{name}.toml").read_text(encoding="utf-8")
    picture = f"{PICTURES}/{name}.jpg"
    if not (ROOT / "docs" / picture).is_file():
        raise ValueError(f"there is no docs/{picture}: python docs/figures/gallery.py {name}")
    title = typeset(tomllib.loads(text)["title"])
    title = title[0].upper() + title[1:]
    return "\n".join(
        [
            f":::{{grid-item-card}} {title}",
            f":img-top: {picture}",
            f":img-alt: {title}",
            "",
            typeset(first_sentence(text)),
            "",
            f"```text\nfeeder-sim run {name}\n```",
            ":::",
        ]
    )


def first_sentence(scenario: str) -> str:
    """Of the comment at the beginning of a scenario, without what it says in brackets."""
    lines = []
    for line in scenario.splitlines()[1:]:  # the first names the schema
        if not line.startswith("# ") or line.startswith("#   "):  # a command
            break
        lines.append(line.removeprefix("# "))
    text = " ".join(lines)
    while (shorter := BRACKETS.sub("", text)) != text:
        text = shorter
    found = re.match(r".+?\.(?= [A-Z0-9`]|$)", text)
    return found.group() if found else text.rstrip(":") + "."
