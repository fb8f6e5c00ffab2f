"""The cell of a mode in which a part starts: its antinode and the nodal lines around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.nodal_lines import NodalLines, antinode_near, nodal_lines
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import GivenState, Start
from feeder_sim.scene.scene import Scene

ROUND_OFF = 1e-9  # relative, of a distance
PASSAGE_FROM, PASSAGE_TO = 0.8, 0.2  # fractions of d0 between which the transport speed is measured
# Of the mode's largest deflection: of a point on a nodal line or on a crossing of two, and of the antinode of a cell.
ON_LINE, LEAST_ANTINODE = 1e-6, 0.05


@dataclass(frozen=True)
class Cell:
    """A transport cell: the antinode in whose cell a part starts, and the nodal lines to which it can drift.

    Attributes:
        antinode: shape (2,) [m].
        reach: d0, distance of the antinode to the nearest nodal line [m].
        lines: the nodal lines of the mode.
    """

    antinode: NDArray[np.float64]
    reach: float
    lines: NodalLines

    def distance_to_node(self, frames: Frames, part: int = 0) -> NDArray[np.float64]:
        """Distance of a part from the nearest nodal line over d0, shape (n,): 1 at the antinode, 0 at the node."""
        return self.lines.distance(frames.position[:, part, :2]) / self.reach

    def may_pass(self, frames: Frames, level: float, first: Frames, part: int = 0) -> NDArray[np.int64]:
        """Rows of frames in which a part may be at a fraction of d0: it has moved so far since `first`, a frame.

        Distances to the nodal lines are costly. They change by no more than the part moves, so that most frames need
        none.
        """
        moved = np.hypot(*(frames.position[:, part, :2] - first.position[0, part, :2]).T) / self.reach
        return np.flatnonzero(moved >= (1.0 - ROUND_OFF) * (self.distance_to_node(first, part)[0] - level))


def transport_cell(scene: Scene) -> Cell | None:
    """Find the cell in which the part of a scene starts.

    None where no transport speed is defined: with several parts or a schedule, without nodal lines, on a tray, or when
    the part starts on a nodal line.
    """
    start = scene.scenario.part[0].start
    is_tray, has_many_parts = scene.scenario.plate.kind == "tray", len(scene.parts) > 1
    if is_tray or has_many_parts or scene.scenario.schedule is not None or not isinstance(start, Start | GivenState):
        return None
    lines = nodal_lines(scene.surface)
    if not lines.lines:
        return None
    x, y = (1e-3 * value for value in start.position_mm[:2])
    if abs(scene.surface.deflection(0, np.array([[x, y]]))[0]) < ON_LINE:
        return None
    antinode = antinode_near(scene.surface, 0, (x, y))
    if abs(scene.surface.deflection(0, antinode[None])[0]) < LEAST_ANTINODE:
        return None
    return Cell(antinode, float(lines.distance(antinode[None])[0]), lines)


def check_stop_rule(scene: Scene, cell: Cell | None) -> None:
    """Refuse `run.stop = "passage"` where no passage can be measured.

    Raises:
        InputError: there is no transport cell, or the part starts nearer to the node than `PASSAGE_FROM`.
    """
    if scene.scenario.run.stop != "passage":
        return
    if cell is None:
        raise InputError(
            'is "passage", must be "time" where the plate has no nodal lines or the part starts on one',
            key="run.stop",
        )
    start = scene.scenario.part[0].start
    assert isinstance(start, Start | GivenState)  # transport_cell gives a cell for no other start
    x, y = start.position_mm[:2]
    fraction = float(cell.lines.distance(np.array([[x, y]]) * 1e-3)[0]) / cell.reach
    if fraction <= PASSAGE_FROM:
        raise InputError(
            f"is [{x:g}, {y:g}], {fraction:.2f} of the way from node to antinode, must be above {PASSAGE_FROM} "
            'with run.stop = "passage"',
            key="part[0].start.position_mm",
        )
