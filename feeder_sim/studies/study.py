"""The answer to a question of many runs: a table, files in a folder, a picture, and what a notebook shows."""

from __future__ import annotations

import csv
import io
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from feeder_sim.document.document import Text
from feeder_sim.document.figure import Figure, save_figures
from feeder_sim.errors import InputError, cause_of
from feeder_sim.jobs.task import RepeatedWarning
from feeder_sim.notebook import library, table

if TYPE_CHECKING:
    import pandas

Record = Mapping[str, Any]  # of a table, by column, with units in the names of the columns; None for no value
Line = Mapping[str, str | None]  # of a table that is read
Row = TypeVar("Row")


BESIDE = 2  # figures in the picture of a folder


class Answer(ABC):
    """An answer whose main result is a table."""

    @abstractmethod
    def table(self) -> Sequence[Record]:
        """Its rows by column, with units in the names of the columns; None where there is no value."""

    @abstractmethod
    def _line(self) -> str:
        """What it is, in a line."""

    def _notebook_rows(self) -> Sequence[Record]:
        """The rows that a notebook shows."""
        return self.table()

    def to_frame(self) -> pandas.DataFrame:
        """The table as a pandas DataFrame, NaN where there is no value; the extra `data` brings pandas.

        Raises:
            InputError: pandas is missing.
        """
        rows = [{name: math.nan if value is None else value for name, value in row.items()} for row in self.table()]
        return library("pandas").DataFrame(rows)

    def __repr__(self) -> str:
        return f"<{self._line()}>"

    def _repr_html_(self) -> str:
        return table(self._line(), self._notebook_rows())


class Study(Answer):
    """The answer to a question of many runs.

    Attributes:
        complete: whether it has come to its end, and was not stopped.
        places: what its warnings hold at, in words.
        picture: name of the file that it is drawn into.
    """

    complete: bool
    places: ClassVar[str] = "points"
    picture: ClassVar[str]

    @property
    @abstractmethod
    def warnings(self) -> Sequence[RepeatedWarning]:
        """What is known to mislead."""

    @property
    def failures(self) -> Sequence[str]:
        """Why it is not what was asked for, a line each."""
        return ()

    @property
    @abstractmethod
    def size(self) -> str:
        """How much there is, in words."""

    @abstractmethod
    def files(self, carried: Callable[[Any], str]) -> dict[str, bytes]:
        """What its folder holds of it, by name, beside the question; nothing of a study of which nothing is done.

        carried: the text of a scenario for the folder, which gets copies of the files that it reads.
        """

    @abstractmethod
    def measure(self, name: str | None = None) -> str:
        """The measure that is asked for, or the one to show; "" where nothing has a value.

        Raises:
            InputError: there is no such measure.
        """

    @abstractmethod
    def figures(self, measure: str) -> Sequence[Figure]:
        """Pictures of a measure, the most telling ones first; none where there is nothing to draw."""

    def draw(self, folder: Path, measure: str) -> None:
        """Draw a measure into a folder, if there is anything to draw."""
        if figures := self.figures(measure):
            save_figures(figures[:BESIDE], folder / self.picture)

    @abstractmethod
    def as_json(self, measure: str | None = None) -> dict[str, Any]:
        """All of it, as JSON takes it; measure: to show."""

    @abstractmethod
    def lines(self, measure: str | None = None) -> list[str]:
        """What was found, as a terminal shows it; measure: to show."""

    def remarks(self, measure: str | None = None) -> Iterator[Text]:
        """What is to be known about it, the gravest first; measure: that is shown. Notes are for pages only."""
        for warning in self.warnings:
            yield Text(warning.in_words(self.places), "warning")


def csv_bytes(columns: Sequence[str], rows: Iterable[Record]) -> bytes:
    """A table as CSV; an empty field is no value."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: "" if _is_none(value) else value for key, value in row.items()})
    return text.getvalue().encode()


def _is_none(value: Any) -> bool:
    return value is None or (isinstance(value, float) and not math.isfinite(value))


def text_of(file: Path) -> str:
    """The text of a file.

    Raises:
        InputError: it is a link, or cannot be read.
    """
    if file.is_symlink():
        raise InputError("is a link, must be a file of the folder itself", file=file)
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {cause_of(error)}", file=file) from error
