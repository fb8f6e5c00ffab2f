"""A scenario with uncertain inputs, as a user of Python asks for it."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.api.answer import Answer, check_some, held_by, workers_for
from feeder_sim.api.plots import axes_for
from feeder_sim.api.progress import Progress, shown
from feeder_sim.errors import InputError, check_type, check_whole, nearest, path_of_user
from feeder_sim.jobs.folder import WorkFolder
from feeder_sim.notebook import counted
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.studies.uncertainty.propagate import (
    QUESTION,
    Propagation,
    check_propagated,
    propagate,
    write_propagation,
)
from feeder_sim.studies.uncertainty.question import Question

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def uncertainty(
    scenario: Scenario,
    *,
    inputs: int = 32,
    seeds: int = 2,
    indices: bool = False,
    measure: str | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> Uncertainty:
    """Run a scenario at many draws of its `[uncertain]` inputs, in many processes.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: has an `[uncertain]` table.
        inputs: draws of the inputs, from 2 on; with `indices` so many times (inputs + 2), and a power of two.
        seeds: of every draw; two tell inputs and seeds apart.
        indices: draw them so that Sobol indices can be told; the extra `uncertainty` brings SALib.
        measure: that every seed has to have; default: any.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the tables and a journal, as of the command; with it the same call goes on after a break.
        progress: True shows a bar on stderr; a function is called with the share that is done.
        stop: set it to end; what is done is returned.

    Raises:
        InputError: no input is uncertain, an argument is not allowed, SALib is missing, there is no such measure, or
            the folder holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    check_some(workers=workers)
    check_whole(inputs, "inputs", 2)
    check_whole(seeds, "seeds")
    check_type(measure, str | None, "the name of a measure", "measure")
    check_propagated(scenario, inputs, seeds, indices)
    how: dict[str, Any] = {"inputs": inputs, "seeds": seeds, "indices": indices, "measure": measure or "", "stop": stop}
    with shown(progress, scenario.title or "uncertainty") as (show, _), workers_for(executor, workers) as found:
        if out is None:
            return Uncertainty(**held_by(propagate(scenario, **how, workers=found, progress=show)))
        asked = Question(inputs, seeds, indices, measure or "")
        with WorkFolder(path_of_user(out, "out"), QUESTION, asked.as_toml(), scenario, same=asked.same) as folder:
            done = propagate(scenario, **how, workers=found, journal=folder.journal, progress=show)
            write_propagation(folder, done)
        return Uncertainty(**held_by(done))


class Uncertainty(Answer, Propagation):
    """What uncertain inputs come to.

    Attributes:
        scenario: with the uncertain inputs.
        draws: values of the inputs, by key.
        swept: one case per draw.
        saltelli: whether the draws are such that indices can be told.
    """

    @property
    def complete(self) -> bool:
        """Whether all of it is done."""
        return self.swept.complete

    def measure(self, name: str | None = None) -> str:
        """The measure asked for, or the one to show.

        Raises:
            InputError: there is no such measure.
        """
        if name is not None and name not in self.measures:
            allowed = ", ".join(self.measures) or "none, nothing has a value"
            raise InputError(f"is {name}{nearest(name, self.measures)}, allowed are {allowed}", key="measure")
        return self.main() if name is None else name

    def plot(self, measure: str | None = None, *, measured: float | None = None, ax: Axes | None = None) -> Axes:
        """Histogram of a measure over all runs, with its intervals.

        Args:
            measure: its name; default: the usual one.
            measured: a value of it from an experiment, in its unit, to mark.
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: there is no such measure, or none has a value.
        """
        from feeder_sim.plots.uncertainty import draw_values

        name = self.measure(measure)
        if not name:
            raise InputError("no measure has a value, there is nothing to draw", key="plot")
        axes = axes_for(ax)
        draw_values(axes, self, name, measured)
        return axes

    def plot_shares(self, measure: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Bars of the share of the variance that each input has in a measure, with their 95 % intervals.

        Args:
            measure: its name; default: the usual one.
            ax: matplotlib axes to draw into; default: new ones.

        Raises:
            InputError: there is no such measure, or its shares are not told, as where the inputs are not told apart
                from the seeds or draws are few.
        """
        from feeder_sim.plots.uncertainty import draw_shares

        name = self.measure(measure)
        linear, indices = self.linear_shares(name), self.indices(name)
        if linear is None and not indices:
            raise InputError(f"{name or 'no measure'} has no shares that can be told", key="plot_shares")
        axes = axes_for(ax)
        draw_shares(axes, linear, indices)
        return axes

    def _line(self) -> str:
        rest = "" if self.complete else ", not complete"
        inputs = counted(len(self.scenario.uncertain or {}), "uncertain input")
        return f"Uncertainty by {inputs}: {counted(len(self.draws), 'draw')}{rest}"

    def _table(self) -> Sequence[Mapping[str, Any]]:
        return self.rows()
