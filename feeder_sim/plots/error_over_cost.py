"""Speed against accuracy: the error of every setting over what it costs; left is cheaper, down is nearer."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from feeder_sim.document.figure import Figure, make_logarithmic
from feeder_sim.document.words import measure_label
from feeder_sim.plots.intervals import COLOURS

if TYPE_CHECKING:
    from feeder_sim.studies.chart.chart import Chart

LEAST = 1e-3  # of the reference: smaller errors are drawn as that
MARKS = {"good": "o", "unclear": "D", "off": "s", "fails": "X"}


def chart_figure(chart: Chart) -> Figure:
    """Errors of all settings over their costs."""
    name = f"error of {measure_label(chart.name)}"
    caption = f"{name} over the wall time of a seed, every setting: left is cheaper, down is nearer."
    return Figure(lambda figure: draw_errors(figure.subplots(), chart), 4.4, f"{name}, {chart.size}.", caption)


def right_value(chart: Chart) -> float:
    """The value that errors are shares of; 0 or NaN where there is nothing to draw."""
    return next((row.mean - row.error for row in chart.rows if row.n and math.isfinite(row.error)), math.nan)


def draw_errors(axes: Any, chart: Chart) -> None:
    """Draw errors [%] over wall times [s] of a seed, with bars of two standard errors."""
    reference = right_value(chart)
    rows = [row for row in chart.rows if row.n and math.isfinite(row.error)]
    names = list(dict.fromkeys(row.method for row in rows))
    recommended = chart.recommended
    for method, colour in zip(names, COLOURS, strict=False):
        method_rows = [row for row in rows if row.method == method]
        error = [100.0 * max(abs(row.error / reference), LEAST) for row in method_rows]
        reach = [100.0 * 2.0 * row.error_se / abs(reference) for row in method_rows]
        cost = [row.wall_s for row in method_rows]
        low = [min(r, e - 50.0 * LEAST) for r, e in zip(reach, error, strict=True)]
        axes.errorbar(cost, error, [low, reach], fmt="none", ecolor=colour, alpha=0.4, linewidth=1.0)
        if method != "simplified":
            axes.plot(cost, error, color=colour, linewidth=1.0, alpha=0.6)
        for row, x, y in zip(method_rows, cost, error, strict=True):
            beside = (5, 4) if method_rows.index(row) % 2 else (5, -9)
            label = (method or "as it is") if row is method_rows[0] else None
            axes.plot(x, y, MARKS[row.verdict], color=colour, markersize=6, label=label, linestyle="none")
            axes.annotate(
                row.setting.removeprefix("no step, ").removeprefix("MuJoCo, "),
                (x, y),
                xytext=beside,
                textcoords="offset points",
                fontsize=6.5,
            )
            if row.default:
                axes.plot(x, y, "o", markersize=12, markerfacecolor="none", markeredgecolor="black")
            if recommended is row:
                axes.plot(x, y, "*", markersize=17, markerfacecolor="none", markeredgecolor="#2a8a5f")
    axes.axhline(100.0 * chart.question.within, color="0.5", linewidth=0.8, linestyle=":")
    axes.set_xlim(0.8 * min(row.wall_s for row in rows), 1.5 * max(row.wall_s for row in rows))
    make_logarithmic(axes.xaxis)
    make_logarithmic(axes.yaxis)
    axes.set(
        xlabel="wall time of a seed on one core (s)",
        ylabel=f"error of {measure_label(chart.name)} (%)",
        title=chart.scenario.title,
    )
    axes.grid(True, alpha=0.3)
    axes.legend(fontsize=7, title="ring: as it is, star: take this", title_fontsize=7)
