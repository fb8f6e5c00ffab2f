"""Newton's XPBD solver and MuJoCo Warp, both through Warp on the processor.

Both compute in single precision and start hundreds of kernels a step, so that a step takes milliseconds on a processor:
they get the short cases only. Newton gets millimetres, grams and milliseconds: in SI a part of 0.1 g does not turn.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import Any

import numpy as np
from cases import QUATERNION, SPIN, STATE, VELOCITY, Method, Setup
from chart_cases import FRICTION, RESTITUTION
from numpy.typing import NDArray
from plain_mujoco import TUNED, Contact, PatchWorld
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY

warp: Any = importlib.import_module("warp")
warp.config.quiet = True
newton: Any = importlib.import_module("newton")
mujoco_warp: Any = importlib.import_module("mujoco_warp")

LENGTH_UNIT, TIME_UNIT, MASS_UNIT = 1e-3, 1e-3, 1e-3  # of Newton's world, in SI
LENGTH, WIDTH, DEPTH = 0.12, 0.04, 0.01  # of the plate's box [m]
FOOT = 1e-5  # radius of the spheres at the corners of a nut [m]
ITERATIONS = 4
SHORT = ("rebound", "slide", "oblique_sticking", "slide_to_rest", "rising_plate", "throw", "bouncing_ball")
SINGLE = Contact(tolerance=1e-6)


class NewtonWorld:
    """The plate is a kinematic body whose place and velocity are written before every step."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        rate = LENGTH_UNIT / TIME_UNIT
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY * TIME_UNIT**2 / LENGTH_UNIT))
        shape = newton.ModelBuilder.ShapeConfig(
            density=0.0, mu=FRICTION, restitution=RESTITUTION, mu_torsional=0.0, mu_rolling=0.0, margin=0.0, gap=0.0
        )
        eye = np.eye(3)
        self.plate = builder.add_body(mass=1e6, inertia=warp.mat33(1e12 * eye), is_kinematic=True)
        half = [0.5 * side / LENGTH_UNIT for side in (LENGTH, WIDTH, DEPTH)]
        below = warp.transform((0.0, 0.0, -half[2]), warp.quat_identity())
        builder.add_shape_box(self.plate, xform=below, hx=half[0], hy=half[1], hz=half[2], cfg=shape)
        body = setup.body
        inertia = np.diag(body.inertia) / (MASS_UNIT * LENGTH_UNIT**2)
        turn = warp.quat(*np.roll(setup.quaternion, -1).tolist())
        start = warp.transform((setup.position / LENGTH_UNIT).tolist(), turn)
        self.part = builder.add_body(xform=start, mass=body.mass / MASS_UNIT, inertia=warp.mat33(inertia))
        for corner in body.corners:
            place = warp.transform((corner / LENGTH_UNIT).tolist(), warp.quat_identity())
            builder.add_shape_sphere(self.part, xform=place, radius=(body.radius or FOOT) / LENGTH_UNIT, cfg=shape)
        self.model = builder.finalize(device="cpu")
        self.solver = newton.solvers.SolverXPBD(
            self.model, enable_restitution=True, iterations=ITERATIONS, rigid_contact_relaxation=1.0
        )
        self.pipeline = newton.CollisionPipeline(self.model)
        self.contacts, self.control = self.pipeline.contacts(), self.model.control()
        self.now, self.next = self.model.state(), self.model.state()
        motion = self.now.body_qd.numpy()
        motion[self.part, :3] = setup.velocity / rate
        self.now.body_qd.assign(motion)

    def _step(self, height: float, rate: float) -> None:
        if self.setup.plate != "rest":
            pose, motion = self.now.body_q.numpy(), self.now.body_qd.numpy()  # views on a processor's memory
            pose[self.plate, 2] = height / LENGTH_UNIT
            motion[self.plate, 2] = rate * TIME_UNIT / LENGTH_UNIT
            self.now.body_q.assign(pose)
            self.now.body_qd.assign(motion)
        self.now.clear_forces()
        self.pipeline.collide(self.now, self.contacts)
        self.solver.step(self.now, self.next, self.control, self.contacts, self.setup.dt / TIME_UNIT)
        self.now, self.next = self.next, self.now

    def state(self) -> NDArray[np.float64]:
        pose = np.asarray(self.now.body_q.numpy()[self.part], np.float64)
        motion = np.asarray(self.now.body_qd.numpy()[self.part], np.float64)
        row = np.empty(STATE)
        row[:3], row[QUATERNION] = LENGTH_UNIT * pose[:3], np.roll(pose[3:], 1)
        row[VELOCITY], row[SPIN] = motion[:3] * LENGTH_UNIT / TIME_UNIT, motion[3:] / TIME_UNIT
        return row

    def fall(self, out: NDArray[np.float64]) -> None:
        for row in out:
            self._step(0.0, 0.0)
            row[:] = self.state()

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        for z, v, row in zip(height, rate, out, strict=True):
            self._step(z, v)
            row[:] = self.state()

    def ride(self, q: list[float], rate: list[float]) -> None:
        raise NotImplementedError


class MujocoWarpWorld(PatchWorld):
    """The model of plain MuJoCo, stepped by MuJoCo Warp."""

    def __init__(self, setup: Setup, contact: Contact = SINGLE) -> None:
        super().__init__(setup, contact)
        importlib.import_module("mujoco").mj_forward(self.model, self.data)
        self.warp_model = mujoco_warp.put_model(self.model)
        self.warp_data = mujoco_warp.put_data(self.model, self.data)

    def _step(self, row: NDArray[np.float64]) -> None:
        mujoco_warp.step(self.warp_model, self.warp_data)
        q, v = self.warp_data.qpos.numpy()[0], self.warp_data.qvel.numpy()[0]
        row[:7], row[7:] = q[self.first_q : self.first_q + 7], v[self.first_v : self.first_v + 6]

    def fall(self, out: NDArray[np.float64]) -> None:
        for row in out:
            self._step(row)
        self._spin_to_world(out)

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        for z, v, row in zip(height, rate, out, strict=True):
            q, motion = self.warp_data.qpos.numpy(), self.warp_data.qvel.numpy()
            q[0, 0], motion[0, 0] = z, v
            self.warp_data.qpos.assign(q)
            self.warp_data.qvel.assign(motion)
            self._step(row)
        self._spin_to_world(out)

    @staticmethod
    def _spin_to_world(rows: NDArray[np.float64]) -> None:
        """MuJoCo's spin is in the part's own axes."""
        rows[:, SPIN] = Rotation.from_quat(rows[:, QUATERNION], scalar_first=True).apply(rows[:, SPIN])


def _details(package: str, text: str) -> Any:
    return lambda setup: f"{package} {importlib.metadata.version(package)}, single precision; {text}; loop in Python"


METHODS = (
    Method(
        "Newton, XPBD",
        NewtonWorld,
        _details("newton", f"enable_restitution, {ITERATIONS} iterations, rigid_contact_relaxation=1, mm-g-ms"),
        SHORT,
        4000.0,
    ),
    Method("MuJoCo Warp", MujocoWarpWorld, _details("mujoco-warp", TUNED.details()), SHORT, 10000.0),
)
