"""Numbers from trajectories. Contact motion is chaotic, so every figure is an ensemble mean with its interval.

*Transport speed*: a cell of the mode reaches from an antinode to the nearest nodal line, d0 away. The speed of a seed
is 0.6 d0 divided by the time between the first passages of distance 0.8 d0 and 0.2 d0 from the nodal line.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.nodal_lines import NodalLines, antinode_near, nodal_lines
from feeder_sim.scenario import Start
from feeder_sim.scene import Scene
from feeder_sim.trajectory import Frames

PASSAGE_FROM, PASSAGE_TO = 0.8, 0.2
LEAST_ANTINODE = 0.05  # of the mode's largest deflection: less than this is a nodal line or a crossing of two


@dataclass(frozen=True)
class Statistic:
    """Ensemble mean with standard deviation and standard error; NaN where n is too small for one."""

    mean: float
    sd: float
    se: float
    n: int

    @staticmethod
    def of(values: Iterable[float]) -> Statistic:
        """Statistic of the finite values."""
        finite = [value for value in values if math.isfinite(value)]
        n = len(finite)
        mean = float(np.mean(finite)) if n else math.nan
        sd = float(np.std(finite, ddof=1)) if n > 1 else math.nan
        return Statistic(mean, sd, sd / math.sqrt(n) if n > 1 else math.nan, n)

    def as_dict(self) -> dict[str, float | int | None]:
        """For JSON, where NaN does not exist."""
        values = {"mean": self.mean, "sd": self.sd, "se": self.se}
        return {name: v if math.isfinite(v) else None for name, v in values.items()} | {"n": self.n}


@dataclass(frozen=True)
class Cell:
    """The antinode a part starts from and the nodal lines it can drift to.

    Attributes:
        antinode: shape (2,) [m].
        reach: d0, distance of the antinode to the nearest nodal line [m].
        lines: the nodal lines.
    """

    antinode: NDArray[np.float64]
    reach: float
    lines: NodalLines

    def way(self, frames: Frames, part: int = 0) -> NDArray[np.float64]:
        """Distance of a part from the nearest nodal line over d0 at each frame: 1 at the antinode, 0 at the node."""
        return self.lines.distance(frames.position[:, part, :2]) / self.reach


def transport_cell(scene: Scene) -> Cell | None:
    """Find the cell that the first part of a scene starts in; None when it starts in none.

    That is when there are more parts or modes to come, the mode has no nodal lines, or the part starts on one.
    """
    start = scene.scenario.part[0].start
    if len(scene.parts) > 1 or scene.scenario.schedule is not None or not isinstance(start, Start):
        return None
    lines = nodal_lines(scene.surface)
    if not lines.lines:
        return None
    x, y = start.position_mm
    antinode = antinode_near(scene.surface, 0, (x * 1e-3, y * 1e-3))
    if abs(scene.surface.deflection(0, antinode[None])[0]) < LEAST_ANTINODE:
        return None
    return Cell(antinode, float(lines.distance(antinode[None])[0]), lines)


def check_stop_rule(scene: Scene, cell: Cell | None) -> None:
    """Refuse `run.stop = "passage"` where no passage can be measured.

    Raises:
        InputError: there is no nodal line, or the part starts past the start line.
    """
    if scene.scenario.run.stop != "passage":
        return
    if cell is None:
        raise InputError(
            'is "passage", allowed is "time" where the plate has no nodal lines or the part starts on one',
            key="run.stop",
        )
    start = scene.scenario.part[0].start
    assert isinstance(start, Start)  # else there is no cell
    x, y = start.position_mm
    way = float(cell.lines.distance(np.array([[x, y]]) * 1e-3)[0]) / cell.reach
    if way <= PASSAGE_FROM:
        raise InputError(
            f"is [{x:g}, {y:g}], {way:.2f} of the way from node to antinode, allowed is above {PASSAGE_FROM} "
            'with run.stop = "passage"',
            key="part[0].start.position_mm",
        )


def first_passage(time: NDArray[np.float64], way: NDArray[np.float64], level: float) -> float:
    """Time [s] at which `way` first falls to `level`, between frames by interpolation; NaN if it never does."""
    below = np.flatnonzero(way <= level)
    if not len(below):
        return math.nan
    i = int(below[0])
    if i == 0:
        return float(time[0])
    fraction = (way[i - 1] - level) / (way[i - 1] - way[i])
    return float(time[i - 1] + fraction * (time[i] - time[i - 1]))


def transport_speed(
    frames: Frames, cell: Cell, *, start: float = PASSAGE_FROM, end: float = PASSAGE_TO, part: int = 0
) -> float:
    """Speed [m/s] of one seed between two fractions of the way; NaN if the part never got there."""
    way = cell.way(frames, part)
    if not len(way) or way[0] < start:  # it did not pass the start line
        return math.nan
    duration = first_passage(frames.time, way, end) - first_passage(frames.time, way, start)
    return (start - end) * cell.reach / duration if duration > 0 else math.nan


def drift_velocity(frames: Frames, *, part: int = 0) -> NDArray[np.float64]:
    """Mean horizontal velocity [m/s] of one seed over the whole recording, shape (2,)."""
    elapsed = frames.time[-1] - frames.time[0]
    if not elapsed > 0:
        return np.full(2, math.nan)
    return (frames.position[-1, part, :2] - frames.position[0, part, :2]) / elapsed


def highest_rise(frames: Frames, *, part: int = 0) -> float:
    """Largest height of a part's centre above its lowest recorded one [m]: the highest hop, drop included."""
    z = frames.position[:, part, 2]
    return float(z.max() - z.min())


def ensemble_measures(seeds: Sequence[Frames], cell: Cell | None) -> dict[str, object]:
    """The measures of a run by name, units in the name; see the functions above for definitions."""
    drift = [drift_velocity(frames) * 1e3 for frames in seeds]
    speeds = [transport_speed(frames, cell) * 1e3 for frames in seeds] if cell else []
    return {
        "transport_speed_mm_s": Statistic.of(speeds).as_dict(),
        "drift_velocity_x_mm_s": Statistic.of(v[0] for v in drift).as_dict(),
        "drift_velocity_y_mm_s": Statistic.of(v[1] for v in drift).as_dict(),
        "arrived": sum(math.isfinite(speed) for speed in speeds),
        "highest_rise_mm": Statistic.of(highest_rise(frames) * 1e3 for frames in seeds).as_dict(),
        "antinode_to_node_mm": cell.reach * 1e3 if cell else None,
    }
