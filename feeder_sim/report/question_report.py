"""The report of a question of many runs, whichever it is: folders tell it by the file that says what was asked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from feeder_sim.report.page import Page
from feeder_sim.report.search_report import search_page
from feeder_sim.report.sweep_report import sweep_page
from feeder_sim.report.uncertainty_report import uncertainty_page
from feeder_sim.studies.search import results
from feeder_sim.studies.sweep import folder as sweep
from feeder_sim.studies.uncertainty import propagate

# By the file that says what was asked, the command that has made the folder.
QUESTIONS = {sweep.QUESTION: "sweep", propagate.QUESTION: "uncertainty", results.QUESTION: "optimise"}
PAGES = {"sweep": sweep_page, "uncertainty": uncertainty_page, "optimise": search_page}


def kind_of(folder: Path) -> str:
    """The command that has made a folder; "" where it holds no question."""
    return next((kind for name, kind in QUESTIONS.items() if (folder / name).is_file()), "")


def question_page(kind: str, folder: Path, *, progress: Callable[[float], None] | None = None) -> Page:
    """The page of a question; `progress` is called with the fraction done.

    Raises:
        InputError: the folder cannot be read.
    """
    return PAGES[kind](folder, progress=progress)
