"""Pictures of a search: its trials in order, and over each of the keys that were searched."""

from __future__ import annotations

import math
from typing import Any

from feeder_sim.measures.statistic import Statistic
from feeder_sim.plots.search import draw_history
from feeder_sim.report.page import Picture
from feeder_sim.report.pictures import picture_of
from feeder_sim.report.sweep_pictures import sample_picture
from feeder_sim.report.words import measure_label
from feeder_sim.studies.search.optimise import Search
from feeder_sim.studies.sweep.table import Row

MOST_PANELS = 9  # of keys; more would make the picture too high


def course_picture(search: Search) -> Picture:
    """The trials in order, the best so far, and the check."""
    label, count = measure_label(search.aim.measure), len(search.trials)

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        draw_history(axes, search)
        axes.set(ylabel=label)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))

    checked = " The squares are both recipes with fresh seeds and 95 % intervals." if search.present else ""
    return picture_of(
        draw,
        height=3.4,
        alt=f"{label} of {count} trials in their order, and the best so far.",
        caption=f"{label}: means of the trials, with standard errors; pale ones were stopped early. The line is the "
        f"best so far of those with all their seeds.{checked}",
    )


def keys_picture(search: Search) -> Picture:
    """The means of the trials over each key."""
    label, keys = measure_label(search.aim.measure), search.keys[:MOST_PANELS]
    rows = [
        Row(trial.point, search.aim.measure, Statistic(trial.found.mean, math.nan, math.nan, 1), 1, 0)
        for trial in search.trials
        if trial.found.n
    ]
    alt = f"{label} over {' and '.join(keys)}, {len(rows)} trials."
    return sample_picture(rows, keys, label, alt=alt, caption=f"{label}: means of the trials.")
