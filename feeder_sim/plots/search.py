"""The course of a search: its trials in order, the best so far, and the check with fresh seeds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feeder_sim.measures.statistic import half_interval
from feeder_sim.plots.figure import empty_figure

if TYPE_CHECKING:
    from feeder_sim.studies.search.optimise import Search

BLUE, PALE, RED, GREEN, GREY = "#3a60be", "#b8c6ea", "#be3434", "#3a8a5a", "0.55"


def draw_search(found: Search, path: Path) -> None:
    """Draw the history of a search to a file."""
    figure = empty_figure(7.5, 4.4)
    draw_history(figure.subplots(), found)
    figure.savefig(path, dpi=150)


def draw_history(axes: Any, found: Search) -> None:
    """Draw means with standard errors over the trials, and the check of a search with 95 % intervals.

    Trials that were stopped are pale.
    """
    for stopped, color, label in ((True, PALE, "stopped early"), (False, BLUE, "all seeds")):
        shown = [
            (i, trial.found)
            for i, trial in enumerate(found.trials)
            if trial.stopped == stopped and not math.isnan(trial.found.mean)
        ]
        if shown:
            place, found_there = zip(*shown, strict=True)
            error = [0.0 if math.isnan(s.se) else s.se for s in found_there]
            axes.errorbar(place, [s.mean for s in found_there], error, fmt="o", color=color, markersize=4, label=label)
    steps = found.running_best
    axes.step(range(len(steps)), steps, where="post", color=GREY, linewidth=1.0, label="best so far")
    for after, checked, color, label in (
        (2, found.present, RED, "recipe of the file, fresh seeds"),
        (4, found.best, GREEN, "best recipe, fresh seeds"),
    ):
        if checked is not None and checked.found.n > 1:
            reach = half_interval(checked.found.se, checked.found.n)
            axes.errorbar(len(steps) + after, checked.found.mean, reach, fmt="s", color=color, capsize=3, label=label)
    axes.set(xlabel="trial", ylabel=found.aim.measure)
    axes.grid(True, alpha=0.3)
    axes.legend(fontsize=8)
