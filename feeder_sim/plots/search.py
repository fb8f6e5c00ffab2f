"""The course of a search: its trials in order, the best so far, and the check with fresh seeds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from feeder_sim.document.figure import Figure
from feeder_sim.document.words import measure_label
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.intervals import drawn_half
from feeder_sim.plots.sweep import Mean, sample_figure

if TYPE_CHECKING:
    from feeder_sim.studies.search.optimise import Search

MOST_PANELS = 9  # of keys; more would make the picture too high
BLUE, PALE, RED, GREEN, GREY = "#3a60be", "#b8c6ea", "#be3434", "#3a8a5a", "0.55"


def search_figures(search: Search) -> list[Figure]:
    """The trials in order with the best so far and the check, and their means over each key."""
    if not search.trials:
        return []
    label, keys = measure_label(search.aim.measure), search.keys[:MOST_PANELS]
    checked = " The squares are both recipes with fresh seeds and 95 % intervals." if search.present else ""
    course = Figure(
        lambda figure: draw_history(figure.add_subplot(), search),
        height=3.4,
        alt=f"{label} of {len(search.trials)} trials in their order, and the best so far.",
        caption=f"{label}: means of the trials, with standard errors; pale ones were stopped early. The line is the "
        f"best so far of those with all their seeds.{checked}",
    )
    valued = [trial for trial in search.trials if trial.statistic.n]
    means = [Statistic(trial.statistic.mean, math.nan, math.nan, 1) for trial in valued]
    rows = [Mean(trial.point, mean) for trial, mean in zip(valued, means, strict=True)]
    alt = f"{label} over {' and '.join(keys)}, {len(rows)} trials."
    over_keys = sample_figure(rows, keys, label, alt=alt, caption=f"{label}: means of the trials.")
    return [course, over_keys] if rows else [course]


def draw_history(axes: Any, search: Search) -> None:
    """Draw means with standard errors over the trials, and the check of a search with 95 % intervals.

    Trials that were stopped are pale.
    """
    for stopped, color, label in ((True, PALE, "stopped early"), (False, BLUE, "all seeds")):
        points = [
            (i, trial.statistic)
            for i, trial in enumerate(search.trials)
            if trial.stopped == stopped and not math.isnan(trial.statistic.mean)
        ]
        if points:
            place, statistics = zip(*points, strict=True)
            error = [0.0 if math.isnan(s.se) else s.se for s in statistics]
            axes.errorbar(place, [s.mean for s in statistics], error, fmt="o", color=color, markersize=4, label=label)
    steps = search.running_best
    axes.step(range(len(steps)), steps, where="post", color=GREY, linewidth=1.0, label="best so far")
    for after, checked, color, label in (
        (2, search.present, RED, "recipe of the file, fresh seeds"),
        (4, search.best, GREEN, "best recipe, fresh seeds"),
    ):
        if checked is not None and checked.statistic.n:
            reach = drawn_half(checked.statistic)
            axes.errorbar(
                len(steps) + after, checked.statistic.mean, reach, fmt="s", color=color, capsize=3, label=label
            )
    axes.set(xlabel="trial", ylabel=measure_label(search.aim.measure))
    axes.grid(True, alpha=0.3)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
