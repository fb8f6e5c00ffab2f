"""The report of a question of many runs, whichever it is."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.notebook import cell
from feeder_sim.report.page import Block, Page, Section, Table, Text
from feeder_sim.report.pictures import picture_from
from feeder_sim.report.provenance import foot, repeated
from feeder_sim.report.scenario_tables import scenario_blocks
from feeder_sim.report.search_report import search_page
from feeder_sim.report.sweep_report import sweep_page
from feeder_sim.report.uncertainty_report import uncertainty_page
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.ask import open_study
from feeder_sim.studies.kinds import kind_of
from feeder_sim.studies.study import Study, text_of

PAGES = {"sweep": sweep_page, "uncertainty": uncertainty_page, "optimise": search_page}  # others have a plain one
MOST_ROWS = 3000  # of a table; more would make the page too large to mail


def question_page(folder: Path, *, progress: Callable[[float], None] | None = None) -> Page:
    """The page of a question; `progress` is called with the fraction done.

    Raises:
        InputError: the folder cannot be read.
    """
    kind = kind_of(folder)
    assert kind is not None
    if kind.kind in PAGES:
        return PAGES[kind.kind](folder, progress=progress)
    question, study = kind.read(folder), open_study(folder)
    scenario, text = load_scenario(folder / SCENARIO), text_of(folder / SCENARIO)
    files = tuple(study.files(lambda _: ""))
    sections = (
        Section("Results", (*_picture(study), Text("\n".join(study.lines()), "code"))),
        Section("All values", (_table(study),)),
        Section("Cautions", tuple(Text(line, "caution") for line in study.remarks())),
        Section("The scenario", scenario_blocks(scenario, text)),
        Section("How to repeat it", repeated(folder, question.command(folder / SCENARIO), (kind.file, *files))),
    )
    return Page(
        title=f"{kind.kind.capitalize()}: {scenario.title or folder.resolve().name}",
        subtitle=f"{study.size}{'' if study.complete else ', not complete'}.",
        tiles=(),
        notices=(),
        sections=tuple(section for section in sections if section.blocks),
        foot=foot(),
    )


def _picture(study: Study) -> tuple[Block, ...]:
    """What it draws into its folder."""
    with tempfile.TemporaryDirectory() as made:
        study.draw(Path(made), study.measure())
        drawn = sorted(Path(made).glob("*.png"))
        name = study.measure()
        return tuple(picture_from(file, alt=f"{name}, {study.size}", caption=name) for file in drawn)


def _table(study: Study) -> Table:
    rows = study.table()[:MOST_ROWS]
    head = tuple(rows[0]) if rows else ()
    return Table("All values", head, tuple(tuple(cell(row[name]) for name in head) for row in rows))
