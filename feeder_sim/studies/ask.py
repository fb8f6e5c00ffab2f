"""A question of many runs, asked: what is done in its folder counts, the rest is run, and the answer is written."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError, path_of_user
from feeder_sim.jobs.folder import JOURNAL, SCENARIO, WorkFolder, usual_folder
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import FOREIGN, Runner
from feeder_sim.measures.function import identity_of_measures
from feeder_sim.measures.protocol import Measure
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import workers_of
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.budget import BudgetQuestion
from feeder_sim.studies.calibration.calibrate import CalibrateQuestion
from feeder_sim.studies.chart.chart import ChartQuestion
from feeder_sim.studies.question import Question
from feeder_sim.studies.search.optimise import OptimiseQuestion
from feeder_sim.studies.speed_map import MapQuestion
from feeder_sim.studies.study import Study
from feeder_sim.studies.sweep.sweep import SweepQuestion
from feeder_sim.studies.uncertainty.uncertainty import UncertaintyQuestion

# All questions of many runs, by the command that asks them, and which of them a folder holds.

_ALL: tuple[type[Question], ...] = (
    SweepQuestion,
    UncertaintyQuestion,
    OptimiseQuestion,
    MapQuestion,
    ChartQuestion,
    CalibrateQuestion,
    BudgetQuestion,
)
KINDS = {kind.kind: kind for kind in _ALL}


def kind_of(folder: Path) -> type[Question] | None:
    """What a folder holds; None where it holds no question."""
    return next((kind for kind in _ALL if (folder / kind.file).is_file()), None)


def folder_of(
    question: Question,
    scenario: Scenario,
    out: Path | None,
    *,
    name: str = "",
    share: tuple[int, int] | None = None,
) -> WorkFolder:
    """The folder of a question: a given one, or else one at the usual place by a name.

    Raises:
        InputError: it holds something else, or another question.
    """
    question = question.settled(scenario)
    path = out or usual_folder(Path(question.base), name, question.file, scenario, question.same)
    request = question.as_toml()
    return WorkFolder(path, question.file, request, scenario, same=question.same, share=share, own=question.own)


def ask(
    question: Question,
    scenario: Scenario,
    folder: WorkFolder | None = None,
    *,
    file: Path = Path("scenario"),
    share: tuple[int, int] | None = None,
    measures: tuple[Measure[Any, Any], ...] = (),
    work: Work,
) -> Study:
    """Answer a question.

    Args:
        question: what is asked.
        scenario: what it is asked of.
        folder: of the question; without one nothing is written.
        file: names the scenario in messages.
        share: number and how many, of a task of a job array, which leaves the table to `merge`.
        measures: that are taken besides those of the package; other ones, and seeds in the folder do not count.
        work: runs the seeds; where it is stopped, what there is then is returned.

    Raises:
        InputError: the scenario does not suit, a key or a value is not allowed, or there is no such measure.
        RecordingFailed: the folder cannot be written.
    """
    plan = question.settled(scenario).plan(scenario, file)
    identity = identity_of_measures(measures)
    ledger = Ledger(folder.journals, folder.journal, identity) if folder else Ledger()
    plan.take(ledger)
    foreign_seeds = ledger.foreign(plan.identities)
    plan = plan.part(*share) if share else plan
    path = folder.path if folder else None
    with contextlib.ExitStack() as stack:
        runner = Runner(stack.enter_context(workers_of(work)), work, ledger, path, measures)
        if foreign_seeds and not plan.all_done:
            runner.notify_foreign(foreign_seeds)
        if folder:
            stack.enter_context(folder)  # last: what is refused before leaves the question in it as it was
        stack.enter_context(ledger)
        study = plan.study(plan.run(runner), foreign_seeds)
        if folder and share is None:
            write_study(study, folder)
    return study


def write_study(study: Study, folder: WorkFolder, measure: str | None = None) -> None:
    """Write the tables and the picture of a study in place of those before; nothing where nothing is done.

    Raises:
        InputError: there is no such measure to draw.
        RecordingFailed: a file cannot be written.
    """
    measure = study.measure(measure)
    for name, content in study.files(folder.carried).items():
        folder.write(name, content)
    study.draw(folder.path, measure)


def merged(path: Path, measure: str | None = None) -> Study:
    """A study out of all journals of its folder, as the tasks of a job array leave them; its table is written.

    Raises:
        InputError: there is no study in the folder, or no seed of it.
    """
    kind = kind_of(path) or SweepQuestion
    question, scenario = kind.read(path), load_scenario(path / SCENARIO)
    try:
        folder = folder_of(question, scenario, path)
    except InputError as error:
        problem = f"{SCENARIO} is no longer that of the {kind.kind}, must be the one that it began with"
        raise InputError(problem, file=path) from error
    plan, ledger = question.plan(scenario, path / SCENARIO), Ledger(folder.journals)
    plan.take(ledger)
    foreign_seeds = ledger.foreign(plan.identities)
    if len(ledger) == foreign_seeds:
        why = f"; {foreign_seeds} in the journals are {FOREIGN}" if foreign_seeds else ""
        problem = f"holds no seed of the {kind.kind}, must be a folder with journal*.jsonl of its tasks{why}"
        raise InputError(problem, file=path)
    study = plan.study(plan.all_done, foreign_seeds)
    with folder:
        write_study(study, folder, measure)
    return study


def resume_study(path: Path, work: Work) -> Study:
    """Go on with the question in a folder, as it was asked there.

    Raises:
        InputError: a file of it cannot be read, or the folder is in use.
        RecordingFailed: the folder cannot be written.
    """
    question, scenario = _question_in(path), load_scenario(path / SCENARIO)
    return ask(question, scenario, folder_of(question, scenario, path), file=path / SCENARIO, work=work)


def _question_in(path: Path) -> Question:
    """The question that a folder holds.

    Raises:
        InputError: it holds none, or one that cannot be read.
    """
    kind = kind_of(path)
    if kind is None:
        allowed = ", ".join(kind.file for kind in KINDS.values())
        raise InputError(f"holds no question of many runs, must be a folder with one of {allowed}", file=path)
    return kind.read(path)


def open_study(folder: str | Path) -> Study:
    """The answer that a folder holds, as far as it has come; nothing is run.

    Raises:
        InputError: it holds no question of many runs, or a file of it cannot be read.
    """
    path = path_of_user(folder, "open_study")
    question, ledger = _question_in(path), Ledger(sorted(path.glob(f"{JOURNAL}*.jsonl")))
    if not len(ledger):
        raise InputError(f"holds no seed of the {question.kind} yet, feeder-sim resume goes on", file=path)
    file = path / SCENARIO
    plan = question.plan(load_scenario(file), file)
    plan.take(ledger, recorded=True)
    return plan.study(plan.all_done, 0)
