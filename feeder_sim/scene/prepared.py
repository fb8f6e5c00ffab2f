"""A scenario that is ready to run: made once by `feeder_sim.run.prepare`, and handed on."""

from __future__ import annotations

from dataclasses import dataclass

from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import Choice
from feeder_sim.scene.cell import Cell
from feeder_sim.scene.scene import Scene


@dataclass(frozen=True)
class Prepared:
    """What everything that runs or measures a scenario goes by.

    Attributes:
        scene: in SI units.
        engine: which one, and why.
        cell: the cell that the one part of the scene starts in; None where no transport is measured.
        cautions: settings that are known to mislead, a line each.
    """

    scene: Scene
    engine: Choice
    cell: Cell | None
    cautions: tuple[str, ...]

    @property
    def scenario(self) -> Scenario:
        """What it was made from."""
        return self.scene.scenario
