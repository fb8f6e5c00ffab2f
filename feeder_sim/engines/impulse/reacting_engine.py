"""Engine `impulse` over a plate that takes the impulses of the parts (`reaction = true`).

Windows, pairs and contacts are those of the engine over a plate with a prescribed motion. Here all parts advance
together, in order of time, as one island (island.py), as each impact changes the surface for all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.contact_problem import Modes
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.frame_rows import FrameRows
from feeder_sim.engines.impulse.island import Crowd, Span, advance_together
from feeder_sim.engines.impulse.state import Bounds, Plate
from feeder_sim.engines.impulse.yielding import Yielding
from feeder_sim.engines.impulse.yielding_bounds import open_yielding_window
from feeder_sim.engines.reaction import reaction_of, set_reaction, with_reaction
from feeder_sim.engines.surface_arrays import SurfaceArrays, surface_arrays
from feeder_sim.scene.free_modes import free_modes
from feeder_sim.scene.scene import Scene

WINDOW_OF_ONE = 5e-2  # [s], of a single part, which meets nobody; its impacts make the bounds anew often enough


class ReactingEngine(ImpulseEngine):
    """Rigid impulses that act on the plate as well.

    Its state holds more than that of `ImpulseEngine`: `reaction`, see `reaction_of`, and `books`, the energies [J] that
    parts have got from the plate's modes and from the contact law (negative).
    """

    _reacts = True

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        del threads  # impacts act on the plate in order of time
        super().__init__(scene, rng, interrupt=interrupt)
        if self._n == 1 and not scene.rim:
            self._window = WINDOW_OF_ONE
        modes, n = free_modes(scene.driven), scene.surface.n_shapes
        self._rate = modes.rate
        contacts = len(self._work[0].row_of)
        room = Modes(1.0 / modes.modal_mass, np.zeros((contacts, n, 3)), np.zeros(n))
        self._yielding = Yielding(room, scene.surface.extremes, np.zeros(n), np.zeros(n, complex), np.zeros(2))
        self._surface = with_reaction(self._surface, self._rate)
        self._reaction = self._reaction_opened = reaction_of(self._surface)
        self._books_opened = self._yielding.books.copy()

    def _open_window(self, parts: NDArray[np.void]) -> tuple[SurfaceArrays, Bounds, float]:
        start, end = self._span
        set_reaction(self._surface, self._reaction_opened)
        place = self._kinds, self._surface, (start, end), self._yielding, self._exact
        return open_yielding_window(parts, self._n, *place)

    def _advance_islands(self, crowd: Crowd, plate: Plate, span: Span, frames: FrameRows) -> bool:
        """Advance all parts from the begin of the window; it may have been computed before."""
        set_reaction(plate.surface, self._reaction_opened)
        self._yielding.books[:] = self._books_opened
        bounds = plate.bounds._replace(acceleration=plate.bounds.acceleration.copy())  # which are made anew
        yielding = self._yielding._replace(margin=self._yielding.margin.copy())  # likewise
        all_ends = {"first_part": [0, len(crowd.islands.part)], "first_pair": [0, len(crowd.islands.pair)]}
        islands = crowd.islands._replace(**{name: np.array(ends) for name, ends in all_ends.items()})
        together, opened = crowd._replace(islands=islands), Plate(plate.surface, bounds)
        left = advance_together(together, opened, self._tools[0], span, frames, yielding)
        self._reaction = reaction_of(plate.surface)
        return bool(left)

    def _keep_begin_of_window(self) -> None:
        super()._keep_begin_of_window()
        self._reaction_opened, self._books_opened = self._reaction, self._yielding.books.copy()

    def redrive(self, scene: Scene) -> None:
        super().redrive(scene)
        self._surface = with_reaction(surface_arrays(scene.surface, scene.scenario.run), self._rate)
        self._yielding = self._yielding._replace(extremes=scene.surface.extremes)

    def state(self) -> dict[str, NDArray[Any]]:
        return super().state() | {"reaction": self._reaction_opened.copy(), "books": self._books_opened.copy()}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        self._reaction = self._reaction_opened = state["reaction"].copy()
        self._books_opened = state["books"].copy()
        self._yielding.books[:] = self._books_opened
        super().restore(state)
