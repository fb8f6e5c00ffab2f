"""Pictures of mode shapes, routes and waves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feeder_sim.document.figure import MM, UM, empty_figure
from feeder_sim.measures.circulation import StageWave
from feeder_sim.plate.impedance_fit import Sweep, SweepFit
from feeder_sim.plate.imported.modes import Imported
from feeder_sim.plate.mode_file import ModeFile
from feeder_sim.plate.modes import PlateModes
from feeder_sim.plate.response import Response
from feeder_sim.plate.sequences import Route
from feeder_sim.plots.plate_top import cut_to_plate

if TYPE_CHECKING:
    from feeder_sim.studies.width_ratios import RatioRoutes


# A sheet of imported modes: the points as they were given beside the smooth shape that was fitted to them.

GRID = 241
PAIRS = 2  # of panels in a row
COLOURS = {"cmap": "RdBu_r"}
POINTS = {"linewidths": 0.15, "edgecolors": "0.4"}  # so that those near a node show on white


def draw_imported(imported: Imported, path: Path) -> None:
    """Draw every mode twice, as points and as a smooth shape with nodal lines; `path` says the type of file."""
    from matplotlib.figure import Figure

    modes, outline = imported.mode_file.modes, imported.outline
    columns = min(PAIRS, len(modes))
    rows = math.ceil(len(modes) / columns)
    length, width = outline.size
    panel = 2.5
    height = min(max(panel * width / length, 0.8), 3.0 * panel)
    figure = Figure(figsize=(2.0 * panel * columns + 0.9, rows * (height + 0.25) + 0.1), layout="constrained")
    axes = figure.subplots(rows, 2 * columns, squeeze=False)
    contours: Any = None
    for axis in axes.ravel():
        axis.set_axis_off()
    for i in range(len(modes)):
        points, shape = axes[i // columns, 2 * (i % columns) : 2 * (i % columns) + 2]
        contours = _draw_pair(points, shape, imported, i)
    figure.suptitle(f"{length * MM:.4g} x {width * MM:.4g} mm, {len(imported.points)} points", fontsize=9)
    figure.colorbar(contours, ax=axes, label="deflection, antinode = 1", ticks=[-1, 0, 1], shrink=min(1.0, 2.5 / rows))
    figure.savefig(path, dpi=150)


def _draw_pair(points: Any, shape: Any, imported: Imported, i: int) -> Any:
    modes, outline = imported.mode_file.modes, imported.outline
    length, width = outline.size
    x, y = np.linspace(-0.5, 0.5, GRID) * length, np.linspace(-0.5, 0.5, GRID) * width
    w = modes.evaluate_grid(i, x, y)[0]
    dot = 6e3 / max(len(imported.points), 100)
    points.scatter(*(imported.points.T * MM), c=imported.values[i], s=dot, vmin=-1.0, vmax=1.0, **POINTS, **COLOURS)
    filled = shape.contourf(x * MM, y * MM, w.T, levels=np.linspace(-1.0, 1.0, 41), extend="both", **COLOURS)
    lines = shape.contour(x * MM, y * MM, w.T, levels=[0.0], colors="black", linewidths=1.2)
    cut_to_plate(shape, outline, filled, lines)
    cut_to_plate(points, outline)
    quality = imported.quality[i]
    points.set_title(f"mode {i + 1}: {modes.natural_frequency[i]:.0f} Hz, points", fontsize=8)
    shape.set_title(f"fitted, residual {quality.residual:.1g}", fontsize=8)
    for axes in (points, shape):
        margin = 0.02 * max(length, width) * MM
        axes.set(
            aspect="equal",
            xlim=(-0.5 * length * MM - margin, 0.5 * length * MM + margin),
            ylim=(-0.5 * width * MM - margin, 0.5 * width * MM + margin),
        )
    return filled


# Pictures of a plate's response: amplitude, current and power over the frequency; all mode shapes on one sheet.

MOST_LABELS = 12  # peaks of a response that get one, the highest
LABEL_SPACE = 0.083  # of the axis for each of them
SHEET_POINTS = 81  # per axis of a small mode shape
SHEET_COLUMNS = 8


def draw_response(response: Response, path: Path, *, title: str, point: tuple[float, float] | None) -> None:
    """Draw amplitude, current and power, and the impedance of the driven patches over the frequency.

    The highest peaks are named.
    """
    figure = empty_figure(9.0, 9.0)
    top, middle, bottom, modulus, phase, series = figure.subplots(6, 1, sharex=True, height_ratios=[3, 1, 1, 1, 1, 1])
    top.semilogy(response.frequency, response.amplitude * UM, color="#3a60be", linewidth=1.0)
    resonant = [peak for peak in response.peaks if not math.isnan(peak.damping_ratio)]
    named = sorted(sorted(resonant, key=lambda peak: -peak.amplitude)[:MOST_LABELS], key=lambda peak: peak.frequency)
    low, high = float(response.frequency[0]), float(response.frequency[-1])
    places = spaced([peak.frequency for peak in named], LABEL_SPACE * (high - low), low, high)
    for peak, place in zip(named, places, strict=True):
        top.plot(peak.frequency, peak.amplitude * UM, "o", color="#be3434", markersize=3)
        top.annotate(
            f"{peak.mode + 1}: {peak.frequency:.0f} Hz\n{peak.amplitude * UM:.3g} µm",
            (peak.frequency, peak.amplitude * UM),
            xytext=(place, 0.98),
            textcoords=("data", "axes fraction"),
            fontsize=6.5,
            ha="center",
            va="top",
            arrowprops={"arrowstyle": "-", "color": "0.7", "linewidth": 0.6},
        )
    location = "largest on the plate" if point is None else f"at ({point[0] * MM:g}, {point[1] * MM:g}) mm"
    top.set(ylabel=f"amplitude (µm), {location}", title=title)
    top.set_ylim(None, 20.0 * response.amplitude.max() * UM)  # the labels stand above the peaks
    middle.semilogy(response.frequency, np.abs(response.current.sum(axis=1)) * 1e3, color="#e08a1e", linewidth=1.0)
    middle.set(ylabel="current (mA)")
    bottom.semilogy(response.frequency, response.power, color="#3a8a5a", linewidth=1.0)
    bottom.semilogy(response.frequency, response.heat, color="0.6", linewidth=1.0)
    bottom.set(ylabel="power (W),\nceramic grey")
    resistance = response.impedance.real
    modulus.semilogy(response.frequency, np.abs(response.impedance), color="#5a4a8a", linewidth=1.0)
    modulus.set(ylabel="|Z| (ohm)")
    phase.plot(response.frequency, np.angle(response.impedance, deg=True), color="#5a4a8a", linewidth=1.0)
    phase.set(ylabel="phase (deg)")
    series.semilogy(response.frequency, resistance, color="#8a3a5a", linewidth=1.0)
    for peak in named:
        if math.isfinite(peak.resistive):
            at = int(np.abs(response.frequency - peak.resistive).argmin())
            series.plot(peak.resistive, resistance[at], "o", color="#be3434", markersize=3)
    series.set(ylabel="R (ohm)", xlabel="frequency (Hz)")
    for axes in (top, middle, bottom, modulus, phase, series):
        axes.grid(True, alpha=0.3)
        axes.set_xlim(response.frequency[0], response.frequency[-1])
    figure.savefig(path, dpi=150)


def draw_fit(sweep: Sweep, fit: SweepFit, path: Path, *, title: str) -> None:
    """Draw the series resistance of a patch, measured and fitted, over the frequency."""
    figure = empty_figure(9.0, 4.0)
    axes = figure.subplots()
    axes.semilogy(sweep.frequency, sweep.resistance, ".", color="0.6", markersize=2, label="measured")
    axes.semilogy(sweep.frequency, fit.resistance, color="#8a3a5a", linewidth=1.0, label="fitted")
    for resonance in fit.resonances:
        axes.axvline(resonance.frequency, color="#3a60be", linewidth=0.5)
    axes.set(xlabel="frequency (Hz)", ylabel="series resistance (ohm)", title=title)
    axes.legend(fontsize=8)
    axes.grid(True, alpha=0.3)
    figure.savefig(path, dpi=150)


def spaced(places: Sequence[float], least: float, low: float, high: float) -> list[float]:
    """Places in order, moved by as little as makes them at least so far apart, and within two ends."""
    groups: list[list[float]] = []  # of places that touch: each stands around the mean of where its own want to be
    for place in places:
        groups.append([place])
        while len(groups) > 1 and _first(groups[-1], least) < _first(groups[-2], least) + len(groups[-2]) * least:
            groups[-2:] = [groups[-2] + groups[-1]]
    positions = [_first(group, least) + i * least for group in groups for i in range(len(group))]
    for i in range(len(positions)):
        positions[i] = max(positions[i], low + (i + 0.5) * least)
    for i in range(len(positions)):
        positions[-1 - i] = min(positions[-1 - i], high - (i + 0.5) * least)
    return positions


def _first(group: Sequence[float], least: float) -> float:
    """Where the first of a group of neighbours stands."""
    return sum(group) / len(group) - 0.5 * (len(group) - 1) * least


def draw_gallery(mode_file: ModeFile, path: Path) -> None:
    """Draw all mode shapes of a plate on one sheet, with nodal lines, actuators and measured frequencies."""
    modes = mode_file.modes
    plate = modes.plate
    columns = min(SHEET_COLUMNS, len(modes))
    rows = math.ceil(len(modes) / columns)
    aspect = plate.width / plate.length
    figure = empty_figure(1.6 * columns, (1.6 * aspect + 0.35) * rows)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    x, y = (np.linspace(-0.5, 0.5, SHEET_POINTS) * side for side in (plate.length, plate.width))
    measured = {resonance.mode: resonance.frequency for resonance in mode_file.resonances}
    for index, axes in enumerate(grid):
        axes.set_axis_off()
        if index >= len(modes):
            continue
        w = modes.evaluate_grid(index, x, y)[0]
        levels = np.linspace(-1.0, 1.0, 21)
        filled = axes.contourf(x * MM, y * MM, w.T, levels=levels, cmap="RdBu_r", extend="both")
        lines = axes.contour(x * MM, y * MM, w.T, levels=[0.0], colors="black", linewidths=0.8)
        cut_to_plate(axes, modes.outline, filled, lines)
        for actuator in mode_file.actuators:
            _outline(axes, actuator.layer.corners() * MM)
        title = f"{index + 1}: {modes.natural_frequency[index]:.0f} Hz"
        if index in measured:
            title += f"\nmeasured {measured[index]:g}"
        axes.set_title(title, fontsize=6, color="#be3434" if index in measured else "black")
        axes.set_aspect("equal")
    figure.savefig(path, dpi=150)


def _outline(axes: Any, corners: Any) -> None:
    closed = np.vstack([corners, corners[:1]])
    axes.plot(closed[:, 0], closed[:, 1], color="#e08a1e", linewidth=1.0)


def draw_mode(modes: PlateModes, index: int, path: Path) -> None:
    """Draw the deflection of one mode (0-based index) with its nodal lines; the suffix of `path` is the file type."""
    plate = modes.plate
    x = np.linspace(-0.5, 0.5, 241) * plate.length
    y = np.linspace(-0.5, 0.5, 241) * plate.width
    w = modes.evaluate_grid(index, x, y)[0]
    figure = empty_figure(5.6, 4.8)
    axes = figure.add_subplot()
    levels = np.linspace(-1.0, 1.0, 41)
    filled = axes.contourf(x * MM, y * MM, w.T, levels=levels, cmap="RdBu_r", extend="both")
    lines = axes.contour(x * MM, y * MM, w.T, levels=[0.0], colors="black", linewidths=1.4)
    cut_to_plate(axes, modes.outline, filled, lines)
    figure.colorbar(filled, ax=axes, label="deflection, antinode = 1", ticks=[-1, -0.5, 0, 0.5, 1])
    axes.set(
        aspect="equal",
        xlabel="x (mm)",
        ylabel="y (mm)",
        title=f"Mode {index + 1}: {modes.natural_frequency[index]:.1f} Hz, nodal lines in black",
    )
    figure.savefig(path, dpi=150)


def draw_route(modes: PlateModes, route: Route, path: Path, *, y: float = 0.0) -> None:
    """Draw the profile of every mode of a route along its line at y [m], with the steps of the part as arrows."""
    n = len(route.steps)
    figure = empty_figure(6.4, 1.0 + 1.05 * n)
    x = np.linspace(-0.5, 0.5, 801) * modes.plate.length
    for row, (step, axes) in enumerate(
        zip(route.steps, figure.subplots(n, 1, sharex=True, squeeze=False)[:, 0], strict=True)
    ):
        w = modes.evaluate(step.mode, x, y)[0]
        antinode = np.abs(w).max()
        axes.axhline(0.0, color="0.7", linewidth=0.8)
        axes.plot(x * MM, w / antinode, color="#3a60be")
        axes.plot(x * MM, -w / antinode, color="#3a60be", linewidth=0.6, alpha=0.5)
        axes.annotate(
            "",
            (step.end * MM, 0.0),
            (step.start * MM, 0.0),
            arrowprops={"arrowstyle": "->", "color": "#be3434", "lw": 1.6},
        )
        axes.plot([step.end * MM], [0.0], "o", color="#be3434", markersize=5)
        axes.set(yticks=[], ylim=(-1.15, 1.15))
        axes.set_title(
            f"{row + 1}. mode {step.mode + 1}, {modes.natural_frequency[step.mode]:.0f} Hz, k = {step.k:.2f}",
            fontsize=9,
            loc="left",
        )
    axes.set_xlabel("x (mm)")
    figure.savefig(path, dpi=150)


def draw_ratios(rows: Sequence[RatioRoutes], path: Path) -> None:
    """Draw the largest k of the best sequence over the length-to-width ratio, a curve per largest number of modes."""
    figure = empty_figure(6.4, 4.0)
    axes = figure.add_subplot()
    for n_modes in sorted({len(route.steps) for row in rows for route in row.routes}):
        best = [
            min((route.largest_k for route in row.routes if len(route.steps) <= n_modes), default=np.nan)
            for row in rows
        ]
        axes.plot([row.ratio for row in rows], best, "o-", markersize=3, label=f"up to {n_modes} modes")
    axes.set(xlabel="length over width of the plate", ylabel="largest k of the best sequence", ylim=(0.0, 1.0))
    axes.set_xlim(rows[0].ratio, rows[-1].ratio)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=150)


def draw_wave(stage_wave: StageWave, path: Path) -> None:
    """Draw the amplitude of a wave with its still points and the track of its crest; beside it the wave along it."""
    x, y, field = stage_wave.wave.on_grid(241)
    figure = empty_figure(10.0, 4.6)
    left, right = figure.subfigures(1, 2, width_ratios=[1.1, 1.0])
    axes = left.add_subplot()
    amplitude, outline = np.abs(field), stage_wave.wave.surface.outline
    if outline is not None:  # what is beside the plate is cut off, and must not set the colours
        on_plate = outline.holds(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
        amplitude = np.minimum(amplitude, amplitude[on_plate].max())
    filled = axes.contourf(x * MM, y * MM, amplitude.T * UM, levels=30, cmap="Blues")
    left.colorbar(filled, ax=axes, label="amplitude (µm)")
    still = stage_wave.still
    cut_to_plate(axes, outline, filled)
    axes.plot(*(still.T * MM), "o", color="#be3434", markersize=6, label=f"{len(still)} still points")
    track = stage_wave.track
    if track is not None:
        axes.plot(*(np.vstack([track.points, track.points[:1]]).T * MM), color="#e08a1e", linewidth=2.0, label="crest")
        for i in range(0, len(track.points), len(track.points) // 8):
            ahead = -np.sign(track.turns) * track.tangent[i] * 8.0  # the crest moves against the gradient of the phase
            arrow = {"arrowstyle": "->", "color": "#e08a1e", "lw": 2.0}
            axes.annotate("", track.points[i] * MM + ahead, track.points[i] * MM, arrowprops=arrow)
        distance = np.linspace(0.0, track.length * MM, len(track.points) + 1)
        along, phase = right.subplots(2, 1, sharex=True)
        along.plot(distance, np.abs(np.append(track.amplitude, track.amplitude[0])) * UM, color="#e08a1e")
        along.set(ylabel="amplitude (µm)", ylim=(0.0, None))
        phase.plot(distance, track.phase_deg - track.phase_deg[0], color="#e08a1e")
        phase.set(xlabel="along the crest's track, counter-clockwise (mm)", ylabel="phase (deg)")
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    axes.legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=150)
