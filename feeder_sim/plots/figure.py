"""What all pictures share: an empty figure, and the units of their axes."""

from __future__ import annotations

from typing import Any

MOST_TICKS = 12  # of a logarithmic axis
MM, UM, MS = 1e3, 1e6, 1e3  # per m, per m, per s


def empty_figure(width: float, height: float) -> Any:
    """An empty figure of a size in inches; matplotlib is imported only where something is drawn."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def make_logarithmic(axis: Any) -> None:
    """Make an axis logarithmic, with ticks at 1, 2 and 5 in plain numbers; sweeps seldom go over many decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    (axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale)("log")
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=MOST_TICKS))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
