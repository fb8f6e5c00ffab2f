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

from feeder_sim.jobs.folder import SCENARIO, WorkFolder
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.sweep.cases import Cases, Sweep, take_done
from feeder_sim.studies.sweep.question import Question
from feeder_sim.studies.sweep.table import as_csv, as_parquet

QUESTION, CSV, PARQUET, PICTURE = "sweep.toml", "sweep.csv", "sweep.parquet", "sweep.png"


def sweep_folder(
    path: Path, scenario: Scenario, question: Question, share: tuple[int, int] | None = None
) -> WorkFolder:
    """The folder of a sweep; arguments and errors as for `WorkFolder`."""
    return WorkFolder(path, QUESTION, question.as_toml(), scenario, share)


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
    cases = Cases.of(scenario, question, file=path / SCENARIO)
    others = take_done(cases, sorted(path.glob("journal*.jsonl")))
    complete = all(case.is_done(cases.effort) for case in cases)
    return Sweep(cases, complete, others), sweep_folder(path, scenario, question)
