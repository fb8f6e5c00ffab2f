"""The folder of a sweep: what was asked, a journal of what is done, the table.

sweep.toml          what was asked
scenario.toml       the scenario that was varied, with all its defaults
journal.jsonl       measures of every seed that is done; of job arrays one per task, journal-I-of-N.jsonl
sweep.csv           the table, see `feeder_sim.studies.sweep.table`
sweep.parquet       the same
sweep.json          whether that is all of it, and cautions
sweep.png           a picture of one measure
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from feeder_sim.errors import InputError
from feeder_sim.jobs.folder import SCENARIO, WorkFolder, usual_folder
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.sweep.cases import Cases, Sweep, take_done
from feeder_sim.studies.sweep.question import Question
from feeder_sim.studies.sweep.table import as_csv, as_parquet

QUESTION, CSV, PARQUET, PICTURE = "sweep.toml", "sweep.csv", "sweep.parquet", "sweep.png"
STATE = "sweep.json"
SWEEPS = Path("sweeps")
# Why seeds in a journal do not count.
OTHERS = "of other points, of another version, or of files that have changed"


def sweep_folder(
    path: Path | None, name: str, scenario: Scenario, question: Question, share: tuple[int, int] | None = None
) -> WorkFolder:
    """The folder of a sweep: a given one, or one below `SWEEPS` by a name; the rest as for `WorkFolder`."""
    path = path or usual_folder(SWEEPS, name, QUESTION, scenario, question.same)
    return WorkFolder(path, QUESTION, question.as_toml(), scenario, same=question.same, share=share)


def not_counted(others: int) -> str:
    """A line about seeds in a folder that are done, and are run anew all the same."""
    return f"{others} seeds in the folder do not count: they are {OTHERS}"


def write_table(folder: WorkFolder, sweep: Sweep) -> None:
    """Write the table in place of the one before; nothing of a sweep of which nothing is done."""
    if not sweep.rows:
        return
    folder.write(CSV, as_csv(sweep.keys, sweep.rows, uncertain=sweep.uncertain).encode())
    folder.write(PARQUET, as_parquet(sweep.keys, sweep.rows, uncertain=sweep.uncertain))
    folder.write(STATE, json.dumps(state_of(sweep), indent=1).encode())


def state_of(sweep: Sweep) -> dict[str, Any]:
    """What is to be known beside the table, as JSON takes it."""
    return {
        "complete": sweep.complete,
        "missing_seeds": sweep.missing,
        "points_short_of_se": sweep.short,
        "cautions": [caution.as_dict() for caution in sweep.cautions],
    }


def merged(path: Path) -> tuple[Sweep, WorkFolder]:
    """A sweep out of all journals of its folder, as the tasks of a job array leave them.

    Raises:
        InputError: there is no sweep in the folder, or no seed of it.
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
    if not any(case.done for case in cases):
        why = f"; {others} in the journals are {OTHERS}" if others else ""
        problem = f"holds no seed of the sweep, allowed is a folder with journal*.jsonl of its tasks{why}"
        raise InputError(problem, file=path)
    return Sweep(cases, cases.all_done, others), folder
