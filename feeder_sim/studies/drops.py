"""Drops and throws: how often a part comes to lie in each of its stable poses when it falls on a plate at rest.

Every drop begins at rest at an attitude of its own, all attitudes equally likely, at some height over a level plate. A
throw has a speed along the plate and a spin about any axis besides. Both engines get the same starts.
"""

from __future__ import annotations

import itertools
import math
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.alone import Alone
from feeder_sim.engines.impulse.drops import advance_to_rest
from feeder_sim.engines.impulse.engine import WINDOW_ALONE
from feeder_sim.engines.impulse.kinds import read_kinds
from feeder_sim.engines.impulse.scratch import new_scratch
from feeder_sim.engines.impulse.state import new_parts
from feeder_sim.engines.impulse.surroundings import exactness_of
from feeder_sim.engines.impulse.window import Drive as MovingPlate
from feeder_sim.engines.protocol import ENDED, new_interrupt
from feeder_sim.engines.surface_arrays import surface_arrays
from feeder_sim.errors import InputError, Interrupted
from feeder_sim.part.barriers import Barriers
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.stable_poses import NONE, StablePose, downward, stable_poses
from feeder_sim.pool.work import Work
from feeder_sim.run.compilation import compilation_announced, in_daemon_thread
from feeder_sim.scenario import Ball, Contact, RigidPlate, Run, Scenario
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.single_thread import single_threaded

DROPS = 2000
HEIGHT, THROWN_HEIGHT = 1.0, 4.0  # of the lowest point at the start, over the part's largest extent
LONGEST = 25.0  # times the fall; a part that still rolls then counts to the pose that it rolls in
INTERVAL_S = 0.02  # [s] between two looks at a part
LOOKS = 5  # in a row at which a part has to lie still: one on edge stays there for less
STILL = 2e-3  # [m/s]; no point of a part that lies still is faster
PLATE_MM = 1e4
PIECES = 16  # of the drops per thread
MOST_THROWN = {"height": (10.0, "m"), "speed": (100.0, "m/s"), "spin": (1e4, "rad/s")}
Z95 = 1.959964  # standard errors to each side of a normal 95 % interval
Engine = Literal["impulse", "mujoco"]
ENGINES: tuple[Engine, ...] = get_args(Engine)
# Attitudes at the end (drops, 4), poses and times when they were settled (drops,) [s]
Ended: TypeAlias = tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]


@dataclass(frozen=True)
class Throw:
    """How parts begin to fall: least and largest of each quantity, between which all values are equally likely.

    Attributes:
        height: of the lowest point over the plate [m].
        speed: of the centre of mass, along the plate [m/s].
        spin: about an axis of any direction [rad/s].
    """

    height: tuple[float, float]
    speed: tuple[float, float] = (0.0, 0.0)
    spin: tuple[float, float] = (0.0, 0.0)

    @staticmethod
    def of(
        part: RigidPart,
        height: tuple[float, float] | None = None,
        speed: tuple[float, float] | None = None,
        spin: tuple[float, float] | None = None,
    ) -> Throw:
        """A throw of a part; what is not given follows from its size.

        By default it is thrown from four times its longest extent, as fast along the plate as it falls on it from
        there, and turns by one radian as it moves on by its longest extent.
        """
        height = height or (THROWN_HEIGHT * part.longest,) * 2
        speed = speed or (math.sqrt(2.0 * GRAVITY * height[1]),) * 2
        return Throw(height, speed, spin or (speed[0] / part.longest, speed[1] / part.longest))

    def check(self) -> None:
        """Refuse what is no range of numbers from 0 on, or what no part is thrown like.

        Raises:
            InputError: as said.
        """
        for name, (most, unit) in MOST_THROWN.items():
            low, high = getattr(self, name)
            if not 0.0 <= low <= high <= most:
                problem = f"is {low:g} to {high:g} {unit}, must be 0 to {most:g} {unit}, the least first"
                raise InputError(problem, key=f"throw.{name}")


@dataclass(frozen=True)
class Starts:
    """Attitudes (n,), places of the centre of mass, velocities and angular velocities (n, 3), in SI units."""

    attitude: Rotation
    place: NDArray[np.float64]
    velocity: NDArray[np.float64]
    spin: NDArray[np.float64]

    @staticmethod
    def drawn(part: RigidPart, throw: Throw, number: int, seed: int) -> Starts:
        """Random starts."""
        rng = np.random.default_rng(seed)
        attitude = Rotation.random(number, rng=rng)
        height, speed, spin = (rng.uniform(*bounds, number) for bounds in (throw.height, throw.speed, throw.spin))
        axis = rng.normal(size=(number, 3))
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        turned = np.einsum("nij,kj->nki", attitude.as_matrix(), part.corners)
        place, velocity = np.zeros((number, 3)), np.zeros((number, 3))
        place[:, 2], velocity[:, 0] = height - turned[:, :, 2].min(axis=1), speed
        return Starts(attitude, place, velocity, spin[:, None] * axis)

    def __getitem__(self, rows: slice) -> Starts:
        return Starts(self.attitude[rows], self.place[rows], self.velocity[rows], self.spin[rows])


