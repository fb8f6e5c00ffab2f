"""Notices states that no part over a vibrating plate can be in, and parts that have fallen off it.

Looked for, in this order where one frame shows several of them:

    a state that is not finite
    a centre below the plate's surface: the part went through between two steps
    more energy than the plate can give       (`energy`, `energy_limit`)
    a corner deeper in the plate than allowed  (`depth`, `depth_limit`)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from feeder_sim.errors import Divergence, SimulationDiverged
from feeder_sim.plate.drive import ModalTerms
from feeder_sim.plate.surface import Surface
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Contact
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import GRAVITY, Scene

Floats = NDArray[np.float64]
# What is wrong, where (n, parts), and the same with numbers for one frame and part.
Violation = tuple[Divergence, NDArray[np.bool_], Callable[[int, int], str]]


class Guard:
    """Watches one seed, block after block; looks at parts that are there only.

    A part that has fallen past the edge may swing or drift under the plate; it is remembered (`remember`).
    """

    # Over `energy_limit`. The largest ratio seen is 1.04: all scenarios, both engines, heaps, elastic parts.
    ENERGY_FACTOR = 10.0
    # Seen are 0.5 steps of a single part, and 3.3 of what falls where a heap is poured on nuts that lie; a third of the
    # limit each. The impulse engine loses a corner at 200 um.
    DEPTH_STEPS = 2.0
    DEPTH_FRACTION = 0.05  # of the amplitude
    HEAP_DEPTH = 1e-4  # [m]; 80 um seen at the bottom of a poured heap, whose overlaps push parts down
    DEPTH_FLOOR = 1e-5  # [m]; twice what a part enters in a flight of the impulse engine, however short its step

    def __init__(self, prepared: Prepared, first: Frames) -> None:
        self._scene = scene = prepared.scene
        drives = scene.drives
        amplitude = np.array([drive.amplitude for drive in drives])
        speed = [2 * np.pi * max(d.drive_frequency, d.natural_frequency) * d.amplitude for d in drives]
        self._plate_speed = _strongest(scene, np.array(speed))
        self._amplitude = _strongest(scene, amplitude)
        self._crest = float(amplitude.sum())
        self._antinode = np.abs(scene.surface.table[..., 0]).max(axis=(1, 2))
        self._tangent = scene.scenario.run.tangent_surface or prepared.engine.name == "mujoco"
        height = float(np.abs(first.position[..., 2]).max())
        self._start_speed = float(np.linalg.norm(first.velocity, axis=-1).max()) + math.sqrt(2.0 * GRAVITY * height)
        self._restitution = _restitution(scene.scenario.contact)
        self._floor = 1e-3 * scene.scenario.run.floor_mm
        self._mass = np.array([kind.mass for kind in scene.kinds])[scene.kind_of]
        self._inertia = np.array([kind.inertia for kind in scene.kinds])[scene.kind_of]
        self._sizes = np.array([kind.size for kind in scene.kinds])[scene.kind_of]
        self._held = scene.rim or any(scene.guides)  # no part can come over the edge
        self._fallen = np.zeros(first.position.shape[1], bool)
        self._pace = self._speeds(first)[-1]
        self._clear = self._inner(first)[-1]

    def redrive(self, scene: Scene) -> None:
        """Go on in the same scene with other times at which drives stop from now on."""
        self._scene = scene

    def check(self, frames: Frames, seed_index: int) -> tuple[int, SimulationDiverged | None]:
        """Return how many leading frames are valid, and what is wrong with the next one."""
        first, failure = len(frames), None
        with np.errstate(over="ignore", invalid="ignore"):  # of states that have exploded
            for divergence, violated, detail in self._violations(frames):
                row = int(np.argmax(violated.any(axis=1))) if violated.any() else first
                if row < first:
                    part = int(np.argmax(violated[row]))
                    first, failure = row, (divergence, detail(row, part), self._scene.parts[part].name)
        if failure is None:
            return first, None
        divergence, words, name = failure
        time = float(frames.time[first])
        return first, SimulationDiverged(divergence, time_s=time, part=name, seed=seed_index, detail=words)

    def lost(self, frames: Frames) -> np.ndarray:
        """Frames and parts (n, parts) that are off the plate and below the floor level."""
        position = frames.position
        off = ~self.over(position) | self.fallen(frames)
        return np.asarray(frames.present & off & (position[..., 2] < self._floor))

    def fallen(self, frames: Frames) -> np.ndarray:
        """Frames and parts (n, parts) that have come down beside the plate and not come up again since.

        The sides of the plate stop nothing: a part that tips over the edge may swing under the plate by twice its size
        until the next frame, and fly on from there.
        """
        position = frames.position
        below = position[..., 2] < -self._crest
        if self._scene.rim or not (below.any() or self._fallen.any()):
            return np.zeros(below.shape, bool)
        beside = below & ~self._inner(frames)
        found = np.empty(beside.shape, bool)
        last = self._fallen
        for row in range(len(found)):
            found[row] = last = (last & (position[row, :, 2] < 0.0)) | beside[row]
        return found

    def remember(self, frames: Frames) -> None:
        """Go on to the next block of frames."""
        if len(frames):
            last = frames[slice(-1, None)]
            allowed = self.depth_limit(last)
            self._clear = (self._inner(last) & (self.depth(last, allowed) <= allowed))[0]
            self._fallen = self.fallen(frames)[-1]
            self._pace = self._speeds(last)[0]

    def over(self, position: np.ndarray) -> np.ndarray:
        """Whether positions (..., 3) [m] are over the plate, or under it."""
        return np.asarray((np.abs(position[..., :2]) < self._sides).all(axis=-1))

    def energy(self, frames: Frames) -> Floats:
        """Energy of motion, spin and height over the resting plate [J], shape (n, parts)."""
        return self._energy(frames, _rotations(frames.quaternion))

    def _energy(self, frames: Frames, turned: Floats) -> Floats:
        spin = np.einsum("npij,npi->npj", turned, frames.angular_velocity)  # in the principal axes
        squared = (frames.velocity**2).sum(axis=-1)
        turning = (self._inertia * spin**2).sum(axis=-1)
        return np.asarray(0.5 * (self._mass * squared + turning) + self._mass * GRAVITY * frames.position[..., 2])

    def energy_limit(self, time: Floats) -> Floats:
        """What a part has at most [J] of its start and of what the plate gives it until a time (n,), shape (n, parts).

        In step with the plate at every impact a part comes to v = e v + (1 + e) u, that is u (1 + e) / (1 - e) over a
        plate of speed u. For e -> 1 that is for ever, but the plate, which can only push, gives a mean force of the
        weight: m g u t, and m u v for what is still in the motion, make v^2 = 2 u (v + g t).
        """
        speed, e = self._plate_speed, self._restitution
        given = speed + np.sqrt(speed**2 + 2.0 * GRAVITY * speed * time)
        if e < 1.0:
            given = np.minimum(given, speed * (1.0 + e) / (1.0 - e))
        return np.asarray(0.5 * self._mass * (given + self._start_speed)[:, None] ** 2)

    def depth(self, frames: Frames, needed: Floats | float = 0.0) -> Floats:
        """How deep the deepest corner of each part lies in the plate [m], shape (n, parts).

        Zero for parts by the plate's edge, where hulls rest on points that are no corners and tip over. With `needed`,
        what lies less deep may also be zero, which saves most of the work.
        """
        return self._depth(frames, _rotations(frames.quaternion), needed)

    def _depth(self, frames: Frames, turned: Floats, needed: Floats | float) -> Floats:
        found = np.zeros(frames.present.shape)
        surface, position = self._scene.surface, frames.position
        q = _coordinates(surface, frames.time)
        limit = (np.abs(q) @ self._antinode)[:, None] - needed  # no corner above it lies that deep
        watched = frames.present & self._inner(frames)
        for number, kind in enumerate(self._scene.kinds):
            parts = np.flatnonzero(self._scene.kind_of == number)
            lowest = (turned[:, parts, 2] @ kind.corners.T).min(axis=-1) - kind.corner_radius
            low = lowest + position[:, parts, 2] < np.broadcast_to(limit, found.shape)[:, parts]
            rows, places = np.nonzero(watched[:, parts] & low)
            which = parts[places]
            corners = position[rows, which, None] + np.einsum("kij,cj->kci", turned[rows, which], kind.corners)
            if len(rows):
                height = self._surface_height(corners, position[rows, which], q[rows])
                found[rows, which] = (height - corners[..., 2]).max(axis=1) + kind.corner_radius
        return np.maximum(found, 0.0)

    def depth_limit(self, frames: Frames) -> Floats:
        """How deep a corner may be in the plate [m], shape (n, parts).

        Both engines let a corner enter by what it covers in a step. Between two frames a part may have been as fast as
        at the frame before, and as its height then makes it.
        """
        pace = self._speeds(frames)
        pace = np.maximum(pace, np.concatenate([self._pace[None], pace[:-1]]))
        steps = self.DEPTH_STEPS * self._scene.timestep
        allowed = self.DEPTH_FLOOR + self.DEPTH_FRACTION * self._amplitude + steps * pace
        if pace.shape[1] > 1:  # what falls or lies on a part pushes it into the plate
            falling = frames.present & self.over(frames.position)
            allowed = allowed + self.HEAP_DEPTH + steps * np.where(falling, pace, 0.0).max(axis=1, keepdims=True)
        contact = self._scene.scenario.contact
        if contact.time_constant_us is not None:  # a spring-damper brakes within its time constant, and sags
            lasts = 1e-6 * contact.time_constant_us
            allowed = allowed + lasts * (pace + GRAVITY * contact.damping_ratio**2 * lasts)
        return np.asarray(allowed)

    @property
    def _sides(self) -> Floats:
        return 0.5 * np.array([self._scene.surface.length, self._scene.surface.width])

    def _violations(self, frames: Frames) -> Iterator[Violation]:
        states = (frames.position, frames.quaternion, frames.velocity, frames.angular_velocity)
        finite = np.logical_and.reduce([np.isfinite(state).all(axis=-1) for state in states])
        present, fallen = frames.present & finite, self.fallen(frames)
        yield Divergence.NOT_FINITE, frames.present & ~finite, lambda row, part: ""
        below = present & self.over(frames.position) & ~fallen & (frames.position[..., 2] < -self._crest)
        yield Divergence.THROUGH_PLATE, below, lambda row, part: ""
        # Also of a part that is being thrown off the plate; one that was off it before may have met the plate's side.
        before = np.concatenate([self._fallen[None], fallen[:-1]])
        turned = _rotations(frames.quaternion)
        energy, most = self._energy(frames, turned), self.ENERGY_FACTOR * self.energy_limit(frames.time)
        yield (
            Divergence.TOO_MUCH_ENERGY,
            present & ~before & ~(energy <= most),
            lambda row, part: (
                f"its energy of {energy[row, part]:.2g} J exceeds {most[row, part]:.2g} J, "
                "more than this plate can give"
            ),
        )
        allowed = self.depth_limit(frames)
        depth = self._depth(frames, turned, allowed)
        # What has tipped over the edge and swung back may stick in the plate's side: it must have been clear before.
        clear = self._inner(frames) & (depth <= allowed)
        before = np.concatenate([self._clear[None], clear[:-1]])
        yield (
            Divergence.TOO_DEEP,
            present & before & (depth > allowed),
            lambda row, part: (
                f"a corner lies {1e6 * depth[row, part]:.1f} um below the plate's surface, "
                f"allowed are {1e6 * allowed[row, part]:.1f} um"
            ),
        )

    def _inner(self, frames: Frames) -> NDArray[np.bool_]:
        """Frames and parts (n, parts) so far from the edge that they cannot have been over it since the last frame."""
        away = self._sizes[:, None] * np.ones(2)
        if not self._held:
            away = 2.0 * self._sizes.max() + np.abs(frames.velocity[..., :2]) * self._scene.frame_interval
        return np.asarray((np.abs(frames.position[..., :2]) < self._sides - away).all(axis=-1))

    def _speeds(self, frames: Frames) -> Floats:
        """Largest speed [m/s] of a point of each part towards the plate, at the frame or after falling from there."""
        squared = (frames.velocity**2).sum(axis=-1) + 2.0 * GRAVITY * np.maximum(frames.position[..., 2], 0.0)
        turning = np.linalg.norm(frames.angular_velocity, axis=-1) * self._sizes
        return np.asarray(np.sqrt(squared) + turning + self._plate_speed)

    def _surface_height(self, corners: Floats, centres: Floats, q: Floats) -> Floats:
        """Height [m] of the surface that corners (k, c, 3) meet, for coordinates q (k, n_shapes), shape (k, c).

        With a tangent surface that is the plane under the part's centre (k, 3).
        """
        surface = self._scene.surface
        if not self._tangent:
            shapes = surface.deflections(corners[..., :2].reshape(-1, 2)).reshape(-1, *corners.shape[:2])
            return np.einsum("skc,ks->kc", shapes, q)
        modes = np.einsum("skm,ks->km", surface.modes_at(centres[:, :2]), q)
        away = corners[..., :2] - centres[:, None, :2]
        return np.asarray(modes[:, :1] + np.einsum("kcm,km->kc", away, modes[:, 1:]))


def _strongest(scene: Scene, amounts: Floats) -> float:
    """Largest sum of an amount per drive over the drives that act or still ring at the same time.

    A mode that is driven again while it rings comes to no more than the stronger of both.
    """
    decay = np.full(scene.surface.n_shapes, 1e9)  # [1/s]; at once, without damping
    for drive in scene.drives:
        ringing = (drive.damping_ratio or math.inf) * 2.0 * math.pi * drive.natural_frequency
        decay[drive.shape] = min(decay[drive.shape], ringing)
    most, level = 0.0, np.zeros(len(decay))
    for stage in scene.times.stages:
        driven = np.zeros(len(decay))
        for i in stage.excitations:
            driven[scene.drives[i].shape] += amounts[i]
        most = max(most, float(np.maximum(level, driven).sum()))
        acts = 0.0 if stage.until else stage.stop - stage.start  # an event may stop it at once
        level = np.maximum(level * np.exp(-decay * acts), driven) * np.exp(-decay * (stage.end - stage.stop))
    return most


def _restitution(contact: Contact) -> float:
    """Coefficient of restitution; that of a spring-damper follows from its damping ratio."""
    if contact.time_constant_us is None:
        return contact.restitution
    ratio = contact.damping_ratio
    return math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 0.0


def _coordinates(surface: Surface, time: Floats) -> Floats:
    """Modal coordinates [m] at times (n,) of a block, shape (n, n_shapes)."""
    terms = surface.terms
    acting = (terms.start <= time[-1]) & (terms.stop > time[0])
    held = (terms.shape, terms.start, terms.stop, terms.coefficient, terms.rate)
    return ModalTerms(*(values[acting] for values in held)).phasor(time, surface.n_shapes).real


def _rotations(quaternion: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), w first, of any length."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    s = 2.0 / np.maximum(w * w + x * x + y * y + z * z, 1e-300)
    turned = np.empty((*quaternion.shape[:-1], 3, 3))
    turned[..., 0, 0], turned[..., 1, 1] = 1.0 - s * (y * y + z * z), 1.0 - s * (x * x + z * z)
    turned[..., 2, 2] = 1.0 - s * (x * x + y * y)
    turned[..., 0, 1], turned[..., 1, 0] = s * (x * y - w * z), s * (x * y + w * z)
    turned[..., 0, 2], turned[..., 2, 0] = s * (x * z + w * y), s * (x * z - w * y)
    turned[..., 1, 2], turned[..., 2, 1] = s * (y * z - w * x), s * (y * z + w * x)
    return turned
