"""Two recorded runs against each other, as a user of Python asks for it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from feeder_sim.api.answer import Answer
from feeder_sim.api.progress import Progress, shown
from feeder_sim.errors import path_of_user
from feeder_sim.notebook import counted
from feeder_sim.studies import compare as comparing


def compare(first: str | Path, second: str | Path, *, progress: Progress = None) -> Comparison:
    """Compare two recorded runs: the differences of all measures with intervals, of settings and of versions.

    Nothing is run. With the same seeds in both runs they are compared seed by seed, else by Welch's interval.

    Args:
        first: folder of a run, or its trajectory file.
        second: the other one; differences are second less first.
        progress: True shows a bar on stderr; a function is called with the share of the seeds that are measured.

    Raises:
        InputError: a run cannot be read, or a file that its scenario reads is missing or no longer the same.
    """
    paths = path_of_user(first, "first"), path_of_user(second, "second")
    with shown(progress, "compare") as (show, _):

        def of_run(number: int, done: float) -> None:
            if show:
                show(0.5 * (number + done))

        runs = [
            comparing.measured_run(path, lambda done, number=number: of_run(number, done))  # type: ignore[misc]
            for number, path in enumerate(paths)
        ]
    return Comparison(*runs)


class Comparison(Answer, comparing.Comparison):
    """Two measured runs.

    Attributes:
        first, second: the runs, with all measures of every seed.
    """

    def _line(self) -> str:
        how = "paired by seed" if self.paired else "Welch"
        settings = counted(len(self.settings), "setting")
        return f"Comparison: {counted(len(self.differences), 'measure')}, {how}; {settings} otherwise"

    def _table(self) -> Sequence[Mapping[str, Any]]:
        """A row per measure: means, their difference, and its 95 % interval."""
        return [
            {
                "measure": found.name,
                "first": found.first.mean,
                "second": found.second.mean,
                "difference": found.difference,
                "low": found.low,
                "high": found.high,
                "n_first": found.first.n,
                "n_second": found.second.n,
                "pairs": math.nan if found.pairs is None else found.pairs,
            }
            for found in self.differences
        ]
