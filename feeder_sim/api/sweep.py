"""A scenario at many points, as a user of Python asks for it."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.api.answer import Answer, check_number, check_some, held_by, workers_for
from feeder_sim.api.progress import Progress, shown
from feeder_sim.errors import InputError, check_type, check_whole, path_of_user
from feeder_sim.notebook import counted
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.studies.sweep import cases
from feeder_sim.studies.sweep.case import MOST_SEEDS
from feeder_sim.studies.sweep.folder import not_counted, sweep_folder, write_table
from feeder_sim.studies.sweep.question import Question, axis_texts

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def sweep(
    scenario: Scenario,
    vary: Mapping[str, Any],
    *,
    zip: bool = False,
    sobol: int = 0,
    seeds: int | None = None,
    measure: str | None = None,
    until_se: float | None = None,
    most_seeds: int = MOST_SEEDS,
    inputs: int = 16,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> Sweep:
    """Run a scenario at every point of a grid, in many processes.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: what is varied; the values it has stand for all keys that are not.
        vary: values by dotted key, or a text as the command line takes it: `{"drive[0].amplitude_um": "0.5:8:log12"}`.
            Units are in the names of the keys.
        zip: take the values of the keys side by side, not crossed.
        sobol: so many points of a scrambled Sobol sequence, in place of a grid; keys may then have ranges, "0.5:8".
        seeds: of every point; default: those of the scenario.
        measure: that `until_se` looks at.
        until_se: more seeds, 8 or more, are run until the standard error is below this share of the mean [1].
        most_seeds: of a point with `until_se`; `Sweep.short` counts the points that do not get there.
        inputs: draws of the uncertain inputs, where the scenario has any.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the table and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.

    Raises:
        InputError: a key or a value that is not allowed, or a folder that holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    check_type(vary, Mapping, "a dictionary of values by key", "vary")
    check_some(workers=workers, seeds=seeds)
    check_type(measure, str | None, "the name of a measure", "measure")
    check_number(until_se, "until_se")
    check_whole(inputs, "inputs", 2)
    check_whole(sobol, "sobol", 0)
    check_whole(most_seeds, "most_seeds")
    question = Question(
        axis_texts(vary),
        zip,
        sobol,
        seeds=seeds or 0,
        measure=measure or "",
        until_se=until_se or 0.0,
        inputs=inputs,
        most_seeds=most_seeds,
    )
    points = cases.Cases.of(scenario, question, file=Path("scenario"))
    with shown(progress, scenario.title or "sweep") as (show, notify), workers_for(executor, workers) as found:
        if out is None:
            return Sweep(**held_by(cases.run_cases(points, found, stop=stop, progress=show)))
        folder = sweep_folder(path_of_user(out, "out"), "", scenario, question)
        others = cases.take_checked(points, folder.journals)
        if notify and others and not points.all_done:
            notify(not_counted(others))
        with folder:
            done = cases.run_cases(points, found, folder.journal, others=others, stop=stop, progress=show)
            write_table(folder, done)
        return Sweep(**held_by(done))


class Sweep(Answer, cases.Sweep):
    """What a sweep has come to.

    Attributes:
        cases: the points, and what their seeds have come to.
        complete: whether all of it is done.
        others: seeds in the folder that do not count: of other points, of another version, of files that have changed.
    """

    def plot(self, measure: str | None = None) -> Sequence[Axes]:
        """Draw a measure: means with 95 % intervals over each key, or a map over two; returns matplotlib axes.

        Args:
            measure: its name; default: the usual one.

        Raises:
            InputError: there is no such measure, or it has no value anywhere.
        """
        from matplotlib import pyplot

        from feeder_sim.plots.sweep import draw_measure

        name, figure = self.measure(measure), pyplot.figure(layout="constrained")
        if not draw_measure(figure, self, name):
            pyplot.close(figure)
            raise InputError("has no value at any point, there is nothing to draw", key=name or "plot")
        return figure.axes

    def _line(self) -> str:
        rest = "" if self.complete else ", not complete"
        held = [counted(len(self.cases.points), "point"), counted(len(self.measures), "measure")]
        held += [counted(len(self.cautions), "caution")] if self.cautions else []
        return f"Sweep over {' and '.join(self.keys)}: {', '.join(held)}{rest}"

    def _table(self) -> Sequence[Mapping[str, Any]]:
        return [row.as_dict() for row in self.rows]

    def _shown(self) -> Sequence[Mapping[str, Any]]:
        return [row.as_dict() for row in self.at_every_point(self.measure())]
