"""Parts of the pages that are made from the package whenever the docs are built, so that they follow it.

A page holds a line such as `<!-- generated: tables feeder_sim.scenario:Scenario -->`, which is replaced by

    tables MODULE:CLASS     every table and key of a scenario or plate file (reference_tables.py)
    options COMMAND         the arguments and options of a command of feeder-sim (reference_commands.py)
    layout MODULE           the layout of a file, from the docstring of its module (reference_layouts.py)
    rooms all               the rooms of the package, from the import contract (reference_rooms.py)
    gallery NAME,NAME,...   a card for each of these example scenarios (reference_gallery.py)
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from reference_commands import command_options
from reference_gallery import cards
from reference_layouts import file_layout
from reference_rooms import rooms_picture
from reference_tables import table_reference
from sphinx.util import logging

GENERATED = re.compile(r"^<!-- generated: (\w+) (\S+(?: \S+)?) -->$", re.MULTILINE)
MAKERS: dict[str, Callable[[str], str]] = {
    "tables": table_reference,
    "options": command_options,
    "layout": file_layout,
    "rooms": rooms_picture,
    "gallery": cards,
}
log = logging.getLogger(__name__)


def setup(app: Any) -> dict[str, Any]:
    app.connect("source-read", fill_in)
    app.connect("env-get-outdated", always_read)
    return {"version": "1", "parallel_read_safe": True}


def fill_in(app: Any, page: str, source: list[str]) -> None:
    """Replace the marked lines of a page; what cannot be made is a warning, which fails a build with -W."""

    def made(found: re.Match[str]) -> str:
        maker, subject = found.groups()
        try:
            return MAKERS[maker](subject)
        except Exception as error:
            log.warning("%s cannot be generated: %s: %s", found.group(), type(error).__name__, error, location=page)
            return ""

    source[0] = GENERATED.sub(made, source[0])


def always_read(app: Any, env: Any, *_: Any) -> list[str]:
    """Pages with generated parts are read in every build: what they depend on is not in their files."""
    return [page for page in env.found_docs if GENERATED.search(env.doc2path(page).read_text(encoding="utf-8"))]
