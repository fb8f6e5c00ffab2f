"""The folder of a sweep: what was asked, a journal of what is done, the table.

sweep.toml          what was asked
scenario.toml       the scenario that was varied, with all its defaults
journal.jsonl       measures of every seed that is done; of job arrays one per task, journal-I-of-N.jsonl
sweep.csv           the table, see `feeder_sim.studies.sweep.table`
sweep.parquet       the same
sweep.png           a picture of one measure
"""

from __future__ import annotations

from pathlib import Path

from feeder_sim.errors import InputError
from feeder_sim.jobs.folder import SCENARIO, WorkFolder, usual_folder
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.sweep.cases import Cases, Sweep, take_done
from feeder_sim.studies.sweep.question import Question
from feeder_sim.studies.sweep.table import as_csv, as_parquet

QUESTION, CSV, PARQUET, PICTURE = "sweep.toml", "sweep.csv", "sweep.parquet", "sweep.png"
SWEEPS = Path("sweeps")


def sweep_folder(
    path: Path | None, name: str, scenario: Scenario, question: Question, share: tuple[int, int] | None = None
) -> WorkFolder:
    """The folder of a sweep: a given one, or one below `SWEEPS` by a name; the rest as for `WorkFolder`."""
    path = path or usual_folder(SWEEPS, name, QUESTION, scenario, question.same)
    return WorkFolder(path, QUESTION, question.as_toml(), scenario, same=question.same, share=share)


def write_table(folder: WorkFolder, sweep: Sweep) -> None:
    """Write the table in place of the one before."""
    folder.write(CSV, as_csv(sweep.keys, sweep.rows, uncertain=sweep.uncertain).encode())
    folder.write(PARQUET, as_parquet(sweep.keys, sweep.rows, uncertain=sweep.uncertain))


def merged(path: Path) -> tuple[Sweep, WorkFolder]:
    """A sweep out of all journals of its folder, as the tasks of a job array leave them.

    Raises:
        InputError: there is no sweep in the folder.
    """
    question = Question.of_toml(path / QUESTION)
    scenario = load_scenario(path / SCENARIO)
    try:
        folder = WorkFolder(path, QUESTION, question.as_toml(), scenario, same=question.same)
    except InputError as error:
        problem = f"{SCENARIO} is no longer that of the sweep, allowed is the one that it began with"
        raise InputError(problem, file=path) from error
    cases = Cases.of(scenario, question, file=path / SCENARIO)
    others = take_done(cases, folder.journals)
    complete = all(case.is_done(cases.effort) for case in cases)
    return Sweep(cases, complete, others), folder
