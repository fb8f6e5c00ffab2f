"""Drops: how often a part comes to lie in each of its stable poses when it falls on a plate at rest.

Every drop begins at rest at an attitude of its own, all attitudes equally likely, at some height over a level plate.
Both engines get the same starts.
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
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.stable_poses import NONE, StablePose, stable_poses
from feeder_sim.pool.work import Work
from feeder_sim.run.compilation import compilation_announced, in_daemon_thread
from feeder_sim.scenario import Ball, Contact, RigidPlate, Run, Scenario
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.single_thread import single_threaded

DROPS = 2000
HEIGHT = 1.0  # of the lowest point at the start, over the part's largest extent
LONGEST = 25.0  # times the fall; a part that still rolls then counts to the pose that it rolls in
INTERVAL_S = 0.01  # [s] between two looks at a part
LOOKS = 5  # in a row at which a part has to lie still: one on edge stays there for less
STILL = 2e-3  # [m/s]; no point of a part that lies still is faster
PLATE_MM = 1e4
PIECES = 16  # of the drops per thread
Engine = Literal["impulse", "mujoco"]
ENGINES: tuple[Engine, ...] = get_args(Engine)
Ended: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64]]


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


@dataclass(frozen=True)
class DropStudy:
    """What came of many drops.

    Attributes:
        part: that was dropped.
        engine: that computed it.
        contact: of part and plate.
        pose: index of the pose that each drop ended in, or `NONE`, shape (drops,).
        rest_s: when each part lay still [s], NaN for one that still rolled, shape (drops,).
    """

    part: RigidPart
    engine: Engine
    contact: Contact
    pose: NDArray[np.int64]
    rest_s: NDArray[np.float64]

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
        return int(np.isnan(self.rest_s).sum())


@single_threaded
def drop(
    part: RigidPart,
    drops: int = DROPS,
    *,
    contact: Contact | None = None,
    engine: Engine = "impulse",
    seed: int = 0,
    work: Work | None = None,
) -> DropStudy:
    """Drop a part many times on a plate at rest and see how it comes to lie.

    Args:
        part: any rigid part with stable poses.
        drops: how many.
        contact: of part and plate; default as in a scenario.
        engine: that computes the drops.
        seed: of the attitudes.
        work: by default threads, one for each core; they do not change the result.

    Raises:
        InputError: the part has no stable poses (a ball), no drops are asked for, or a law of impact for balls.
        Interrupted: it was given up.
    """
    table, work = stable_poses(part), work or Work()
    if not table.poses:
        raise InputError("has no stable poses: it lies on any side", key=part.name)
    if drops < 1:
        raise InputError(f"is {drops}, must be at least 1", key="drops")
    if contact is not None and contact.tangential_restitution is not None:
        raise InputError("is given, must be none for drops: it is for balls", key="contact.tangential_restitution")
    scene = still_plate(part, contact or Contact(), engine)
    starts = Rotation.random(drops, rng=np.random.default_rng(seed))
    n_pieces = PIECES * work.n_workers
    ends = [drops * i // n_pieces for i in range(n_pieces + 1)]
    pieces = [slice(*piece) for piece in itertools.pairwise(ends) if piece[1] > piece[0]]
    compute = _impulse_drops if engine == "impulse" else _mujoco_drops

    def compile_engine() -> None:
        compute(scene, starts[:1], np.ones(2, np.int64))

    with compilation_announced("drops", work.notify):
        in_daemon_thread(compile_engine)
    attitude, rest_s = np.empty((drops, 4)), np.empty(drops)
    interrupts = [new_interrupt() for _ in pieces]  # of each, since an engine counts its frames there
    with ThreadPoolExecutor(work.n_workers) as pool:
        tasks = [pool.submit(compute, scene, starts[p], each) for p, each in zip(pieces, interrupts, strict=True)]
        try:
            for piece, task in zip(pieces, tasks, strict=True):
                while not wait([task], timeout=0.1).done:
                    if work.stop.is_set():
                        raise Interrupted("interrupted")
                attitude[piece], rest_s[piece] = task.result()
                work.progress(piece.stop / drops)
        finally:
            for interrupt in interrupts:
                interrupt[ENDED] = 1  # given up, or an error: what is left ends where it is
    return DropStudy(part, engine, scene.scenario.contact, table.number(attitude), rest_s)


def still_plate(part: RigidPart, contact: Contact, engine: Engine) -> Scene:
    """A scene with one part on a large plate that nothing moves: that of a ball, with the part in its place."""
    longest = LONGEST * math.sqrt(2.0 * HEIGHT * part.longest / GRAVITY)
    scenario = Scenario(
        plate=RigidPlate(kind="still", length_mm=PLATE_MM, width_mm=PLATE_MM),
        part=(Ball(shape="ball", diameter_mm=1e3 * part.longest),),
        contact=contact,
        run=Run(engine=engine, duration_s=longest, frames_per_second=1.0 / INTERVAL_S),
    )
    return replace(build_scene(scenario), kinds=(part,), parts=(replace(part, name="part_0"),))


def _places(part: RigidPart, starts: Rotation) -> NDArray[np.float64]:
    """Centres of mass (drops, 3) [m] of a part whose lowest point is so high as it is long."""
    turned = np.einsum("nij,kj->nki", starts.as_matrix(), part.corners)
    place = np.zeros((len(starts), 3))
    place[:, 2] = HEIGHT * part.longest - turned[:, :, 2].min(axis=1)
    return place


def _impulse_drops(scene: Scene, starts: Rotation, interrupt: NDArray[np.int64]) -> Ended:
    """Attitudes (drops, 4) of the part at its end, and when it lay still (drops,) [s]."""
    part, kinds = scene.kinds[0], read_kinds(scene)
    principal = scene.principal_attitudes(starts.as_quat(scalar_first=True)[:, None])[:, 0]
    turned = Rotation.from_quat(principal, scalar_first=True).as_matrix()
    parts = new_parts(_places(part, starts), turned, np.zeros(len(starts), np.int64))
    alone = Alone(parts, kinds, new_scratch(kinds, scene.surface.n_shapes))
    surface = surface_arrays(scene)
    drive = MovingPlate(surface, scene.surface.extremes, exactness_of(scene), scene.timestep, WINDOW_ALONE)
    rested = np.empty(len(parts))
    advance_to_rest(alone, drive, INTERVAL_S, scene.times.duration, interrupt, rested)
    ended = Rotation.from_matrix(parts["attitude"]).as_quat(scalar_first=True)
    return scene.attitudes(ended[:, None])[:, 0], rested


def _mujoco_drops(scene: Scene, starts: Rotation, interrupt: NDArray[np.int64]) -> Ended:
    """As `_impulse_drops`, by MuJoCo."""
    from feeder_sim.engines.mujoco.engine import MujocoEngine

    part = scene.kinds[0]
    engine = MujocoEngine(scene, np.random.default_rng(0), interrupt=interrupt)
    joint = engine.data.joint(scene.parts[0].name)
    attitude, rested = np.empty((len(starts), 4)), np.full(len(starts), np.nan)
    principal = scene.principal_attitudes(starts.as_quat(scalar_first=True)[:, None])[:, 0]
    for k, place in enumerate(_places(part, starts)):
        engine.put_at_start()
        joint.qpos[:3], joint.qpos[3:] = place, principal[k]
        looks = 0
        while looks < LOOKS and engine.current().time[0] < scene.times.duration and not interrupt[ENDED]:
            frame = engine.advance(1)
            speed = np.linalg.norm(frame.velocity[0, 0]) + part.size * np.linalg.norm(frame.angular_velocity[0, 0])
            looks = looks + 1 if speed < STILL else 0
        attitude[k] = engine.current().quaternion[0, 0]
        if looks == LOOKS:
            rested[k] = engine.current().time[0] - (LOOKS - 1) * INTERVAL_S
    return attitude, rested
