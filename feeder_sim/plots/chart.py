"""Pictures of the chart, of the model ladder and of the stability maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from feeder_sim.studies.chart.cases import CASES, Case
from feeder_sim.studies.chart.ladder import Rung
from feeder_sim.studies.chart.map_cells import MapCell, State
from feeder_sim.studies.chart.points import Point, front, is_default
from feeder_sim.studies.chart.stability_map import MAPS

FORMATS = (".png", ".svg")
COLOURS = {
    "impulses": "#c23030",
    "one degree of freedom": "#8c1515",
    "impulses, tangent plane": "#e58a5c",
    "impulses, no in-plane velocity": "#b79a8c",
    "drift map": "#3a8a5a",
    "MuJoCo": "#1f5fa8",
    "MuJoCo, compliant contact": "#5fa4d8",
    "MuJoCo, pyramidal cone": "#7a5ab5",
    "MuJoCo, contact of hulls": "#2a9d8f",
    "MuJoCo, few iterations": "#9bb8d3",
    "MuJoCo, mocap plate": "#555555",
    "MuJoCo, discrete integrator": "#888888",
    "MuJoCo, contact of one step": "#bbbbbb",
}
PEER_COLOURS = ("#d4a017", "#6b8e23", "#c77daa", "#8b5a2b", "#20808d", "#a0522d", "#111111")
MARKERS = "os^Dv<>pPX*hd"
STATE_COLOURS = {
    State.STABLE: "#8fbf7f",
    State.UNCLEAR: "#dddddd",
    State.BIASED: "#f2cf63",
    State.EXPLODING: "#d9534f",
    State.TUNNELLING: "#6a4c93",
}
LEGEND_COLUMNS = 5
MARKED_PERCENT = 5.0  # error at which a line is drawn
FAILURE_BAND = 0.93  # height in a panel from which on it shows the failures
FAILURE_HEIGHT = 0.965  # of their crosses


def draw_points(points: Sequence[Point], path: Path, machine: str) -> None:
    """Draw error over cost in a panel per case: a curve per method, the front shaded, failures as crosses at the top.

    Args:
        points: of all cases and methods.
        path: of the pictures, whose suffix is replaced by those of `FORMATS`.
        machine: the processor, for the title.
    """
    from matplotlib.figure import Figure

    cases = [case for case in CASES if any(point.case == case.name for point in points)]
    columns = min(3, len(cases))
    rows = math.ceil(len(cases) / columns)
    methods = list(dict.fromkeys(point.method for point in points))
    legend_rows = math.ceil(len(methods) / LEGEND_COLUMNS)
    size = (4.6 * columns, 4.0 * rows + 0.25 * legend_rows + 0.6)
    figure = Figure(figsize=size)
    inch = 1.0 / size[1]
    figure.subplots_adjust(
        left=0.75 / size[0],
        right=1.0 - 0.15 / size[0],
        bottom=(0.25 * legend_rows + 0.75) * inch,
        top=1.0 - 0.65 * inch,
        wspace=0.24,
        hspace=0.32,
    )
    styles = {name: _style(name, methods) for name in methods}
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in panels[len(cases) :]:
        spare.set_axis_off()
    for axes, case in zip(panels, cases, strict=False):
        _draw_case(axes, [point for point in points if point.case == case.name], styles)
        axes.set_title(case.title, fontsize=11)
        axes.set(xlabel="wall time per simulated second (s)", ylabel=f"error of the {_short(case)} (%)")
    lines = [_handle(name, styles[name]) for name in methods]
    figure.legend(handles=lines, loc="lower center", ncols=LEGEND_COLUMNS, fontsize=8, frameon=False)
    figure.suptitle(f"Speed against accuracy, one core of {machine}", fontsize=11, y=1.0 - 0.1 * inch)
    for suffix in FORMATS:
        figure.savefig(path.with_suffix(suffix), dpi=130)


def _short(case: Case) -> str:
    """Quantity of a case in a few words, for the label of an axis."""
    return str(case.quantity.removeprefix("error of the ").split(" (")[0].removeprefix("nuts on nodal lines when "))


def _style(name: str, methods: Sequence[str]) -> tuple[str, str]:
    """Colour and marker of a method; other simulators get `PEER_COLOURS` in the order in which they appear."""
    peers = [method for method in methods if method not in COLOURS]
    colour = COLOURS.get(name) or PEER_COLOURS[peers.index(name) % len(PEER_COLOURS)]
    return colour, MARKERS[methods.index(name) % len(MARKERS)]


def _handle(name: str, style: tuple[str, str]) -> Any:
    """Entry of a method in the legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=style[0], marker=style[1], label=name, markersize=5, linewidth=1.2)


