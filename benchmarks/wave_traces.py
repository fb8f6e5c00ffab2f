"""Traces of a quasi-travelling wave: how many points its crest runs round, in which sense, and which way nuts run.

    python benchmarks/wave_traces.py [--scenario FILE] [--picture FILE]
    python benchmarks/wave_traces.py --seeds 16 [--amplitudes 0.3 0.6 ...] [--phases 90 -90]

Every still point has a *cell*, from which the amplitude falls towards it. A cell that nowhere reaches the edge of the
plate is closed, and its outline, where the amplitude is largest all around, is a *trace* of the crest. On it the phase
changes by 360 degrees; the crest runs the way the phase falls.

With --seeds the nuts of the scenario, which lie scattered, are followed for `DURATION_S`. Their speed round the still
point of the closed cell that they are in, counter-clockwise positive, is a mean over the last three quarters of this
time. A column has the cells with a counter-clockwise crest at +90 degrees, another those with a clockwise one, each
with the standard error over the seeds. At -90 degrees all senses are the other way round. The amplitude is that at the
plate's corner, where it is largest.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from feeder_sim.document.figure import MM, empty_figure
from feeder_sim.measures.circulation import stage_waves
from feeder_sim.measures.statistic import Statistic
from feeder_sim.plate.wave import Track, Wave
from feeder_sim.pool.work import Work
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario, load_scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import build_scene

SCENARIO = Path(__file__).parents[1] / "scenarios" / "wave_nine_traces.toml"
AMPLITUDES = [0.3, 0.6, 1.2]
BASE_PHASE = 90.0  # [deg]; of the scenario, which says the sense of the cells
DURATION_S, COUNTED_FROM = 2.0, 0.25
SMOOTH = 9  # points of an outline, which follows the grid, that are averaged
GRID = 361  # points per axis
TURN_RADIUS = 2e-3  # [m]; of the circle on which the sense of an open cell is read
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """A still point and what lies around it.

    Attributes:
        point: the still point (2,) [m].
        sense: +1 where the crest runs round it counter-clockwise, -1 clockwise.
        trace: outline of the cell; None where it reaches the edge of the plate.
        inside: the points of the grid that belong to it (GRID, GRID).
    """

    point: Floats
    sense: int
    trace: Track | None
    inside: NDArray[np.bool_]


@dataclass(frozen=True)
class Cells:
    """The cells of a wave, and the grid (GRID,) [m] on which they lie."""

    wave: Wave
    x: Floats
    y: Floats
    cells: tuple[Cell, ...]

    @property
    def closed(self) -> list[Cell]:
        """Row by row from the top: still points come in no order of their own."""
        cells = [cell for cell in self.cells if cell.trace is not None]
        return sorted(cells, key=lambda cell: (-round(cell.point[1] * MM), round(cell.point[0] * MM)))


def cells_of(wave: Wave, still: Floats) -> Cells:
    """Divide the plate into the cells of still points (n, 2) [m]."""
    x, y, field = wave.on_grid(GRID)
    lowest = _lowest(np.abs(field))
    grid = np.stack([x[lowest // GRID], y[lowest % GRID]], axis=-1)
    nearest = np.linalg.norm(grid[:, :, None] - still, axis=-1).argmin(axis=-1)
    cells = []
    for k, point in enumerate(still):
        inside = nearest == k
        edge = np.ones_like(inside)
        edge[1:-1, 1:-1] = False
        trace = None if (inside & edge).any() else _outline(wave, x, y, inside)
        angle = np.linspace(0.0, 2.0 * math.pi, 73)
        circle = wave.at(point + TURN_RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        phase = np.unwrap(np.angle(circle))
        cells.append(Cell(point, -round(float(phase[-1] - phase[0]) / (2.0 * math.pi)), trace, inside))
    return Cells(wave, x, y, tuple(cells))


def _lowest(amplitude: Floats) -> NDArray[np.int64]:
    """The point of the grid, as an index, at which the way of steepest descent from each point ends."""
    n, m = amplitude.shape
    padded = np.pad(amplitude, 1, constant_values=math.inf)
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    # A step along a diagonal is longer, and its descent so much less steep.
    descent = [
        (amplitude - padded[1 + i : 1 + i + n, 1 + j : 1 + j + m]) / max(math.hypot(i, j), 1.0) for i, j in steps
    ]
    steepest = np.argmax(descent, axis=0)
    rows, columns = np.indices(amplitude.shape)
    shift = np.array(steps)[steepest]
    target = ((rows + shift[..., 0]) * m + columns + shift[..., 1]).ravel()
    while not np.array_equal(target, target[target]):
        target = target[target]
    return target.reshape(n, m)


def _outline(wave: Wave, x: Floats, y: Floats, inside: NDArray[np.bool_]) -> Track:
    """The outline of a cell as a closed line, counter-clockwise."""
    from contourpy import contour_generator

    lines = [np.asarray(line) for line in contour_generator(x, y, inside.T.astype(float)).lines(0.5)]
    line = max(lines, key=len)[:-1]
    rows = (np.arange(len(line))[:, None] + np.arange(SMOOTH) - SMOOTH // 2) % len(line)
    line = line[rows].mean(axis=1)
    ahead = np.roll(line, -1, axis=0)
    if (line[:, 0] * ahead[:, 1] - ahead[:, 0] * line[:, 1]).sum() < 0.0:
        line = line[::-1]
    tangent = np.roll(line, -2, axis=0) - np.roll(line, 2, axis=0)
    return Track(line, tangent / np.linalg.norm(tangent, axis=1, keepdims=True), wave.at(line))


def scenario_of(file: Path, amplitude: float, phase: float, seeds: int) -> Scenario:
    """The scenario at another amplitude [um] and phase [deg], as long as it takes."""
    raw = load_scenario(file).model_dump(exclude_none=True)
    stage = raw["schedule"]["stage"][0]
    first, second = stage["drive"]
    first["amplitude_um"] = second["amplitude_um"] = amplitude
    second["phase_deg"], stage["duration_s"] = phase, DURATION_S
    raw["run"]["seeds"] = seeds
    return validated(raw, Scenario, file)


def speeds(cells: Cells, frames: Frames, sense: int) -> float:
    """Mean speed [mm/s] of the nuts in closed cells of a sense round their still points, counter-clockwise."""
    rows = np.flatnonzero(frames.time >= COUNTED_FROM * DURATION_S)
    before, after = frames.position[rows[:-1], :, :2], frames.position[rows[1:], :, :2]
    velocity = (after - before) / np.diff(frames.time[rows])[:, None, None]
    index = [
        np.clip(np.rint((before[..., k] - axis[0]) / (axis[1] - axis[0])).astype(int), 0, GRID - 1)
        for k, axis in enumerate((cells.x, cells.y))
    ]
    parts = []
    for cell in cells.closed:
        if cell.sense == sense:
            inside = cell.inside[index[0], index[1]]
            arm = (before - cell.point)[inside]
            arm /= np.maximum(np.linalg.norm(arm, axis=1, keepdims=True), 1e-9)
            parts.append(arm[:, 0] * velocity[inside][:, 1] - arm[:, 1] * velocity[inside][:, 0])
    seen = np.concatenate(parts)
    return 1e3 * float(seen.mean()) if len(seen) else math.nan


def draw(cells: Cells, path: Path) -> None:
    """Draw the amplitude, the still points, and every trace with arrows that go with the crest."""
    figure = empty_figure(6.4, 5.4)
    axes = figure.add_subplot()
    amplitude = np.abs(cells.wave.on_grid(GRID)[2])
    filled = axes.contourf(
        cells.x * MM, cells.y * MM, amplitude.T / amplitude.max(), levels=np.linspace(0, 1, 13), cmap="Greys"
    )
    figure.colorbar(filled, ax=axes, label="amplitude over the largest")
    names = {1: ("#be3434", "counter-clockwise"), -1: ("#3a60be", "clockwise")}
    for sense, (colour, name) in names.items():
        both = [cell for cell in cells.cells if cell.sense == sense]
        axes.plot(*(np.array([c.point for c in both]).T * MM), "o", color=colour, markersize=4)
        for k, cell in enumerate(cell for cell in both if cell.trace is not None):
            assert cell.trace is not None
            # Neighbours share a trace: each is drawn a little inside its own cell.
            ring = (cell.point + 0.9 * (np.vstack([cell.trace.points, cell.trace.points[:1]]) - cell.point)) * MM
            axes.plot(*ring.T, color=colour, linewidth=1.8, label=name if k == 0 else None)
            for i in range(len(ring) // 8, len(ring) - 1, len(ring) // 4):
                ahead = cell.sense * cell.trace.tangent[i] * 6.0
                arrow = {"arrowstyle": "->", "color": colour, "lw": 1.8}
                axes.annotate("", ring[i] + ahead, ring[i], arrowprops=arrow)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    figure.legend(loc="outside upper center", ncols=2, fontsize=8)
    figure.savefig(path, dpi=110)


def print_cells(cells: Cells) -> None:
    closed = cells.closed
    for title, group in (("still points", cells.cells), ("traces", closed)):
        turns = [cell.sense for cell in group]
        print(f"{title}: {len(turns)}, {turns.count(1)} counter-clockwise, {turns.count(-1)} clockwise")
    print("\n| still point (mm) | crest | length (mm) | phase turns | amplitude ratio | travelling ratio |")
    print("|---|---|---|---|---|---|")
    for cell in closed:
        assert cell.trace is not None
        x, y = (round(c, 1) + 0.0 for c in (cell.point * MM).tolist())
        trace, word = cell.trace, "counter-clockwise" if cell.sense > 0 else "clockwise"
        ratios = f"{trace.amplitude_ratio:.2f} | {trace.travelling_ratio:+.2f}"
        print(f"| {x:.1f}, {y:.1f} | {word} | {trace.length * MM:.0f} | {trace.turns:+d} | {ratios} |")


def print_speeds(cells: Cells, options: argparse.Namespace) -> None:
    print(f"\nspeed round still points (mm/s), counter-clockwise, {options.seeds} seeds, mean +- SE")
    print(
        f"cells by the sense of their crest at {BASE_PHASE:+g} degrees; at {-BASE_PHASE:+g} degrees it is the other\n"
    )
    print("| amplitude (um) | phase (deg) | counter-clockwise cells | clockwise cells |\n|---|---|---|---|")
    for amplitude in options.amplitudes:
        for phase in options.phases:
            scenario = scenario_of(options.scenario, amplitude, phase, options.seeds)
            result = simulate(scenario, work=Work(options.workers))
            both = [Statistic.of(speeds(cells, frames, sense) for frames in result.trajectories) for sense in (1, -1)]
            cols = " | ".join(f"{s.mean:+.3f} +- {s.se or math.nan:.3f}" for s in both)
            print(f"| {amplitude:g} | {phase:+g} | {cols} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", type=Path, default=SCENARIO)
    parser.add_argument("--seeds", type=int, default=0, help="of runs with nuts; none by default")
    parser.add_argument("--amplitudes", type=float, nargs="+", default=AMPLITUDES)
    parser.add_argument("--phases", type=float, nargs="+", default=[BASE_PHASE, -BASE_PHASE])
    parser.add_argument("--workers", type=int, help="processes of a run; all processors by default")
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    waves = stage_waves(build_scene(load_scenario(options.scenario)))
    cells = cells_of(waves[0].wave, waves[0].still)
    print_cells(cells)
    if options.picture:
        draw(cells, options.picture)
    if options.seeds:
        print_speeds(cells, options)


if __name__ == "__main__":
    main()
