"""Two recorded runs against each other, as a user of Python asks for it."""

from __future__ import annotations

from pathlib import Path

from feeder_sim.api.progress import Progress, shown
from feeder_sim.errors import path_of_user
from feeder_sim.studies.compare import Comparison, measured_run


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
            measured_run(path, lambda done, number=number: of_run(number, done))  # type: ignore[misc]
            for number, path in enumerate(paths)
        ]
    return Comparison(*runs)
