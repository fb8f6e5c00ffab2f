"""A folder with what was asked, a journal of what is done, and what came out; one process at a time works in it."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from feeder_sim.errors import InputError, not_written
from feeder_sim.records.whole_file import write_whole
from feeder_sim.run.run_folder import scenario_toml
from feeder_sim.scenario import Scenario

SCENARIO, JOURNAL, LOCK = "scenario.toml", "journal", ".lock"


class WorkFolder:
    """The folder of a question; as a context it is held by this process.

    Args:
        path: made if missing; new, empty, or that of a question of the same kind. What is done in it counts as far as
            it is of the same scenarios.
        kind: name of the file that says what was asked, such as sweep.toml; it tells folders of this kind.
        question: what that file holds.
        scenario: that the question is about.
        share: number and how many, of a job array, whose tasks work in one folder.

    Raises:
        InputError: the folder holds something else.
        RecordingFailed: it cannot be made.
    """

    def __init__(
        self, path: Path, kind: str, question: str, scenario: Scenario, share: tuple[int, int] | None = None
    ) -> None:
        from filelock import FileLock

        check_work_folder(path, kind)
        self.path, self._kind, self._question, self._scenario = path, kind, question, scenario
        suffix = f"-{share[0]}-of-{share[1]}" if share else ""
        self.journal = path / f"{JOURNAL}{suffix}.jsonl"
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise not_written(path, error) from error
        self._lock = FileLock(path / f"{LOCK}{suffix}", timeout=0)

    def __enter__(self) -> Self:
        from filelock import Timeout

        try:
            self._lock.acquire()
        except Timeout:
            raise InputError("is in use, allowed is one process that works in it at a time", file=self.path) from None
        write_whole(self.path / SCENARIO, scenario_toml(self._scenario).encode())
        write_whole(self.path / self._kind, self._question.encode())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def write(self, name: str, content: bytes) -> None:
        """Write a file in place of the one before.

        Raises:
            RecordingFailed: it cannot be written.
        """
        write_whole(self.path / name, content)


def check_work_folder(path: Path, kind: str) -> None:
    """Refuse a folder that holds anything but a question of a kind.

    Raises:
        InputError: as said.
    """
    if path.exists() and not path.is_dir():
        raise InputError("is not a folder", file=path, key="--out")
    held = sorted(entry.name for entry in path.iterdir()) if path.exists() else []
    foreign = [name for name in held if not name.startswith((LOCK, JOURNAL, SCENARIO, kind))]
    if kind not in held and foreign:
        problem = f"holds {foreign[0]} and no {kind}, allowed is a new folder or one that has it"
        raise InputError(problem, file=path, key="--out")
