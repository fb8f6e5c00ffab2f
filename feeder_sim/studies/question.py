"""What is asked of many runs: a table whose fields are keys of a file, options of a command and arguments in Python.

Limits stand in the fields, and nowhere else.
"""

from __future__ import annotations

import tomllib
from abc import abstractmethod
from collections.abc import Collection
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

from feeder_sim.errors import InputError, option_of
from feeder_sim.jobs.ledger import Ledger
from feeder_sim.jobs.runner import Runner
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import Table, validated
from feeder_sim.studies.study import Study


class Question(Table):
    """A question of many runs.

    Attributes:
        kind: the command that asks it.
        file: that says in a folder what was asked, and tells folders of this kind.
        base: folder in which folders of this kind are made.
        own: other files that the work itself writes before any seed is done.
    """

    kind: ClassVar[str]
    file: ClassVar[str]
    base: ClassVar[str]
    own: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(cls, **arguments: Any) -> Self:
        """From arguments; None for one that is not given.

        Raises:
            InputError: a value is not allowed; it names the argument.
        """
        try:
            return validated({name: value for name, value in arguments.items() if value is not None}, cls, Path())
        except InputError as error:
            raise InputError(error.problem, argument=error.key) from None

    @property
    @abstractmethod
    def same(self) -> str:
        """What makes it this question: other words of it, as the number of seeds, may change in its folder."""

    def settled(self, scenario: Scenario) -> Self:
        """The question with what it takes from the scenario."""
        return self

    @abstractmethod
    def plan(self, scenario: Scenario, file: Path) -> Plan:
        """What there is to run; `file` names the scenario in messages.

        Raises:
            InputError: the scenario does not suit, or a key or a value is not allowed.
        """

    def command(self, scenario: Path) -> list[str]:
        """The command that asks it of a scenario file: its words after the name of the program."""
        words = [self.kind, str(scenario)]
        for name, value in self.model_dump(mode="json", exclude_defaults=True).items():
            for each in value if isinstance(value, list) else [value]:
                text = f"{each:g}{'s' if name.endswith('_s') else ''}" if isinstance(each, float) else str(each)
                words += [option_of(name), *([] if each is True else [text])]
        return words

    def as_toml(self) -> str:
        """As a text that `read` takes."""
        import tomli_w

        return tomli_w.dumps(self.model_dump(mode="json", exclude_none=True))

    @classmethod
    def read(cls, folder: Path) -> Self:
        """From its folder.

        Raises:
            InputError: the file is missing or holds no such question.
        """
        path = folder / cls.file
        try:
            raw = tomllib.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError as error:
            raise InputError(f"no such file, must be the folder of {cls.kind}", file=path) from error
        except (OSError, ValueError) as error:
            raise InputError(f"holds no question of {cls.kind}: {error}", file=path) from error
        return validated(raw, cls, path)


class Plan(Protocol):
    """What there is to run for a question."""

    def take(self, ledger: Ledger, *, recorded: bool = False) -> None:
        """Let what is done already count; recorded: whatever version has run it, to open a study."""
        ...

    @property
    def all_done(self) -> bool:
        """Whether there is nothing left to run, as far as is known."""
        ...

    @property
    def identities(self) -> Collection[str] | None:
        """Of the scenarios whose seeds count; None where they are not known before."""
        ...

    def part(self, number: int, of: int) -> Plan:
        """What one task of a job array does: every n-th point from a number on, which counts from 1."""
        ...

    def run(self, runner: Runner) -> bool:
        """Run what is not done; returns whether it came to the end, and was not stopped."""
        ...

    def study(self, complete: bool, foreign_seeds: int) -> Study:
        """What there is by now; foreign_seeds: seeds in the folder that do not count."""
        ...
