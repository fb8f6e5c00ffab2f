"""The best recipe, as a user of Python asks for it."""

from __future__ import annotations

import contextlib
import math
import tempfile
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from feeder_sim.api.answer import Answer, check_number, check_some, held_by, workers_for
from feeder_sim.api.plots import axes_for
from feeder_sim.api.progress import Progress, shown
from feeder_sim.errors import InputError, check_type, check_whole, path_of_user, quoted
from feeder_sim.notebook import counted
from feeder_sim.scenario import Scenario, check_scenario
from feeder_sim.studies.search import search as searching
from feeder_sim.studies.search.proposals import Sampler
from feeder_sim.studies.search.results import Question, search_folder, tried, write_search
from feeder_sim.studies.search.screening import first_recipes
from feeder_sim.studies.search.space import Space
from feeder_sim.studies.search.trials import Aim
from feeder_sim.studies.sweep.design import labels
from feeder_sim.studies.sweep.question import axis_texts

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def optimise(
    scenario: Scenario,
    over: Mapping[str, Any],
    *,
    maximise: str | None = None,
    minimise: str | None = None,
    trials: int = 200,
    budget_s: float | None = None,
    seeds: int | None = None,
    check_seeds: int = 16,
    screen: str | Path | None = None,
    recipes: int = 256,
    sampler: Sampler = "tpe",
    workers: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    progress: Progress = None,
    stop: threading.Event | None = None,
) -> Search:
    """Search for the recipe that makes a measure largest or smallest, in many processes; the extra `search`.

    In a script, call it below `if __name__ == "__main__":`, as everything that starts processes.

    Args:
        scenario: where the search begins; the values it has stand for all keys that are not searched.
        over: by dotted key a range, "0.5:2" or "0.5:2:log", or a list of choices. Units are in the names of the keys.
            A key that ends in `.mode` takes its frequency along.
        maximise: measure that is to be large; this or the next.
        minimise: measure that is to be small.
        trials: recipes to try, at most.
        budget_s: time for the trials [s]; default: no limit.
        seeds: of a recipe, from 2 on; default: those of the scenario, up to 8.
        check_seeds: fresh seeds of the best recipe and of the scenario as it is, from 2 on.
        screen: file of a drift map, which proposes recipes to begin with, for the least `arrival_time_s`.
        recipes: that the drift map walks, from 2 on.
        sampler: of Optuna: "tpe", or "cmaes" for numbers only.
        workers: processes; default: one per core.
        executor: runs the tasks in place of processes of this machine, as that of a Dask client.
        out: folder for the tables and journals, as of the command; with it the same call goes on after a break.
            Default: one that is removed at the end.
        progress: True shows a bar on stderr; a function is called with the share of the budget that is spent.
        stop: set it to end; what is done is returned.

    Raises:
        InputError: a key, a value or an argument that is not allowed, no such measure, Optuna is missing, or the
            folder holds something else.
        RecordingFailed: the folder cannot be written.
    """
    check_scenario(scenario)
    check_type(over, Mapping, "a dictionary of ranges and choices by key", "over")
    check_some(workers=workers, trials=trials)
    for key, value in {"seeds": seeds, "check_seeds": check_seeds, "recipes": recipes}.items():
        if value is not None:
            check_whole(value, key, 2)
    for key, name in {"maximise": maximise, "minimise": minimise}.items():
        check_type(name, str | None, "the name of a measure", key)
    check_number(budget_s, "budget_s")
    if budget_s is not None and not budget_s > 0.0:
        raise InputError(f"is {budget_s:g}, allowed is above 0", key="budget_s")
    if sampler not in get_args(Sampler):
        raise InputError(f"is {quoted(sampler)}, allowed are {', '.join(get_args(Sampler))}", key="sampler")
    aim, texts = Aim.of(scenario, maximise, minimise, seeds), axis_texts(over)
    space = Space.of(scenario, texts)
    drift_map = path_of_user(screen, "screen") if screen is not None else None
    asked = Question.of(texts, aim, sampler, drift_map, recipes)
    with contextlib.ExitStack() as held:
        show, notify = held.enter_context(shown(progress, scenario.title or "optimise"))
        path = path_of_user(out, "out") if out is not None else Path(held.enter_context(tempfile.TemporaryDirectory()))
        folder = search_folder(path, asked, scenario)
        starts = first_recipes(path, space, aim, drift_map, recipes) if drift_map else []
        processes = held.enter_context(workers_for(executor, workers))
        held.enter_context(folder)
        found = searching.search(
            space,
            aim,
            processes,
            folder.path,
            folder.journal,
            budget=searching.Budget(trials, math.inf if budget_s is None else budget_s),
            check_seeds=check_seeds,
            sampler=sampler,
            starts=starts,
            stop=stop,
            progress=show,
            notify=notify,
        )
        write_search(folder, found)
    return Search(**held_by(found))


class Search(Answer, searching.Search):
    """What a search has come to.

    Attributes:
        space: what was changed.
        aim: what was searched for.
        trials: all that were judged, in order.
        present, best: the scenario as it is, and the best recipe, both with fresh seeds; None where it did not get so
            far.
        complete: whether it came to its end and was not stopped.
        cautions: what is to be known before the best recipe is taken: where fresh seeds do not say that it is better
            than that of the file, and settings that are known to mislead.
        without_value: why recipes do not count, a line for each that does not.
    """

    @property
    def best_scenario(self) -> Scenario:
        """The scenario with the best recipe.

        Raises:
            InputError: there is none.
        """
        if self.best is None:
            raise InputError(f"no recipe has {self.aim.measure} in all its seeds, or it was stopped", key="best")
        return self.space.changed(self.best.point or {})

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """The trials in order, the best so far, and the check with fresh seeds; returns matplotlib axes."""
        from feeder_sim.plots.search import draw_history

        axes = axes_for(ax)
        draw_history(axes, self, tried(self))
        return axes

    def _line(self) -> str:
        aim = f"{'largest' if self.aim.largest else 'smallest'} {self.aim.measure}"
        low, high = self.gain.interval
        gain = f", best less present {self.gain.mean:+.3g} ({low:+.3g} to {high:+.3g}) with fresh seeds"
        known = math.isfinite(low) and math.isfinite(high)
        return f"Search for the {aim}: {counted(len(self.trials), 'trial')}{gain if known else ''}"

    def _table(self) -> Sequence[Mapping[str, Any]]:
        """A row per trial."""
        return [
            {"trial": row.number, **labels(row.point), "mean": row.found.mean, "se": row.found.se}
            | {"seeds": row.seeds, "stopped": row.stopped, "refused": row.refused}
            for row in tried(self)
        ]

    def _shown(self) -> Sequence[Mapping[str, Any]]:
        """The recipes with fresh seeds, or else the trials."""
        checked = {"as it is": (self.space.present or {}, self.present), "best": ({}, self.best)}
        keys = [parameter.key for parameter in self.space.parameters]
        rows = []
        for name, (point, found) in checked.items():
            if found is not None:
                values = labels({key: (found.point or point).get(key) for key in keys})
                rows.append({"recipe": name, **values, **found.found.as_dict()})
        return rows or self._table()
