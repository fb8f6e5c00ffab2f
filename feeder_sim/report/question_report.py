"""The report of a question of many runs, whichever it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from feeder_sim.report.page import Page
from feeder_sim.report.search_report import search_page
from feeder_sim.report.sweep_report import sweep_page
from feeder_sim.report.uncertainty_report import uncertainty_page
from feeder_sim.studies.kinds import kind_of

PAGES = {"sweep": sweep_page, "uncertainty": uncertainty_page, "optimise": search_page}


def question_page(folder: Path, *, progress: Callable[[float], None] | None = None) -> Page:
    """The page of a question; `progress` is called with the fraction done.

    Raises:
        InputError: the folder cannot be read.
    """
    kind = kind_of(folder)
    assert kind is not None
    return PAGES[kind.kind](folder, progress=progress)
