"""MuJoCo as its documentation describes it, stepped from Python: `mj_step`, a mesh or a sphere on a box.

Three plates: one whose state is written before every step (the best), a mocap body, and a height field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from cases import AT_REST, MOVING, QUATERNION, SPIN, Method, Setup
from chart_cases import FRICTION, RESTITUTION
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY

PLATE_MASS_RATIO = 1e6
LENGTH, WIDTH, DEPTH = 0.12, 0.04, 0.01  # of the plate's box [m]
NO_OTHERS = 'contype="0" conaffinity="0"'  # contacts than the pair's
GRID = 61  # columns of the height field


@dataclass(frozen=True)
class Contact:
    """What the documentation offers for a contact.

    Attributes:
        solref: "time constant, damping ratio", or None for the direct format, "-stiffness -damping".
        stiffness, damping: times dt^2, times dt. Damping 1 + e alone turns the velocity round in one step.
        friction: damping of the friction rows, times dt; 1 stops a sliding part and does not turn it round.
        solimp, cone: as in MJCF.
        multiccd: all corners of a face at once.
        tolerance: of the solver.
    """

    solref: str | None = None
    stiffness: float = 0.0
    damping: float = 1.0 + RESTITUTION
    friction: float | None = 1.0
    solimp: str = "0.9999 0.9999 0.001 0.5 2"
    cone: str = "elliptic"
    multiccd: str = "enable"
    tolerance: float = 1e-15

    def text(self, dt: float) -> str:
        """The contact of plate and part, as an explicit pair: only that can have a `solreffriction`."""
        solref = self.solref or f"{-self.stiffness / dt**2!r} {-self.damping / dt!r}"
        sliding = "" if self.friction is None else f'solreffriction="0 {-self.friction / dt!r}"'
        friction = f'friction="{FRICTION} {FRICTION} 0 0 0"'
        attributes = f'solref="{solref}" {sliding} solimp="{self.solimp}" {friction}'
        return f'<pair geom1="plate" geom2="part" {attributes}/>'

    def details(self) -> str:
        solref = self.solref or f"{-self.stiffness:g}/dt^2 {-self.damping:g}/dt"
        solver = f"cone={self.cone} multiccd={self.multiccd} tolerance={self.tolerance:g}"
        sliding = "" if self.friction is None else f" solreffriction=0 {-self.friction:g}/dt"
        return f"solref={solref}{sliding} solimp={self.solimp} {solver}"


TUNED = Contact()
SPRING = Contact(stiffness=0.1, damping=0.42)  # where the plate has no velocity only a spring pushes
LYING = Contact(stiffness=0.3, damping=0.2, friction=None)  # for a part that stays on a plate and slips


class PatchWorld:
    """The plate on a slide and a hinge in its mid-plane, far heavier than the part, its state written every step."""

    first_q, first_v = 2, 2

    def __init__(self, setup: Setup, contact: Contact = TUNED) -> None:
        self.setup = setup
        self.model = mujoco.MjModel.from_xml_string(self.xml(setup, contact))
        self.data = mujoco.MjData(self.model)
        self.pose = self.data.qpos[self.first_q : self.first_q + 7]
        self.motion = self.data.qvel[self.first_v : self.first_v + 6]
        self.motion[:3] = setup.velocity
        turn = Rotation.from_quat(setup.quaternion, scalar_first=True)
        self.motion[3:] = turn.inv().apply(setup.spin)  # in the part's own axes

    def xml(self, setup: Setup, contact: Contact) -> str:
        half = setup.strip.half_thickness if setup.strip else 0.0
        mass = PLATE_MASS_RATIO * setup.body.mass
        moment = mass * LENGTH**2
        second = 'type="slide" axis="1 0 0"' if setup.plate == "shaken" else 'type="hinge" axis="0 1 0"'
        return _xml(
            setup,
            contact,
            f'<body gravcomp="1" pos="0 0 {-half!r}"><inertial pos="0 0 0" mass="{mass!r}" '
            f'diaginertia="{moment!r} {moment!r} {moment!r}"/><joint type="slide" axis="0 0 1"/>'
            f"<joint {second}/>{_box(setup, half)}</body>",
        )

    def state(self) -> NDArray[np.float64]:
        return _to_world(np.concatenate([self.pose, self.motion])[None])[0]

    def fall(self, out: NDArray[np.float64]) -> None:
        model, data, step, pose, motion = self.model, self.data, mujoco.mj_step, self.pose, self.motion
        for row in out:
            step(model, data)
            row[:7] = pose
            row[7:] = motion
        _to_world(out)

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        model, data, step, pose, motion = self.model, self.data, mujoco.mj_step, self.pose, self.motion
        qpos, qvel = data.qpos, data.qvel
        for z, v, row in zip(height, rate, out, strict=True):
            qpos[0] = z
            qvel[0] = v
            step(model, data)
            row[:7] = pose
            row[7:] = motion
        _to_world(out)

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        for (x, z), (u, w), row in zip(place, rate, out, strict=True):
            self.data.qpos[:2] = z, x
            self.data.qvel[:2] = w, u
            mujoco.mj_step(self.model, self.data)
            row[:7] = self.pose
            row[7:] = self.motion
        _to_world(out)

    def ride(self, q: list[float], rate: list[float]) -> None:
        model, data, step, qpos, qvel = self.model, self.data, mujoco.mj_step, self.data.qpos, self.data.qvel
        strip = self.setup.strip
        assert strip is not None
        k, rotation, sin, cos = strip.wavenumber, strip.rotation, math.sin, math.cos
        for a, v in zip(q, rate, strict=True):
            x = qpos[2]
            tilt = rotation * sin(k * x)
            lift = cos(k * x) + tilt * x
            qpos[0] = lift * a
            qpos[1] = tilt * a
            qvel[0] = lift * v
            qvel[1] = tilt * v
            step(model, data)


class MocapWorld(PatchWorld):
    """The plate as a mocap body: it has a place and no velocity."""

    first_q, first_v = 0, 0

    def xml(self, setup: Setup, contact: Contact) -> str:
        half = setup.strip.half_thickness if setup.strip else 0.0
        return _xml(setup, contact, f'<body mocap="true" pos="0 0 {-half!r}">{_box(setup, half)}</body>')

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        del rate  # it has nowhere to go
        model, data, step, pose, motion = self.model, self.data, mujoco.mj_step, self.pose, self.motion
        place = data.mocap_pos[0]
        for z, row in zip(height, out, strict=True):
            place[2] = z
            step(model, data)
            row[:7] = pose
            row[7:] = motion
        _to_world(out)

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        del rate
        for (x, z), row in zip(place, out, strict=True):
            self.data.mocap_pos[0] = x, 0.0, z
            mujoco.mj_step(self.model, self.data)
            row[:7] = self.pose
            row[7:] = self.motion
        _to_world(out)

    def ride(self, q: list[float], rate: list[float]) -> None:
        del rate
        model, data, step, qpos = self.model, self.data, mujoco.mj_step, self.data.qpos
        strip, place, turn = self.setup.strip, self.data.mocap_pos[0], self.data.mocap_quat[0]
        assert strip is not None
        k, rotation, sin, cos, half = strip.wavenumber, strip.rotation, math.sin, math.cos, strip.half_thickness
        for a in q:
            x = qpos[0]
            tilt = rotation * sin(k * x)
            place[2] = (cos(k * x) + tilt * x) * a - half
            turn[2] = 0.5 * tilt * a
            step(model, data)


class FieldWorld(PatchWorld):
    """The plate as a height field whose data are rewritten before every step."""

    first_q, first_v = 0, 0

    def __init__(self, setup: Setup, contact: Contact = TUNED) -> None:
        super().__init__(setup, contact)
        x = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, GRID)
        self.shape = np.cos(setup.strip.wavenumber * x) if setup.strip else np.ones(GRID)
        self.rows = self.model.hfield_data.reshape(2, GRID)  # from 0 to 1, times twice the amplitude

    def xml(self, setup: Setup, contact: Contact) -> str:
        amplitude = setup.amplitude
        asset = (
            f'<hfield name="plate" nrow="2" ncol="{GRID}" size="{LENGTH / 2} {WIDTH / 2} {2.0 * amplitude!r} {DEPTH}"/>'
        )
        geom = f'<geom name="plate" type="hfield" hfield="plate" pos="0 0 {-amplitude!r}" {NO_OTHERS}/>'
        return _xml(setup, contact, geom, asset)

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        del rate
        model, data, step, pose, motion = self.model, self.data, mujoco.mj_step, self.pose, self.motion
        rows, scale = self.rows, 0.5 / self.setup.amplitude
        for z, row in zip(height, out, strict=True):
            rows[:] = 0.5 + scale * z
            step(model, data)
            row[:7] = pose
            row[7:] = motion
        _to_world(out)

    def ride(self, q: list[float], rate: list[float]) -> None:
        del rate
        model, data, step, rows, half = self.model, self.data, mujoco.mj_step, self.rows, 0.5
        scaled, surface = (0.5 / self.setup.amplitude) * self.shape, np.empty(GRID)
        for a in q:
            np.multiply(scaled, a, out=surface)
            np.add(surface, half, out=surface)
            rows[:] = surface
            step(model, data)


def _box(setup: Setup, top: float) -> str:
    length, width, depth = setup.sides
    place = f'size="{length / 2} {width / 2} {depth / 2}" pos="0 0 {top - 0.5 * depth!r}"'
    return f'<geom name="plate" type="box" {place} {NO_OTHERS}/>'


def _xml(setup: Setup, contact: Contact, plate: str, asset: str = "") -> str:
    body = setup.body
    if body.radius:
        geom = f'type="sphere" size="{body.radius!r}"'
    else:
        asset += f'<mesh name="part" vertex="{_numbers(body.corners.ravel())}"/>'
        geom = 'type="mesh" mesh="part"'
    return f"""<mujoco>
    <option timestep="{setup.dt!r}" gravity="0 0 {-GRAVITY}" cone="{contact.cone}" tolerance="{contact.tolerance!r}">
      <flag multiccd="{contact.multiccd}"/>
    </option>
    <asset>{asset}</asset>
    <worldbody>{plate}
      <body pos="{_numbers(setup.position)}" quat="{_numbers(setup.quaternion)}">
        <inertial pos="0 0 0" mass="{body.mass!r}" diaginertia="{_numbers(body.inertia)}"/>
        <freejoint/><geom name="part" {geom} {NO_OTHERS}/>
      </body>
    </worldbody>
    <contact>{contact.text(setup.dt)}</contact></mujoco>"""


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _to_world(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """MuJoCo's spin is in the part's own axes."""
    rows[:, SPIN] = Rotation.from_quat(rows[:, QUATERNION], scalar_first=True).apply(rows[:, SPIN])
    return rows


def _details(contact: Contact, plate: str) -> Any:
    return lambda setup: f"MuJoCo {mujoco.__version__}; {plate}; {contact.details()}; loop in Python"


METHODS = (
    Method(
        "plain MuJoCo",
        lambda setup: PatchWorld(setup, LYING if setup.plate == "shaken" else TUNED),
        _details(TUNED, "plate on slide and hinge, 1e6 part masses, qpos and qvel written every step"),
        (*MOVING, *AT_REST, "which_side_up"),
        10.0,
        shakes=True,
    ),
    Method(
        "plain MuJoCo, mocap plate",
        lambda setup: MocapWorld(setup, SPRING),
        _details(SPRING, "mocap box under the part"),
        ("bouncing_ball", "drift_8775"),
        10.0,
        arrives=False,
        shakes=True,
    ),
    Method(
        "plain MuJoCo, height field",
        lambda setup: FieldWorld(setup, SPRING),
        _details(SPRING, f"height field 2 x {GRID} rewritten every step"),
        ("bouncing_ball", "drift_8775"),
        12.0,
        arrives=False,
    ),
)
