"""Ten nuts fall on a plate at rest: does their energy ever grow? In Bullet, plain MuJoCo and Rapier.

    python benchmarks/peers/heap.py [--steps-per-ms 10 40]

Nothing moves the plate, so the energy of the nuts can only fall. Prints the largest gain between two looks 1 ms apart,
the sum of all gains, and what is left at the end above the least that there was, all in percent of the energy at the
start, which is measured from nuts that lie flat; and the wall time per simulated second. Hulls, restitution 0.2 and
friction 0.3 between all, the nut of the other cases.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

sys.path.append(str(Path(__file__).parents[1]))

import numpy as np
from cases import FLOOR, steel_nut
from chart_cases import FRICTION, RESTITUTION
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY

PARTS, SPACING, DURATION_S, LOOK_S = 10, 8e-3, 1.0, 1e-3
STEPS_PER_MS = (10, 40)


class Heap(Protocol):
    """Parts in some engine."""

    def advance(self, steps: int) -> None:
        """Do so many steps."""
        ...

    def motion(self) -> NDArray[np.float64]:
        """Place, quaternion (w first), velocity and spin in world axes of each part, shape (n, 13)."""
        ...


def starts() -> NDArray[np.float64]:
    """Place and quaternion, w first, of each nut, one above the other, shape (n, 7)."""
    rng = np.random.default_rng(0)
    place = np.column_stack([rng.uniform(-1e-3, 1e-3, (PARTS, 2)), SPACING * np.arange(1, PARTS + 1)])
    return np.hstack([place, Rotation.random(PARTS, rng=rng).as_quat(scalar_first=True)])


def energy(motion: NDArray[np.float64]) -> float:
    """Of all nuts, over that of nuts that lie flat [J]."""
    body = steel_nut()
    spin = Rotation.from_quat(motion[:, 3:7], scalar_first=True).inv().apply(motion[:, 10:])
    height = motion[:, 2] + body.corners[:, 2].min()
    moving = 0.5 * body.mass * (motion[:, 7:10] ** 2).sum() + 0.5 * (spin**2 @ body.inertia).sum()
    return float(body.mass * GRAVITY * height.sum() + moving)


class BulletHeap:
    """ERP 0.2 takes penetrations away, without which a heap sinks into itself."""

    def __init__(self, dt: float, erp: float) -> None:
        self.bullet: Any = importlib.import_module("pybullet")
        engine, body = self.bullet, steel_nut()
        if not engine.isConnected():
            engine.connect(engine.DIRECT)
        engine.resetSimulation()
        engine.setGravity(0.0, 0.0, -GRAVITY)
        engine.setPhysicsEngineParameter(
            fixedTimeStep=dt,
            numSubSteps=1,
            restitutionVelocityThreshold=0.0,
            erp=erp,
            contactERP=erp,
            contactSlop=0.0,
            contactBreakingThreshold=1e-6,
            deterministicOverlappingPairs=1,
        )
        floor = engine.createCollisionShape(engine.GEOM_PLANE)
        nut = engine.createCollisionShape(engine.GEOM_MESH, vertices=body.corners.tolist())
        self.parts = [
            engine.createMultiBody(body.mass, nut, -1, row[:3].tolist(), np.roll(row[3:], -1).tolist())
            for row in starts()
        ]
        for each in (engine.createMultiBody(0.0, floor), *self.parts):
            engine.changeDynamics(
                each,
                -1,
                restitution=math.sqrt(RESTITUTION),
                lateralFriction=math.sqrt(FRICTION),
                linearDamping=0.0,
                angularDamping=0.0,
                collisionMargin=0.0,
                activationState=engine.ACTIVATION_STATE_DISABLE_SLEEPING,
            )
        for each in self.parts:
            engine.changeDynamics(each, -1, localInertiaDiagonal=body.inertia.tolist(), maxJointVelocity=1e9)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self.bullet.stepSimulation()

    def motion(self) -> NDArray[np.float64]:
        rows = []
        for each in self.parts:
            place, turn = self.bullet.getBasePositionAndOrientation(each)
            velocity, spin = self.bullet.getBaseVelocity(each)
            rows.append([*place, turn[3], *turn[:3], *velocity, *spin])
        return np.array(rows)


class MujocoHeap:
    """`solref`: text of it, given a time step."""

    def __init__(self, dt: float, solref: Callable[[float], str]) -> None:
        self.mujoco: Any = importlib.import_module("mujoco")
        body = steel_nut()
        vertices = " ".join(repr(float(x)) for x in body.corners.ravel())
        moments = " ".join(repr(float(x)) for x in body.inertia)
        nuts = ""
        for row in starts():
            place, turn = (" ".join(repr(float(x)) for x in values) for values in (row[:3], row[3:]))
            nuts += (
                f'<body pos="{place}" quat="{turn}"><freejoint/><inertial pos="0 0 0" mass="{body.mass!r}" '
                f'diaginertia="{moments}"/><geom type="mesh" mesh="nut"/></body>'
            )
        contact = f'solref="{solref(dt)}" solimp="0.9999 0.9999 0.001 0.5 2" friction="{FRICTION} 0 0" condim="3"'
        text = f"""<mujoco><option timestep="{dt!r}" gravity="0 0 {-GRAVITY}" cone="elliptic" tolerance="1e-15">
        <flag multiccd="enable"/></option><default><geom {contact}/></default>
        <asset><mesh name="nut" vertex="{vertices}"/></asset>
        <worldbody><geom type="plane" size="{FLOOR[0]} {FLOOR[1]} 1"/>{nuts}</worldbody></mujoco>"""
        self.model = self.mujoco.MjModel.from_xml_string(text)
        self.data = self.mujoco.MjData(self.model)

    def advance(self, steps: int) -> None:
        self.mujoco.mj_step(self.model, self.data, nstep=steps)

    def motion(self) -> NDArray[np.float64]:
        q, v = self.data.qpos.reshape(PARTS, 7), self.data.qvel.reshape(PARTS, 6)
        spin = Rotation.from_quat(q[:, 3:], scalar_first=True).apply(v[:, 3:])  # from the part's own axes
        return np.hstack([q, v[:, :3], spin])


class RapierHeap:
    """`corrective`: largest velocity at which penetrations are taken away [m/s]."""

    def __init__(self, dt: float, corrective: float) -> None:
        adapter = importlib.import_module("rapier")
        engine, body = adapter.rapier, steel_nut()
        self.world = adapter.new_world(dt, adapter.Contact(corrective=corrective, prediction=1e-6))
        floor = adapter.material(engine.Collider.halfspace((0.0, 0.0, 1.0)))
        self.world.add_body(engine.RigidBody.fixed(), [floor])
        properties = engine.MassProperties((0.0, 0.0, 0.0), body.mass, body.inertia.tolist())
        self.parts = []
        for row in starts().tolist():
            pose = engine.Isometry3(row[:3], engine.Rotation3.from_quaternion(*row[3:]))
            nut = engine.RigidBody.dynamic().position(pose).additional_mass_properties(properties).can_sleep(False)
            hull = adapter.material(engine.Collider.convex_hull(body.corners.tolist()))
            self.parts.append(self.world.rigid_bodies[self.world.add_body(nut, [hull])])

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self.world.step()

    def motion(self) -> NDArray[np.float64]:
        rows = []
        for each in self.parts:
            p, q, v, w = each.translation, each.rotation, each.linvel, each.angvel
            rows.append([p.x, p.y, p.z, q.w, q.i, q.j, q.k, v.x, v.y, v.z, w.x, w.y, w.z])
        return np.array(rows)


ENGINES: dict[str, Callable[[float], Heap]] = {
    "Bullet, ERP 0": lambda dt: BulletHeap(dt, 0.0),
    "Bullet, ERP 0.2": lambda dt: BulletHeap(dt, 0.2),
    "plain MuJoCo, solref 0 -(1+e)/dt": lambda dt: MujocoHeap(dt, lambda dt: f"0 {-(1.0 + RESTITUTION) / dt!r}"),
    "plain MuJoCo, solref 2 dt, 1": lambda dt: MujocoHeap(dt, lambda dt: f"{2.0 * dt!r} 1"),
    "Rapier, no correction": lambda dt: RapierHeap(dt, 0.0),
    "Rapier, correction up to 3 m/s": lambda dt: RapierHeap(dt, 3.0),
}


@dataclass(frozen=True)
class HeapStudy:
    """What a heap did.

    Attributes:
        largest, total: gain of energy between two looks and of all of them, over that at the start [%].
        left: energy at the end above the least that there was, over that at the start [%].
        lowest: height of the lowest centre at the end [m].
        wall_s: per simulated second [s].
    """

    largest: float
    total: float
    left: float
    lowest: float
    wall_s: float


def watched(heap: Heap, steps_per_ms: int) -> HeapStudy:
    """Advance a heap and look at its energy."""
    values, wall = [energy(heap.motion())], 0.0
    for _ in range(round(DURATION_S / LOOK_S)):
        began = time.perf_counter()
        heap.advance(round(LOOK_S * 1e3 * steps_per_ms))
        wall += time.perf_counter() - began
        values.append(energy(heap.motion()))
    gains = np.maximum(np.diff(values), 0.0)
    largest, total, left = (
        100.0 * float(each) / values[0] for each in (gains.max(), gains.sum(), values[-1] - min(values))
    )
    return HeapStudy(float(largest), float(total), left, float(heap.motion()[:, 2].min()), wall / DURATION_S)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps-per-ms", type=int, nargs="+", default=list(STEPS_PER_MS))
    options = parser.parse_args()
    print(f"{'engine':<34} steps/ms  largest gain %  all gains %  last over least %  lowest mm  wall s/s")
    for name, build in ENGINES.items():
        for steps in options.steps_per_ms:
            try:
                heap = build(1e-3 / steps)
            except ImportError as error:
                print(f"{name}: skipped, not installed ({error})", file=sys.stderr)
                continue
            study = watched(heap, steps)
            shown = f"{study.largest:14.3g}  {study.total:11.3g}  {study.left:17.3g}  {1e3 * study.lowest:9.4g}"
            print(f"{name:<34} {steps:8d}  {shown}  {study.wall_s:8.2g}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
