"""The slide behind the engine protocol."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impact_log import new_log, take_impacts
from feeder_sim.engines.noise import new_streams
from feeder_sim.engines.slide.motion import Law, Plate, V, Z, advance
from feeder_sim.records.seed import Counts, Events, joined
from feeder_sim.records.trajectory import BLOCK_FRAMES, Frames
from feeder_sim.scene.scene import Scene
from feeder_sim.scene.start import Pose, start_poses

LOG_ROWS = 20_000


class SlideEngine:
    """A part on a slide behind the engine protocol; part of the engine `impulse`.

    Neither mass nor shape matter: the plate is driven, and the part does not turn.
    """

    name = "impulse"
    frames_per_block = 6 * BLOCK_FRAMES

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        *,
        threads: int = 1,
        interrupt: NDArray[np.int64] | None = None,
    ) -> None:
        del threads, interrupt  # one coordinate needs one, and is soon done
        (pose,) = start_poses(scene, rng)
        guide = scene.guides[0]
        assert guide is not None
        self._scene, self._pose, self._axis = scene, pose, guide.axis
        up, down = guide.deceleration(GRAVITY)
        contact, tolerance = scene.scenario.contact, 1e-9 * scene.scenario.tolerance
        self._law = Law(up, down, contact.coefficient, contact.noise_m_s, tolerance)
        self._stream = new_streams(rng, 1)
        self._plate = _plate(scene)
        self._lowest = scene.parts[0].lowest(pose.quaternion)  # below the centre
        self._state = np.array([0.0, pose.position[2] + self._lowest, 0.0, 0.0, 0.0, 0.0])
        self._row = self._state[None, [Z, V]]
        self._log = new_log(LOG_ROWS)
        self._impacts: list[Events] = []
        self._frame = 0

    @property
    def counts(self) -> Counts:
        return Counts()

    def current(self) -> Frames:
        return self._frames(self._row, self._frame)

    def advance(self, n_frames: int) -> Frames:
        out = np.empty((n_frames, 2))
        interval, done = self._scene.frame_interval, 0
        while done < n_frames:
            arguments = (self._state, self._stream, self._plate, self._law, self._log, interval, self._frame + done)
            done += advance(*arguments, out[done:])
            if done < n_frames:
                self._impacts.append(take_impacts(self._log, end=False))
        self._frame += n_frames
        self._row = out[-1:].copy()
        return self._frames(out, self._frame - n_frames + 1)

    def take_impacts(self, *, end: bool) -> Events:
        impacts = joined([*self._impacts, take_impacts(self._log, end=end)])
        self._impacts = []
        return impacts

    def remove(self, parts: NDArray[np.int64]) -> None:
        raise NotImplementedError("nothing takes a part off its slide")

    def add(self, parts: NDArray[np.int64], poses: Sequence[Pose]) -> None:
        raise NotImplementedError("nothing puts a part on a slide")

    def redrive(self, scene: Scene) -> None:
        self._scene, self._plate = scene, _plate(scene)

    def _frames(self, rows: NDArray[np.float64], first: int) -> Frames:
        """Heights and vertical velocities (n, 2) as motion along the axis of the guide."""
        n, along = len(rows), self._axis / self._axis[2]
        start = self._pose.position + along * (rows[:, :1] - self._lowest - self._pose.position[2])
        return Frames(
            time=np.asarray((first + np.arange(n)) * self._scene.frame_interval, float),
            position=start[:, None],
            quaternion=np.tile(self._pose.quaternion, (n, 1, 1)),
            velocity=(along * rows[:, 1:])[:, None],
            angular_velocity=np.zeros((n, 1, 3)),
            present=np.ones((n, 1), bool),
        )


def _plate(scene: Scene) -> Plate:
    """The plate's motion under the part; on a piston the same everywhere."""
    terms = scene.surface.terms
    size, rate = np.abs(terms.coefficient), np.abs(terms.rate)
    switch = np.unique(np.concatenate([terms.start, terms.stop, [np.inf]]))
    bound = np.array([(size * rate**k).sum() for k in range(5)])
    return Plate(terms.start, terms.stop, terms.coefficient, terms.rate, switch, bound)