@dataclass(frozen=True)
class Share:
    """How many of a number of drops ended in one pose."""

    pose: StablePose
    hits: int
    drops: int

    @property
    def value(self) -> float:
        return self.hits / self.drops

    @property
    def standard_error(self) -> float:
        """Of the share; never 0, since what has not happened in n drops may still happen (Laplace)."""
        likely = (self.hits + 1) / (self.drops + 2)
        return math.sqrt(likely * (1.0 - likely) / self.drops)

    @property
    def tries(self) -> tuple[float, float, float]:
        """Drops until it lies so once, on average: the estimate, and its 95 % interval (Wilson's of the share)."""
        z2, n, share = Z95**2, self.drops, self.value
        centre = (share + 0.5 * z2 / n) / (1.0 + z2 / n)
        half = Z95 * math.sqrt(share * (1.0 - share) / n + 0.25 * z2 / n**2) / (1.0 + z2 / n)
        low, high = max(centre - half, 0.0), centre + half
        return (1.0 / share if share else math.inf), 1.0 / high, (1.0 / low if self.hits else math.inf)


@dataclass(frozen=True)
class DropStudy:
    """What came of many drops.

    Attributes:
        part: that was dropped.
        engine: that computed it.
        contact: of part and plate.
        throw: how it began to fall.
        attitude: of each part then, quaternions (drops, 4), w first.
        pose: index of the pose that each drop ended in, or `NONE`, shape (drops,).
        settled_s: when each part lay still or had too little energy left to leave its pose [s], NaN for one that still
            rolled, shape (drops,).
    """

    part: RigidPart
    engine: Engine
    contact: Contact
    throw: Throw
    attitude: NDArray[np.float64]
    pose: NDArray[np.int64]
    settled_s: NDArray[np.float64]

    @property
    def shares(self) -> tuple[Share, ...]:
        """Of the stable poses, in their order."""
        poses = stable_poses(self.part).poses
        return tuple(Share(pose, int((self.pose == i).sum()), len(self.pose)) for i, pose in enumerate(poses))

    @property
    def other(self) -> int:
        """Drops that ended in no stable pose."""
        return int((self.pose == NONE).sum())

    @property
    def moving(self) -> int:
        """Drops after which the part still rolled."""
        return int(np.isnan(self.settled_s).sum())


