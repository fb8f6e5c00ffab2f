"""An error budget as bars: what each entry changes, in percent of the value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from feeder_sim.document.figure import Figure
from feeder_sim.document.words import measure_label
from feeder_sim.plots.intervals import COLOURS

if TYPE_CHECKING:
    from feeder_sim.studies.budget import Budget

KIND_COLOURS = {"numerics": COLOURS[2], "seeds": COLOURS[5], "inputs": COLOURS[1], "model": COLOURS[0]}
DEVIATIONS = ("seeds", "inputs")  # to both sides


def budget_figure(study: Budget) -> Figure:
    """Bars of all entries, with two standard errors."""
    label = measure_label(study.name)
    height = 1.0 + 0.34 * len(study.entries)
    caption = f"{label}: standard deviations of seeds and inputs, and what changes with each entry, in percent."
    return Figure(lambda figure: draw_entries(figure.subplots(), study), height, f"Budget of {label}.", caption)


def draw_entries(axes: Any, study: Budget) -> None:
    """Draw the entries [%]."""
    percent = 100.0 / abs(study.value.mean)
    for place, entry in enumerate(study.entries):
        error = 2.0 * percent * entry.se if math.isfinite(entry.se) else 0.0
        colour = KIND_COLOURS[entry.kind]
        change = percent * entry.change
        if entry.kind in DEVIATIONS:
            axes.barh(place, 2.0 * change, 0.7, left=-change, color=colour)
        else:
            axes.barh(place, change, 0.7, xerr=error, color=colour, ecolor="0.3", capsize=3)
    axes.set_yticks(range(len(study.entries)), [f"{e.kind}: {e.name}" for e in study.entries])
    axes.invert_yaxis()
    axes.axvline(0.0, color="0.4", linewidth=0.8)
    axes.set(xlabel=f"{measure_label(study.name)}: change (%)")
