"""What the folders of all questions of many runs have in common: which one it is, and how its files are read back."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from feeder_sim.errors import InputError, cause_of, quoted
from feeder_sim.jobs.folder import SCENARIO
from feeder_sim.scenario import Scenario, load_scenario

Line = Mapping[str, str | None]  # of a table, by column
Row = TypeVar("Row")


def scenario_of(folder: Path, others: Sequence[str]) -> tuple[Scenario, str]:
    """The scenario of a question, and its text; links in place of it or of other files are refused.

    Raises:
        InputError: a file is a link, or the scenario cannot be read.
    """
    for name in (SCENARIO, *others):
        if (folder / name).is_symlink():
            raise InputError("is a link, allowed is a file of the folder itself", file=folder / name)
    return load_scenario(folder / SCENARIO), text_of(folder / SCENARIO)


class TableFile:
    """A table of a folder.

    Attributes:
        head: names of the columns.

    Raises:
        InputError: it is missing or cannot be read.
    """

    def __init__(self, file: Path) -> None:
        if not file.is_file():
            raise InputError("is missing: nothing has come so far, the same command goes on", file=file)
        self._file, self._reader = file, csv.DictReader(text_of(file).splitlines())
        try:
            self.head = tuple(self._reader.fieldnames or ())
        except csv.Error as error:
            raise InputError(f"is no table: {error}", file=file) from error

    def refused(self, allowed: str) -> InputError:
        """The error that says which columns it may have."""
        return InputError(f"has the columns {quoted(', '.join(self.head))}, allowed is {allowed}", file=self._file)

    def rows(self, row_of: Callable[[Line], Row]) -> tuple[Row, ...]:
        """All rows, each made of a line; a ValueError or a TypeError says that the line is none.

        Raises:
            InputError: a line is not as it has to be.
        """
        found = []
        try:
            for number, line in enumerate(self._reader, 2):
                try:
                    found.append(row_of(line))
                except (ValueError, TypeError, OverflowError):
                    problem = f"line {number} is {quoted(list(line.values()))}, allowed are numbers"
                    raise InputError(problem, file=self._file) from None
        except csv.Error as error:
            raise InputError(f"is no table: {error}", file=self._file) from error
        return tuple(found)


def number_in(text: str | None) -> float:
    """A number; NaN for an empty field, and for what is not finite. Where the line ends before, it is none."""
    if text is None:
        raise ValueError("no field")
    value = float(text) if text else math.nan
    return value if math.isfinite(value) else math.nan


def value_in(text: str | None) -> float | str:
    """The value of a key: a number where it is one."""
    try:
        return float(text or "")
    except ValueError:
        return text or ""


def text_of(file: Path) -> str:
    """The text of a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=file) from error
