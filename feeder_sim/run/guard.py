"""Finds states that no part over a vibrating plate can have, which means that its simulation has diverged.

Violations, in the order in which they count where one frame has several:

    a state that is not finite
    a centre below the plate's surface: the part went through the plate between two steps
    more energy than the plate can give (energy.py)
    a corner deeper in the plate than allowed (`depth`, `depth_limit`)

Parts that have left the plate are treated in plate_edge.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import Divergence, SimulationDiverged
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.surface import Surface
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.energy import Energy, largest_at_once
from feeder_sim.run.plate_edge import PlateEdge
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import GRAVITY, Scene

Floats = NDArray[np.float64]


class Violation(NamedTuple):
    """One kind of violation in a block of frames.

    Attributes:
        divergence: its kind.
        where: frames and parts with it, shape (n, parts).
        detail: values and limits for one frame and part, in words.
    """

    divergence: Divergence
    where: NDArray[np.bool_]
    detail: Callable[[int, int], str]


class Depths(NamedTuple):
    """How deep the parts are in the plate, all of shape (frames, parts).

    Attributes:
        speed: largest of a point of the part [m/s], see `Guard._speeds`.
        depth: of its deepest corner [m].
        allowed: largest depth [m].
        clear: away from the edge, and not too deep.
    """

    speed: Floats
    depth: Floats
    allowed: Floats
    clear: NDArray[np.bool_]


class Guard:
    """Checks one seed, block after block of frames; parts that have been taken out do not count.

    Args:
        prepared: what is simulated.
        first: frames with the state at the start.
    """

    # Limit over `energy_limit`. The largest ratio seen is 1.04, in all scenarios, both engines, heaps, elastic parts.
    ENERGY_FACTOR = 10.0
    # Limit of the depth, in steps times speed. The largest depths seen are 0.5 steps of a single part, and 3.3 steps of
    # the falling parts where a heap is poured onto nuts at rest. Each is a third of what `depth_limit` allows there.
    # The impulse engine does not find a corner any more that is 200 um deep.
    DEPTH_STEPS = 2.0
    DEPTH_FRACTION = 0.05  # of the amplitude, added to the limit
    HEAP_DEPTH = 1e-4  # [m], added for several parts; 80 um seen at the bottom of a poured heap, whose parts overlap
    DEPTH_FLOOR = 1e-5  # [m], smallest limit; twice what a part enters in a flight of the impulse engine at any step

    def __init__(self, prepared: Prepared, first: Frames) -> None:
        self._scene = scene = prepared.scene
        amplitude = np.array([drive.amplitude for drive in scene.drives])
        self._amplitude = largest_at_once(scene, amplitude)
        self._crest = float(amplitude.sum())
        self._energy = Energy(scene, first)
        self._edge = PlateEdge(scene, first, self._crest)
        self._antinode = scene.surface.extremes[0]
        self._tangent = scene.scenario.run.tangent_surface or prepared.engine.name == "mujoco"
        self._sizes = np.array([kind.size for kind in scene.kinds])[scene.kind_of]
        # At the last frame of the block before:
        self._last_speeds = self._speeds(first)[-1]
        self._last_clear = self._edge.clear_of(first)[-1]
        self._checked: Depths | None = None  # of the block that was checked last

    def redrive(self, scene: Scene) -> None:
        """Go on in the same scene, in which drives stop at other times."""
        self._scene = scene

    def check(self, frames: Frames, seed_index: int) -> tuple[int, SimulationDiverged | None]:
        """Return the number of leading frames that are valid, and the failure of the frame after them if there is one.

        `seed_index` is for the message.
        """
        n_valid, failure = len(frames), None
        with np.errstate(over="ignore", invalid="ignore"):  # of states that have exploded
            for violation in self._violations(frames):
                row = int(np.argmax(violation.where.any(axis=1))) if violation.where.any() else n_valid
                if row < n_valid:
                    part = int(np.argmax(violation.where[row]))
                    n_valid, failure = row, (violation.divergence, part, violation.detail(row, part))
        if failure is None:
            return n_valid, None
        divergence, part, detail = failure
        time, name = float(frames.time[n_valid]), self._scene.parts[part].name
        return n_valid, SimulationDiverged(divergence, time_s=time, part=name, seed=seed_index, detail=detail)

    def fallen(self, frames: Frames) -> NDArray[np.bool_]:
        """Frames and parts (n, parts) that have fallen beside the plate; see `PlateEdge.fallen`."""
        return self._edge.fallen(frames)

    def lost(self, frames: Frames) -> NDArray[np.bool_]:
        """Frames and parts (n, parts) that are off the plate and below the floor level."""
        return self._edge.lost(frames)

    def remember(self, frames: Frames) -> None:
        """Go on to the next block; frames: what is kept of the one that was checked last, or all before a break."""
        if len(frames):
            if self._checked is None:
                last = frames[slice(-2, None)]  # with the one before it, from which a part has come
                depths, row = self._depths(last, _rotations(last.quaternion)), -1
            else:
                depths, row = self._checked, len(frames) - 1
            self._last_speeds, self._last_clear = depths.speed[row], depths.clear[row]
            self._edge.remember(frames)
        self._checked = None

    def energy(self, frames: Frames) -> Floats:
        """Kinetic energy of translation and spin, and potential energy over the resting plate [J], shape (n, parts)."""
        return self._energy.of(frames, _rotations(frames.quaternion))

    def energy_limit(self, time: Floats) -> Floats:
        """Largest energy [J] that a part can have at times (n,) [s], shape (n, parts); see `Energy.limit`."""
        return self._energy.limit(time)

    def depth(self, frames: Frames, needed: Floats | float = 0.0) -> Floats:
        """Depth of the deepest corner of each part below the plate's surface [m], shape (n, parts); 0 above it.

        It is also 0 for parts near the plate's edge, which may touch it with points that are no corners, and tip over.
        With `needed`, depths below that may come out as 0 as well, which saves most of the work.
        """
        return self._depth(frames, _rotations(frames.quaternion), needed)

    def _depth(self, frames: Frames, rotation: Floats, needed: Floats | float) -> Floats:
        """`depth` with the rotation matrices (n, parts, 3, 3) of the parts."""
        depth = np.zeros(frames.present.shape)
        surface, position = self._scene.surface, frames.position
        q = _coordinates(surface, frames.time)
        highest = (np.abs(q) @ self._antinode)[:, None] - needed  # no corner above this height is that deep
        checked = frames.present & self._edge.clear_of(frames)
        for number, kind in enumerate(self._scene.kinds):
            of_kind = np.flatnonzero(self._scene.kind_of == number)
            lowest = (rotation[:, of_kind, 2] @ kind.corners.T).min(axis=-1) - kind.corner_radius
            low = lowest + position[:, of_kind, 2] < np.broadcast_to(highest, depth.shape)[:, of_kind]
            rows, columns = np.nonzero(checked[:, of_kind] & low)
            parts = of_kind[columns]
            corners = position[rows, parts, None] + np.einsum("kij,cj->kci", rotation[rows, parts], kind.corners)
            if len(rows):
                height = self._surface_height(corners, position[rows, parts], q[rows])
                depth[rows, parts] = (height - corners[..., 2]).max(axis=1) + kind.corner_radius
        return np.maximum(depth, 0.0)

    def depth_limit(self, frames: Frames) -> Floats:
        """Largest depth [m] that a corner may have below the plate's surface, shape (n, parts).

        Both engines let a corner enter by the distance that it moves in a step. Its speed between two frames is at most
        the larger of those that a part can reach from the frame before and from this one.
        """
        return self._depth_limit(frames, self._speeds(frames))

    def _depth_limit(self, frames: Frames, speed: Floats) -> Floats:
        """`depth_limit` with the largest speeds (n, parts) of the parts [m/s]."""
        speed = np.maximum(speed, np.concatenate([self._last_speeds[None], speed[:-1]]))
        steps = self.DEPTH_STEPS * self._scene.timestep
        allowed = self.DEPTH_FLOOR + self.DEPTH_FRACTION * self._amplitude + steps * speed
        if speed.shape[1] > 1:  # a part may be pushed into the plate by others that fall or lie on it
            over_plate = frames.present & self._edge.over(frames.position)
            allowed = allowed + self.HEAP_DEPTH + steps * np.where(over_plate, speed, 0.0).max(axis=1, keepdims=True)
        contact = self._scene.scenario.contact
        if contact.time_constant_us is not None:  # a spring-damper brakes within its time constant, and sags
            time_constant = 1e-6 * contact.time_constant_us
            allowed = allowed + time_constant * (speed + GRAVITY * contact.damping_ratio**2 * time_constant)
        return np.asarray(allowed)

    def _violations(self, frames: Frames) -> Iterator[Violation]:
        """Every kind of violation in a block, in the order in which they count."""
        states = (frames.position, frames.quaternion, frames.velocity, frames.angular_velocity)
        finite = np.logical_and.reduce([np.isfinite(state).all(axis=-1) for state in states])
        present, fallen = frames.present & finite, self._edge.fallen(frames)
        yield Violation(Divergence.NOT_FINITE, frames.present & ~finite, lambda row, part: "")
        below = present & self._edge.over(frames.position) & ~fallen & (frames.position[..., 2] < -self._crest)
        yield Violation(Divergence.THROUGH_PLATE, below, lambda row, part: "")
        rotation = _rotations(frames.quaternion)
        # A part that has fallen may have hit the side of the plate; one that is just being thrown off still counts.
        fallen_before = np.concatenate([self._edge.last_fallen[None], fallen[:-1]])
        yield self._too_much_energy(frames, rotation, present & ~fallen_before)
        yield self._too_deep(frames, rotation, present)

    def _too_much_energy(self, frames: Frames, rotation: Floats, counted: NDArray[np.bool_]) -> Violation:
        """Where the energy exceeds its limit, among the frames and parts (n, parts) that count."""
        energy, limit = self._energy.of(frames, rotation), self.ENERGY_FACTOR * self._energy.limit(frames.time)

        def detail(row: int, part: int) -> str:
            return (
                f"its energy of {energy[row, part]:.2g} J exceeds {limit[row, part]:.2g} J, "
                "more than this plate can give"
            )

        return Violation(Divergence.TOO_MUCH_ENERGY, counted & ~(energy <= limit), detail)

    def _too_deep(self, frames: Frames, rotation: Floats, present: NDArray[np.bool_]) -> Violation:
        """Where a corner is too deep, among the frames and parts (n, parts) that are present."""
        self._checked = _, depth, allowed, clear = self._depths(frames, rotation)
        # A part that has tipped over the edge and swung back may be inside the plate's side. So only a part counts that
        # was away from the edge, and not too deep, at the frame before.
        clear_before = np.concatenate([self._last_clear[None], clear[:-1]])

        def detail(row: int, part: int) -> str:
            return (
                f"a corner lies {1e6 * depth[row, part]:.1f} um below the plate's surface, "
                f"allowed are {1e6 * allowed[row, part]:.1f} um"
            )

        return Violation(Divergence.TOO_DEEP, present & clear_before & (depth > allowed), detail)

    def _depths(self, frames: Frames, rotation: Floats) -> Depths:
        speed = self._speeds(frames)
        allowed = self._depth_limit(frames, speed)
        depth = self._depth(frames, rotation, allowed)
        return Depths(speed, depth, allowed, self._edge.clear_of(frames) & (depth <= allowed))

    def _speeds(self, frames: Frames) -> Floats:
        """Largest speed [m/s] of a point of each part against the plate after a fall from its height, (n, parts)."""
        squared = (frames.velocity**2).sum(axis=-1) + 2.0 * GRAVITY * np.maximum(frames.position[..., 2], 0.0)
        spin_speed = np.linalg.norm(frames.angular_velocity, axis=-1) * self._sizes
        return np.asarray(np.sqrt(squared) + spin_speed + self._energy.plate_speed)

    def _surface_height(self, corners: Floats, centres: Floats, q: Floats) -> Floats:
        """Height [m] of the surface at corners (k, c, 3) [m] of k parts, shape (k, c).

        With a tangent surface it is that of the tangent plane under the centre of the part.

        Args:
            corners: positions [m].
            centres: positions of the parts, shape (k, 3) [m].
            q: modal coordinates, shape (k, n_shapes) [m].
        """
        surface = self._scene.surface
        if not self._tangent:
            shapes = surface.deflections(corners[..., :2].reshape(-1, 2)).reshape(-1, *corners.shape[:2])
            return np.einsum("skc,ks->kc", shapes, q)
        modes = np.einsum("skm,ks->km", surface.modes_at(centres[:, :2]), q)
        offset = corners[..., :2] - centres[:, None, :2]
        return np.asarray(modes[:, :1] + np.einsum("kcm,km->kc", offset, modes[:, 1:]))


def _coordinates(surface: Surface, time: Floats) -> Floats:
    """Modal coordinates [m] at times (n,) of a block, shape (n, n_shapes)."""
    terms = surface.terms
    acting = (terms.start <= time[-1]) & (terms.stop > time[0])  # in this block; the others are zero
    columns = (terms.shape, terms.start, terms.stop, terms.coefficient, terms.rate)
    return ModalTerms(*(column[acting] for column in columns)).phasor(time, surface.n_shapes).real


def _rotations(quaternion: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), w first, of any length."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    s = 2.0 / np.maximum(w * w + x * x + y * y + z * z, 1e-300)
    matrix = np.empty((*quaternion.shape[:-1], 3, 3))
    matrix[..., 0, 0], matrix[..., 1, 1] = 1.0 - s * (y * y + z * z), 1.0 - s * (x * x + z * z)
    matrix[..., 2, 2] = 1.0 - s * (x * x + y * y)
    matrix[..., 0, 1], matrix[..., 1, 0] = s * (x * y - w * z), s * (x * y + w * z)
    matrix[..., 0, 2], matrix[..., 2, 0] = s * (x * z + w * y), s * (x * z - w * y)
    matrix[..., 1, 2], matrix[..., 2, 1] = s * (y * z - w * x), s * (y * z + w * x)
    return matrix
