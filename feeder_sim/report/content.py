"""What a study has of its own on its page, beside what the pages of all studies have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from feeder_sim.document.document import Block, Section, Text, Tile


@dataclass(frozen=True)
class Content:
    """Attributes:
    subtitle: a line below the title.
    sections: results.
    title: what it is, before the title of the scenario, where the name of the question does not say it.
    command: that asks it again, where that is not the question's own: its words after the name of the program.
    question: what was asked, beside the words of the question.
    tiles: the most important results.
    notices: what a reader has to know first.
    more: about the command, in words.
    """

    subtitle: str
    sections: tuple[Section, ...]
    title: str = ""
    command: Sequence[str] = ()
    question: tuple[Block, ...] = ()
    tiles: tuple[Tile, ...] = ()
    notices: tuple[Text, ...] = ()
    more: str = ""