def _draw_case(axes: Any, points: Sequence[Point], styles: dict[str, tuple[str, str]]) -> None:
    """Draw the panel of one case; `styles` has colour and marker of every method."""
    from matplotlib.patches import Rectangle

    best = front(points)
    axes.set(xscale="log", yscale="log")
    axes.axhline(MARKED_PERCENT, color="#999999", linewidth=0.8, linestyle=":")
    if best:
        front_x, front_y = [p.wall_s_per_simulated_s for p in best], [p.error_percent for p in best]
        axes.plot(front_x, front_y, color="#f0d9a8", linewidth=9, solid_capstyle="round", zorder=1)
    for name, (colour, marker) in styles.items():
        curve = [point for point in points if point.method == name]
        if not curve:
            continue
        valid = [point for point in curve if point.valid]
        x = [point.wall_s_per_simulated_s for point in valid]
        y = [point.error_percent for point in valid]
        spread = [0.0 if math.isnan(point.error_se_percent) else point.error_se_percent for point in valid]
        down = [min(s, 0.9 * v) for s, v in zip(spread, y, strict=True)]
        bars = {"elinewidth": 0.6, "capsize": 1.5}
        if valid:
            axes.errorbar(x, y, yerr=[down, spread], color=colour, marker=marker, markersize=5, linewidth=1.2, **bars)
        for point in valid:
            if is_default(point):
                place = ([point.wall_s_per_simulated_s], [point.error_percent])
                axes.plot(*place, "o", markersize=13, fillstyle="none", color="black", zorder=5)
        failed = [point.wall_s_per_simulated_s for point in curve if not point.valid]
        above = axes.get_xaxis_transform()
        axes.plot(
            failed,
            [FAILURE_HEIGHT] * len(failed),
            "x",
            color=colour,
            markersize=7,
            mew=2,
            transform=above,
            clip_on=False,
        )
    if any(not point.valid for point in points):
        axes.add_patch(Rectangle((0.0, FAILURE_BAND), 1.0, 0.07, transform=axes.transAxes, color="#eeeeee", zorder=0))
        axes.text(0.01, FAILURE_HEIGHT, "failed", transform=axes.transAxes, va="center", fontsize=7, color="#666666")
    _make_room(axes, points)
    axes.grid(alpha=0.4, linewidth=0.5)


def _make_room(axes: Any, points: Sequence[Point]) -> None:
    """Set limits of at least two decades that leave the band of failures free; label only powers of ten."""
    from matplotlib.ticker import NullFormatter

    errors = [point.error_percent for point in points if point.valid]
    low, high = math.log10(min(errors)) - 0.2, math.log10(max(errors)) + 0.2
    high = max(high, low + 2.0)
    axes.set_ylim(10**low, 10 ** (high + 0.1 * (high - low)))
    costs = [point.wall_s_per_simulated_s for point in points]
    left, right = math.log10(min(costs)) - 0.2, math.log10(max(costs)) + 0.2
    wide = max(0.0, 2.0 - (right - left))
    axes.set_xlim(10 ** (left - 0.5 * wide), 10 ** (right + 0.5 * wide))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())


def draw_ladder(rungs: Sequence[Rung], path: Path) -> None:
    """Draw for each rung the change of the transport speed and the wall time it saves, with a row per ladder.

    Args:
        rungs: of all ladders.
        path: of the pictures, whose suffix is replaced by those of `FORMATS`.
    """
    from matplotlib.figure import Figure

    ladders = list(dict.fromkeys(rung.ladder for rung in rungs))
    rows = [[rung for rung in rungs if rung.ladder == ladder][::-1] for ladder in ladders]
    figure = Figure(figsize=(9.0, 0.42 * len(rungs) + 1.6), layout="constrained")
    grid = figure.subplots(len(ladders), 2, squeeze=False, sharex="col", height_ratios=[len(row) for row in rows])
    for (left, right), ladder, row in zip(grid, ladders, rows, strict=True):
        place = range(len(row))
        bars = {"xerr": [0.0 if math.isnan(r.change_se_percent) else 2.0 * r.change_se_percent for r in row]}
        left.barh(place, [rung.change_percent for rung in row], color="#c23030", height=0.6, capsize=2, **bars)
        left.set_yticks(place, [rung.model for rung in row], fontsize=8)
        left.set_title(ladder, fontsize=9, loc="left")
        left.axvline(0.0, color="black", linewidth=0.8)
        right.barh(place, [rung.saves for rung in row], color="#1f5fa8", height=0.6)
        right.set_yticks([])
        right.axvline(1.0, color="black", linewidth=0.8)
    grid[-1][0].set_xlabel("change of the transport speed (%), bars: two standard errors")
    grid[-1][1].set_xlabel("wall time of the full model over that of this one")
    for suffix in FORMATS:
        figure.savefig(path.with_suffix(suffix), dpi=130)


def draw_stability(cells: Sequence[MapCell], path: Path) -> None:
    """Draw the stability maps: the colour shows the state, the number the deviation of the drift in percent.

    Args:
        cells: of all maps.
        path: of the pictures, whose suffix is replaced by those of `FORMATS`.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    maps = [stability_map for stability_map in MAPS if any(cell.map == stability_map.name for cell in cells)]
    columns = min(3, len(maps))
    rows = math.ceil(len(maps) / columns)
    figure = Figure(figsize=(4.6 * columns, 3.6 * rows + 0.6), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in panels[len(maps) :]:
        spare.set_axis_off()
    for axes, stability_map in zip(panels, maps, strict=False):
        map_cells = [cell for cell in cells if cell.map == stability_map.name]
        x_values, y_values = sorted({cell.x for cell in map_cells}), sorted({cell.y for cell in map_cells})
        for cell in map_cells:
            i, j = x_values.index(cell.x), y_values.index(cell.y)
            axes.fill([i, i + 1, i + 1, i], [j, j, j + 1, j + 1], color=STATE_COLOURS[cell.state], edgecolor="white")
            if math.isfinite(cell.deviation):
                text = f"{100.0 * cell.deviation:+.0f}"
                axes.text(i + 0.5, j + 0.5, text, ha="center", va="center", fontsize=7)
        axes.set_xticks([i + 0.5 for i in range(len(x_values))], [f"{v:g}" for v in x_values])
        axes.set_yticks([j + 0.5 for j in range(len(y_values))], [f"{v:g}" for v in y_values])
        axes.set_title(stability_map.title, fontsize=10)
        axes.set(
            xlabel=stability_map.x.label, ylabel=stability_map.y.label, xlim=(0, len(x_values)), ylim=(0, len(y_values))
        )
    handles = [Patch(color=colour, label=str(state)) for state, colour in STATE_COLOURS.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    for suffix in FORMATS:
        figure.savefig(path.with_suffix(suffix), dpi=130)
