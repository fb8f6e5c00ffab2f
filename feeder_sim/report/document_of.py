"""What a folder holds, a run or a study, as a document."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from feeder_sim.document.document import Block, Document, Section, Table, Text
from feeder_sim.document.words import headed, sentence, worded
from feeder_sim.errors import InputError, path_of_user
from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.notebook import cell
from feeder_sim.records.files import SCENE
from feeder_sim.report.content import Content
from feeder_sim.report.provenance import foot, repeated
from feeder_sim.report.run_report import run_document
from feeder_sim.report.scenario_tables import scenario_blocks
from feeder_sim.report.search_report import search_content
from feeder_sim.report.sweep_report import sweep_content
from feeder_sim.report.uncertainty_report import uncertainty_content
from feeder_sim.scenario import load_scenario
from feeder_sim.studies.ask import KINDS, kind_of, open_study
from feeder_sim.studies.question import Question
from feeder_sim.studies.study import Study, text_of

# A question asked of many runs as a page: what was asked, pictures, tables, warnings, and how to repeat it.
#
# A sweep, uncertain inputs and a search have content of their own; any other study shows its table and what it says of
# itself.

CONTENTS: dict[str, Callable[[Any, Path], Content]] = {
    "sweep": sweep_content,
    "uncertainty": uncertainty_content,
    "optimise": search_content,
}
MOST_ROWS = 3000  # of a table; more would make the page too large to mail


def study_document(folder: Path) -> Document:
    """The page of a question.

    Raises:
        InputError: the folder cannot be read.
    """
    kind = kind_of(folder)
    assert kind is not None
    question, study = kind.read(folder), open_study(folder)
    scenario, text = load_scenario(folder / SCENARIO), text_of(folder / SCENARIO)
    content = CONTENTS.get(kind.kind, _plain)(study, folder)
    remarks = tuple(Text(sentence(line.text), line.tone) for line in study.remarks())
    command = content.command or question.command(folder / SCENARIO)
    files = tuple(name for name in study.files(lambda _: "") if (folder / name).is_file())
    sections = (
        Section("What was asked", (*content.question, _question_table(question))),
        *content.sections,
        Section("Warnings", remarks or (Text("None known."),)),
        Section("The scenario", scenario_blocks(scenario, text)),
        Section(
            "How to repeat it",
            repeated(folder, command, (kind.file, *files), content.more),
        ),
    )
    return Document(
        title=f"{content.title or kind.kind.capitalize()}: {scenario.title or folder.resolve().name}",
        subtitle=content.subtitle,
        tiles=content.tiles,
        notices=content.notices,
        sections=tuple(section for section in sections if section.blocks),
        foot=foot(),
        data=study.as_json(),
    )


def _question_table(question: Question) -> Table:
    """The words of the question."""
    fields = question.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    rows = tuple((headed(name), worded(value)) for name, value in fields.items() if value not in (False, [], 0, ""))
    return Table("", ("what", "how"), rows)


def _plain(study: Study, folder: Path) -> Content:
    rows = study.table()[:MOST_ROWS]
    head = tuple(rows[0]) if rows else ()
    table = Table("", head, tuple(tuple(cell(row[name]) for name in head) for row in rows))
    results: tuple[Block, ...] = (*study.figures(study.measure()), Text("\n".join(study.lines()), "code"))
    return Content(
        subtitle=f"{study.size}{'' if study.complete else ', not complete'}.",
        sections=(Section("Results", results), Section("All values", (table,))),
    )


def document_of(
    folder: str | Path,
    *,
    screenshot: bool = False,
    replay: bool = False,
    progress: Callable[[float], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> Document:
    """A run, or a question asked of many runs, as a document: `html()` is a page, `text()` for a terminal.

    A notebook shows it as it is.

    Args:
        folder: of the run, or of the question; of a run also a file that `export` made of it.
        screenshot: also take a picture of the replay, which takes seconds; of a run.
        replay: the page of a run also plays the replay of its first seed, which adds one or two megabytes.
        progress: called with the fraction done.
        notify: takes a line for the user, such as that there is no graphics driver.

    Raises:
        InputError: the folder holds neither, or cannot be read, or a study has no replay to take a picture of.
    """
    path = path_of_user(folder, "folder")
    if not path.exists():
        raise InputError("no such folder", file=path)
    if kind := kind_of(path):
        if screenshot:
            problem = f"is not allowed for the folder of {kind.kind}, which keeps no recordings"
            raise InputError(problem, file=path, argument="screenshot")
        return study_document(path)
    if not (path / SCENE).is_file() and not (path.suffix == ".h5" and path.is_file()):
        allowed = f"a folder that holds {', '.join((SCENE, *(kind.file for kind in KINDS.values())))}"
        raise InputError(f"is no run and no question of many runs, must be {allowed}", file=path)
    return run_document(path, with_screenshot=screenshot, with_replay=replay, progress=progress, notify=notify)
