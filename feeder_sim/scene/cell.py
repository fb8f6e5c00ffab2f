"""The cell of a mode in which a part starts: from its antinode to the nodal lines it can drift to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import InputError
from feeder_sim.plate.nodal_lines import NodalLines, antinode_near, nodal_lines
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Start
from feeder_sim.scene.scene import Scene

PASSAGE_FROM, PASSAGE_TO = 0.8, 0.2  # of the way from node to antinode, between which transport is measured
LEAST_ANTINODE = 0.05  # of the mode's largest deflection: less than this is a nodal line or a crossing of two


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
