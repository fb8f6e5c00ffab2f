"""What the answers to questions have in common: a line, a table in notebooks, and a DataFrame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from feeder_sim.api.tables import library
from feeder_sim.errors import check_type, check_whole
from feeder_sim.jobs.workers import Workers, given_workers, local_workers
from feeder_sim.notebook import table

if TYPE_CHECKING:
    import pandas


class Answer:
    """An answer whose main result is a table."""

    def _line(self) -> str:
        """What it is, in a line."""
        raise NotImplementedError

    def _table(self) -> Sequence[Mapping[str, Any]]:
        """Its rows by column, with units in the names of the columns; None where there is no value."""
        raise NotImplementedError

    def _shown(self) -> Sequence[Mapping[str, Any]]:
        """The rows that a notebook shows."""
        return self._table()

    def to_frame(self) -> pandas.DataFrame:
        """The table as a pandas DataFrame, NaN where there is no value; the extra `data` brings pandas.

        Raises:
            InputError: pandas is missing.
        """
        rows = [{name: math.nan if value is None else value for name, value in row.items()} for row in self._table()]
        return library("pandas").DataFrame(rows)

    def __repr__(self) -> str:
        return f"<{self._line()}>"

    def _repr_html_(self) -> str:
        return table(self._line(), self._shown())


def held_by(found: Any) -> dict[str, Any]:
    """The fields of a dataclass by name, as its constructor takes them."""
    return {field.name: getattr(found, field.name) for field in fields(found)}


def check_some(**numbers: int | None) -> None:
    """Refuse whole numbers below 1 among arguments that may be left out.

    Raises:
        InputError: as said.
    """
    for key, value in numbers.items():
        if value is not None:
            check_whole(value, key)


def check_number(value: float | None, key: str) -> None:
    """Refuse what is no number where one may be given.

    Raises:
        InputError: as said.
    """
    check_type(value, float | int | None, "a number", key)


def workers_for(executor: Executor | None, workers: int | None) -> AbstractContextManager[Workers]:
    """Who runs the seeds: an executor of the caller's, or so many processes of this machine."""
    return given_workers(executor, workers) if executor else local_workers(workers)
