"""The folder of a sweep: what was asked, a journal of what is done, the table.

sweep.toml          what was asked
scenario.toml       the scenario that was varied, with all its defaults
journal.jsonl       measures of every seed that is done; of job arrays one per task, journal-I-of-N.jsonl
sweep.csv           the table, see `feeder_sim.studies.sweep.table`
sweep.parquet       the same
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from feeder_sim.errors import InputError, not_written
from feeder_sim.records.whole_file import write_whole
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.studies.sweep.cases import Cases, Sweep, take_done
from feeder_sim.studies.sweep.question import Question
from feeder_sim.studies.sweep.table import as_csv, as_parquet

QUESTION, SCENARIO, CSV, PARQUET, PICTURE = "sweep.toml", "scenario.toml", "sweep.csv", "sweep.parquet", "sweep.png"
_OWN = (QUESTION, SCENARIO, CSV, PARQUET, PICTURE)


class SweepFolder:
    """The folder, held by this process while it works on its share.

    Args:
        path: made if missing; new, empty, or that of a sweep, whose done seeds count as far as they are of the same
            scenarios.
        scenario: that is varied.
        question: what is asked.
        task: number and how many, of a job array.

    Raises:
        InputError: the folder holds something else, or another process works on the same share.
        RecordingFailed: it cannot be written.
    """

    def __init__(self, path: Path, scenario: Scenario, question: Question, task: tuple[int, int] | None = None) -> None:
        from filelock import FileLock

        check_sweep_folder(path)
        self.path, self._scenario, self._question = path, scenario, question
        share = f"-{task[0]}-of-{task[1]}" if task else ""
        self.journal = path / f"journal{share}.jsonl"
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise not_written(path, error) from error
        self._lock = FileLock(path / f".lock{share}", timeout=0)

    def __enter__(self) -> Self:
        from filelock import Timeout

        try:
            self._lock.acquire()
        except Timeout:
            problem = "is in use, allowed is one process that works on a sweep at a time"
            raise InputError(problem, file=self.path, key="--out") from None
        write_whole(self.path / SCENARIO, scenario_toml(self._scenario).encode())
        write_whole(self.path / QUESTION, self._question.as_toml().encode())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def write(self, sweep: Sweep) -> None:
        """Write the table in place of the one before."""
        csv = as_csv(sweep.keys, sweep.rows, uncertain=sweep.uncertain)
        write_whole(self.path / CSV, csv.encode())
        write_whole(self.path / PARQUET, as_parquet(sweep.keys, sweep.rows, uncertain=sweep.uncertain))


def check_sweep_folder(path: Path) -> None:
    """Refuse a folder that holds anything but a sweep.

    Raises:
        InputError: as said.
    """
    if path.exists() and not path.is_dir():
        raise InputError("is not a folder", file=path, key="--out")
    held = sorted(entry.name for entry in path.iterdir()) if path.exists() else []
    if held and QUESTION not in held and not all(name.startswith((".lock", *_OWN)) for name in held):
        raise InputError(f"holds {held[0]}, allowed is a new folder or that of a sweep", file=path, key="--out")


def merged(path: Path) -> tuple[Sweep, SweepFolder]:
    """A sweep out of all journals of its folder, as the tasks of a job array leave them.

    Raises:
        InputError: there is no sweep in the folder.
    """
    question = Question.of_toml(path / QUESTION)
    scenario = load_scenario(path / SCENARIO)
    cases = Cases.of(scenario, question, file=path / SCENARIO)
    take_done(cases, sorted(path.glob("journal*.jsonl")))
    complete = all(case.is_done(cases.effort) for case in cases)
    return Sweep(cases, complete), SweepFolder(path, scenario, question)
