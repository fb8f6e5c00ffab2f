"""A scenario that is ready to run. `feeder_sim.run.prepare` makes it, once for all seeds and measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from feeder_sim.notebook import block, counted
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.engine_choice import TRACKED, Choice
from feeder_sim.scene.cell import Cell
from feeder_sim.scene.scene import Scene

if TYPE_CHECKING:
    from feeder_sim.measures.protocol import Measure


@dataclass(frozen=True, repr=False)
class Prepared:
    """Everything that is decided before a run.

    Attributes:
        scene: the scenario in SI units.
        engine: the engine, its method, and the reason for the choice.
        cell: the transport cell in which the only part of the scene starts; None where no transport is measured.
        warnings: settings that are known to mislead, a line each.
        measures: that are taken besides those of the package.
    """

    scene: Scene
    engine: Choice
    cell: Cell | None
    warnings: tuple[str, ...]
    measures: tuple[Measure[Any, Any], ...] = ()

    def __repr__(self) -> str:
        title = f" {self.scenario.title!r}" if self.scenario.title else ""
        items = [f"engine {self.engine.name}", f"step {1e6 * self.scene.timestep:.3g} us"]
        return f"<Prepared{title}: {', '.join([*items, counted(len(self.warnings), 'warning')])}>"

    def _repr_html_(self) -> str:
        return block(repr(self)[1:-1], [self.engine.reason, *(f"warning: {warning}" for warning in self.warnings)])

    @property
    def is_tracked(self) -> bool:
        """Whether its seeds were seen from above by a camera: x, y and the turn about z of parts, nothing else."""
        return self.engine == TRACKED

    @property
    def scenario(self) -> Scenario:
        """The scenario from which the scene was built."""
        return self.scene.scenario
