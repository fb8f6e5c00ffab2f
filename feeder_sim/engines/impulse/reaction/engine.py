"""Engine `impulse` over a plate that takes the impulses of the parts (`reaction = true`).

Windows, pairs and contacts are those of the engine over a plate with a prescribed motion. Here all parts advance
together, in order of time (crowd.py), as each impact changes the surface for all of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feeder_sim.engines.impulse.crowd import Window, WindowResult
from feeder_sim.engines.impulse.engine import ImpulseEngine
from feeder_sim.engines.impulse.frame_rows import FrameRows
from feeder_sim.engines.impulse.reaction.crowd import Limits, advance_reacting
from feeder_sim.engines.reaction import reaction_of, set_reaction, with_reaction
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.machine_code import lasting
from feeder_sim.scene.driven_mode import free_modes
from feeder_sim.scene.scene import Scene

WINDOW_OF_ONE = 5e-2  # [s], of a single part, which meets nobody; its impacts make the bounds anew often enough


class ReactingEngine(ImpulseEngine):
    """Rigid impulses that act on the plate as well.

    At the begin of the window under way: `_reaction_opened`, see `reaction_of`, and `_books_opened`, the energies [J]
    that parts have got from the plate's modes, from the contact law (negative) and by being put back on the surface.
    """

    _single_apart, _yields = False, True

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
        modes = free_modes(scene.driven)
        self._rate = modes.rate
        self._work[0].contacts.modes.inverse_mass[:] = 1.0 / modes.modal_mass
        self._surface = lasting(with_reaction(self._surface, self._rate))
        self._limits = self._limits_of(scene)
        self._reaction = self._reaction_opened = reaction_of(self._surface)
        self._account_opened = self._work[0].yielding.energy_account.copy()

    def _limits_of(self, scene: Scene) -> Limits:
        n = scene.surface.n_shapes
        return lasting(Limits(self._drive(self._window), np.zeros(n), np.zeros((n, 3))))

    def _place_at_begin(self) -> None:
        super()._place_at_begin()
        set_reaction(self._surface, self._reaction_opened)
        self._work[0].yielding.energy_account[:] = self._account_opened

    def _advance_share(self, window: Window, frames: FrameRows) -> WindowResult:
        """Advance all parts."""
        result = advance_reacting(window, self._parts, self._n, self._kinds, self._limits, self._tools[0], frames)
        self._reaction = self._limits.reaction.copy()
        return result

    def _keep_begin_of_window(self) -> None:
        super()._keep_begin_of_window()
        self._reaction_opened, self._account_opened = self._reaction, self._work[0].yielding.energy_account.copy()

    def redrive(self, scene: Scene) -> None:
        super().redrive(scene)
        self._surface = lasting(with_reaction(surface_arrays(scene), self._rate))
        self._limits = self._limits_of(scene)