@single_threaded
def drop(
    part: RigidPart,
    drops: int = DROPS,
    *,
    throw: Throw | None = None,
    contact: Contact | None = None,
    engine: Engine = "impulse",
    seed: int = 0,
    work: Work | None = None,
) -> DropStudy:
    """Drop a part many times on a plate at rest and see how it comes to lie.

    Args:
        part: any rigid part with stable poses.
        drops: how many.
        throw: how each begins to fall; by default at rest, from the part's longest extent.
        contact: of part and plate; default as in a scenario.
        engine: that computes the drops.
        seed: of the attitudes.
        work: by default threads, one for each core; they do not change the result.

    Raises:
        InputError: the part has no stable poses (a ball), no drops are asked for, a throw cannot be, or a law of
            impact for balls.
        Interrupted: it was given up.
    """
    table, work = stable_poses(part), work or Work()
    if not table.poses:
        raise InputError("has no stable poses: it lies on any side", key=part.name)
    if drops < 1:
        raise InputError(f"is {drops}, must be at least 1", key="drops")
    if contact is not None and contact.tangential_restitution is not None:
        raise InputError("is given, must be none for drops: it is for balls", key="contact.tangential_restitution")
    throw = throw or Throw((HEIGHT * part.longest,) * 2)
    throw.check()
    scene = still_plate(part, contact or Contact(), engine, throw.height[1])
    starts = Starts.drawn(part, throw, drops, seed)
    n_pieces = PIECES * work.n_workers
    ends = [drops * i // n_pieces for i in range(n_pieces + 1)]
    pieces = [slice(*piece) for piece in itertools.pairwise(ends) if piece[1] > piece[0]]
    compute = _impulse_drops if engine == "impulse" else _mujoco_drops

    def compile_engine() -> None:
        compute(scene, starts[:1], np.ones(2, np.int64))

    with compilation_announced("drops", work.notify):
        in_daemon_thread(compile_engine)
    attitude, pose, settled_s = np.empty((drops, 4)), np.empty(drops, np.int64), np.empty(drops)
    interrupts = [new_interrupt() for _ in pieces]  # of each, since an engine counts its frames there
    with ThreadPoolExecutor(work.n_workers) as pool:
        tasks = [pool.submit(compute, scene, starts[p], each) for p, each in zip(pieces, interrupts, strict=True)]
        try:
            for piece, task in zip(pieces, tasks, strict=True):
                while not wait([task], timeout=0.1).done:
                    if work.stop.is_set():
                        raise Interrupted("interrupted")
                attitude[piece], pose[piece], settled_s[piece] = task.result()
                work.progress(piece.stop / drops)
        finally:
            for interrupt in interrupts:
                interrupt[ENDED] = 1  # given up, or an error: what is left ends where it is
    return DropStudy(part, engine, scene.scenario.contact, throw, attitude, pose, settled_s)


def still_plate(part: RigidPart, contact: Contact, engine: Engine, height: float) -> Scene:
    """A scene with one part on a large plate that nothing moves: that of a ball, with the part in its place."""
    longest = LONGEST * math.sqrt(2.0 * max(height, HEIGHT * part.longest) / GRAVITY)
    scenario = Scenario(
        plate=RigidPlate(kind="still", length_mm=PLATE_MM, width_mm=PLATE_MM),
        part=(Ball(shape="ball", diameter_mm=1e3 * part.longest),),
        contact=contact,
        run=Run(engine=engine, duration_s=longest, frames_per_second=1.0 / INTERVAL_S),
    )
    return replace(build_scene(scenario), kinds=(part,), parts=(replace(part, name="part_0"),))


def _impulse_drops(scene: Scene, starts: Starts, interrupt: NDArray[np.int64]) -> Ended:
    """Drops until each lies still or can no longer leave its pose."""
    part, kinds = scene.kinds[0], read_kinds(scene)
    principal = scene.principal_attitudes(starts.attitude.as_quat(scalar_first=True)[:, None])[:, 0]
    turned = Rotation.from_quat(principal, scalar_first=True).as_matrix()
    momentum = np.einsum("nij,j,nkj,nk->ni", turned, part.inertia, turned, starts.spin)
    parts = new_parts(starts.place, turned, np.zeros(len(turned), np.int64), starts.velocity, momentum)
    alone = Alone(parts, kinds, new_scratch(kinds, scene.surface.n_shapes))
    surface = surface_arrays(scene)
    drive = MovingPlate(surface, scene.surface.extremes, exactness_of(scene), scene.timestep, WINDOW_ALONE)
    table = stable_poses(part)
    barriers, longest = Barriers(part.corners, table), math.ceil(scene.times.duration / INTERVAL_S)
    attitude, pose, settled = np.empty((len(parts), 4)), np.empty(len(parts), np.int64), np.full(len(parts), np.nan)
    number = np.arange(len(parts))  # of the drops that are not over
    for k in range(1, longest + 1):
        rested = np.empty(len(parts))
        advance_to_rest(Alone(parts, *alone[1:]), drive, INTERVAL_S, INTERVAL_S, interrupt, rested)
        parts["clock"] -= INTERVAL_S
        turned = Rotation.from_matrix(parts["attitude"])
        now = scene.attitudes(turned.as_quat(scalar_first=True)[:, None])[:, 0]
        decided = barriers.decided(downward(now), _energy_height(parts, turned, part))
        at_rest = ~np.isnan(rested)
        over = at_rest | (decided != NONE)
        attitude[number], pose[number] = now, np.where(over & ~at_rest, decided, table.number(now))
        settled[number[over]] = k * INTERVAL_S
        parts, number = parts[~over], number[~over]
        if not len(parts) or interrupt[ENDED]:
            break
    return attitude, pose, settled


def _energy_height(parts: NDArray[np.void], turned: Rotation, part: RigidPart) -> NDArray[np.float64]:
    """Height (n,) [m] over the plate to which all its energy would lift the centre of mass of a part at attitudes."""
    spin_energy = (turned.inv().apply(parts["momentum"]) ** 2 / part.inertia).sum(axis=1) / part.mass
    return np.asarray(parts["position"][:, 2] + 0.5 * ((parts["velocity"] ** 2).sum(axis=1) + spin_energy) / GRAVITY)


def _mujoco_drops(scene: Scene, starts: Starts, interrupt: NDArray[np.int64]) -> Ended:
    """As `_impulse_drops`, by MuJoCo, until each lies still."""
    from feeder_sim.engines.mujoco.engine import MujocoEngine

    part = scene.kinds[0]
    engine = MujocoEngine(scene, np.random.default_rng(0), interrupt=interrupt)
    joint = engine.data.joint(scene.parts[0].name)
    attitude, rested = np.empty((len(starts.place), 4)), np.full(len(starts.place), np.nan)
    principal = scene.principal_attitudes(starts.attitude.as_quat(scalar_first=True)[:, None])[:, 0]
    spin = Rotation.from_quat(principal, scalar_first=True).inv().apply(starts.spin)  # in the axes of the part
    for k, place in enumerate(starts.place):
        engine.put_at_start()
        joint.qpos[:3], joint.qpos[3:] = place, principal[k]
        joint.qvel[:3], joint.qvel[3:] = starts.velocity[k], spin[k]
        looks = 0
        while looks < LOOKS and engine.current().time[0] < scene.times.duration and not interrupt[ENDED]:
            frame = engine.advance(1)
            speed = np.linalg.norm(frame.velocity[0, 0]) + part.size * np.linalg.norm(frame.angular_velocity[0, 0])
            looks = looks + 1 if speed < STILL else 0
        attitude[k] = engine.current().quaternion[0, 0]
        if looks == LOOKS:
            rested[k] = engine.current().time[0] - (LOOKS - 1) * INTERVAL_S
    return attitude, stable_poses(part).number(attitude), rested
