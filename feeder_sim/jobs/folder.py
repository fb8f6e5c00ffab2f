"""A folder with what was asked, a journal of what is done, and what came out; one process at a time works in it.

The tasks of a job array share a folder: each has a journal and a lock of its own.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import re
import shutil
from pathlib import Path
from types import TracebackType
from typing import Self

from feeder_sim.errors import InputError, not_written
from feeder_sim.jobs.ledger import read_journal
from feeder_sim.records.files import INPUTS, holding
from feeder_sim.run.provenance import content_text
from feeder_sim.run.run_folder import carry_files, scenario_toml
from feeder_sim.scenario import Scenario
from feeder_sim.whole_files import write_whole

SCENARIO, JOURNAL, LOCK = "scenario.toml", "journal", ".lock"
WRITING = f"{LOCK}-question"  # held while the question is written
WAIT_S = 30.0  # [s] for another task that writes the same question
_LEFTOVERS = re.compile(r"\.lock(-[a-z0-9-]+)?|.*\.partial")
_IDENTITY_PREFIX = "# question "


class WorkFolder:
    """The folder of a question; as a context it is held by this process.

    A question that is refused in the context before any seed is done, as one for a measure that there is not, leaves
    nothing behind: the corrected one is another question, and would be refused in its folder.

    Args:
        path: made if missing; new, empty, or that of the same question. What is done in it counts as far as it is of
            the same scenarios.
        kind: name of the file that says what was asked, such as sweep.toml; it tells folders of this kind.
        question: what that file holds.
        scenario: that the question is about.
        same: what has to be the same for this to be the same question; the scenario is, too. Other words of the
            question, as the number of seeds, may change.
        share: number and how many, of a job array, whose tasks work in one folder.
        own: names of files that the work itself writes there before any seed is done.

    Raises:
        InputError: the folder holds something else, or another question.
    """

    def __init__(
        self,
        path: Path,
        kind: str,
        question: str,
        scenario: Scenario,
        *,
        same: str = "",
        share: tuple[int, int] | None = None,
        own: tuple[str, ...] = (),
    ) -> None:
        self._written = (kind, SCENARIO, *own)
        self._foreign_locks = tuple(f"{name}.lock" for name in own)  # links by which Optuna locks its journal
        self.path, self._kind, self._scenario = path, kind, scenario
        self._text = f"{identity_line(scenario, same)}\n{question}"
        suffix = f"-{share[0]}-of-{share[1]}" if share else ""
        self.journal = path / f"{JOURNAL}{suffix}.jsonl"
        self._lock = path / f"{LOCK}{suffix}"
        check_work_folder(path, kind)
        self._check_identity()
        self._context = contextlib.ExitStack()
        self._shared, self._is_new = share is not None, False
        self._new_folders: list[Path] = []  # folders that were not there, innermost first

    @property
    def journals(self) -> list[Path]:
        """All journals in the folder, those of other tasks too."""
        return sorted(self.path.glob(f"{JOURNAL}*.jsonl"))

    def __enter__(self) -> Self:
        """Hold the folder and write what is asked.

        Raises:
            InputError: another process works on the same share, or has asked something else meanwhile.
            RecordingFailed: it cannot be written.
        """
        self._new_folders = [folder for folder in (self.path, *self.path.parents) if not folder.exists()]
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise not_written(self.path, error) from error
        check_no_links(self.path, self._foreign_locks)
        self._context.enter_context(holding(self._lock))
        for name in self._foreign_locks:  # nobody else works here: a kill has left it
            (self.path / name).unlink(missing_ok=True)
        with holding(self.path / WRITING, WAIT_S):
            self._check_identity()
            self._is_new = not (self.path / self._kind).exists()
            self._write_changed(self._kind, self._text)  # first: it tells that the folder is ours
            self._write_changed(SCENARIO, self.carried(self._scenario))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Other tasks of a job array may work in the folder by now; their question does not hang on the measure.
        remove = isinstance(error, InputError) and self._is_new and not self._shared and self._holds_failures_alone()
        if remove:
            self._remove_written()
        self._context.close()
        if remove:
            self._lock.unlink(missing_ok=True)
            for folder in self._new_folders:
                with contextlib.suppress(OSError):  # something else is in it
                    folder.rmdir()

    def _holds_failures_alone(self) -> bool:
        """Whether no seed has come to anything: those that cannot be run do not tell which measures there are."""
        return all(entry.get("failure") for journal in self.journals for entry in read_journal(journal))

    def _remove_written(self) -> None:
        """Remove what was written since the question began; what a user has put there meanwhile stays."""
        for file in (*(self.path / name for name in self._written), *self.journals, self.path / WRITING):
            with contextlib.suppress(OSError):
                file.unlink()
        shutil.rmtree(self.path / INPUTS, ignore_errors=True)

    def carried(self, scenario: Scenario) -> str:
        """The text of a scenario for this folder, which gets copies of the files that it reads.

        Raises:
            RecordingFailed, InputError: as for `carry_files`.
        """
        return scenario_toml(carry_files(scenario, self.path))

    def write(self, name: str, content: bytes) -> None:
        """Write a file in place of the one before.

        Raises:
            RecordingFailed: it cannot be written.
        """
        write_whole(self.path / name, content)

    def _write_changed(self, name: str, text: str) -> None:
        file = self.path / name
        if not file.is_file() or file.read_bytes() != text.encode():
            write_whole(file, text.encode())

    def _check_identity(self) -> None:
        """Refuse the folder of another question."""
        identity = _identity_in(self.path / self._kind)
        if identity is not None and identity != self._text.partition("\n")[0]:
            problem = f"holds another question ({self._kind}), must be a new folder or that of the same question"
            raise InputError(problem, file=self.path, argument="out")


def usual_folder(base: Path, name: str, kind: str, scenario: Scenario, same: str = "") -> Path:
    """The first of BASE/NAME, BASE/NAME-2, ... that is free or has the same question; arguments as for `WorkFolder`."""
    identity = identity_line(scenario, same)
    for number in itertools.count(1):
        folder = base / (name if number == 1 else f"{name}-{number}")
        if not folder.exists() or _identity_in(folder / kind) == identity:
            return folder
    raise AssertionError("unreachable")


def identity_line(scenario: Scenario, same: str) -> str:
    """The first line of the file that says what was asked."""
    text = content_text([scenario.model_dump(exclude={"title": True, "format": True, "run": {"seeds"}}), same])
    return f"{_IDENTITY_PREFIX}{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _identity_in(file: Path) -> str | None:
    """The mark of the question in a file; None without one."""
    try:
        with file.open(encoding="utf-8") as lines:
            return lines.readline().rstrip("\n")
    except (OSError, UnicodeDecodeError):
        return None


def check_work_folder(path: Path, kind: str) -> None:
    """Refuse a folder that holds anything but a question of a kind.

    Raises:
        InputError: as said.
    """
    if path.exists() and not path.is_dir():
        raise InputError("is not a folder", file=path, argument="out")
    names = sorted(entry.name for entry in path.iterdir()) if path.exists() else []
    foreign = [name for name in names if not _LEFTOVERS.fullmatch(name)]
    if kind not in names and foreign:
        problem = f"holds {foreign[0]} and no {kind}, must be a new folder or one that has it"
        raise InputError(problem, file=path, argument="out")


def check_no_links(path: Path, allowed: tuple[str, ...] = ()) -> None:
    """Refuse a folder with links in it, but for names that are allowed: they would be written to elsewhere.

    Raises:
        InputError: as said.
    """
    for entry in sorted(path.iterdir()):
        if entry.is_symlink() and entry.name not in allowed:
            raise InputError("is a link, must be a file of the folder itself", file=entry)
