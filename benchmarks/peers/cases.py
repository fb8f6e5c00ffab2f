"""The cases every engine gets: constants, starts, the motion of the plate, and the numbers taken from the motion.

SI units. An engine only has to build a `World` from a `Setup` and to step it; what is measured, and how it is timed,
is the same for all of them. The plate is at its place at the beginning of a step and has the mean velocity over it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from chart_cases import (
    BALL_COUNTED,
    BALL_HZ,
    BALL_PERIODS,
    BALL_UM,
    DROP_MM,
    DROP_S,
    RESTITUTION,
    SLIDE_MM_S,
    STICK_MM_S,
    TRAY_FROM_S,
    TRAY_HEIGHT,
    TRAY_HZ,
    TRAY_PHASE_DEG,
    TRAY_S,
    TRAY_UM,
    slid,
)
from numpy.typing import NDArray
from right_values import tray_speed

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.drift import transport_speed
from feeder_sim.plate.mode_shapes import StandingWave
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Ball, Box, HexNut, load_scenario, with_run
from feeder_sim.scene.cell import PASSAGE_TO, Cell, transport_cell
from feeder_sim.scene.part import build_part
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import start_poses

SCENARIOS = Path(__file__).parents[2] / "scenarios"

DRIFTS = ("drift_4750", "drift_8775")
MOVING = ("bouncing_ball", *DRIFTS)
AT_REST = ("flat_drop", "sliding_impact", "sticking_impact")

SHAKER_HZ, SHAKER_AMPLITUDE = BALL_HZ, 1e-6 * BALL_UM
SHAKER_PERIODS, SHAKER_COUNTED = BALL_PERIODS, BALL_COUNTED
BALL_DROP, DROP, SLIDE_SPEED, STICK_SPEED = 0.5e-3, 1e-3 * DROP_MM, 1e-3 * SLIDE_MM_S, 1e-3 * STICK_MM_S
YAW = math.radians(17.0)
YAWED = np.array([math.cos(0.5 * YAW), 0.0, 0.0, math.sin(0.5 * YAW)])
LONGEST_S = {"drift_4750": 15.0, "drift_8775": 6.0}  # of a seed; 1.7 and 2.4 times what the way takes
EXPECTED_S = {"drift_4750": 9.0, "drift_8775": 2.6}
PLATE, FLOOR = (0.12, 0.04, 0.01), (4.0, 4.0, 0.01)  # sides [m]
THROWN = 20e-3  # [m]; no nut of these scenarios hops a tenth as high

POSITION, QUATERNION, VELOCITY, SPIN = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
STATE = 13  # w first, spin in world axes


@dataclass(frozen=True)
class Body:
    """A part: a ball where `radius` is not 0, else the hull of its corners.

    Attributes:
        mass, inertia: [kg], shape (3,) [kg m2].
        radius: of a ball [m].
        corners: shape (n, 3) [m].
    """

    mass: float
    inertia: NDArray[np.float64]
    radius: float
    corners: NDArray[np.float64]


@dataclass(frozen=True)
class Strip:
    """The standing wave w = cos(k x) and how far the tangent plate of an engine lies from its hinge."""

    wavenumber: float
    rotation: float
    half_thickness: float


@dataclass(frozen=True)
class Setup:
    """One part over one plate.

    Attributes:
        dt: time step [s].
        body, position, quaternion, velocity: the part and its start.
        plate: "rest", "floor" (at rest and large), "rising" (at constant speed), "piston", "shaken" (along x and z) or
            "strip".
        strip: the standing wave of a strip.
        impact_speed: of a typical impact [m/s], for engines whose restitution depends on it.
        amplitude: of the plate [m], for engines that have to know.
        spin: of the part at the start, in world axes [rad/s].
    """

    dt: float
    body: Body
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    velocity: NDArray[np.float64]
    plate: str
    strip: Strip | None = None
    impact_speed: float = 0.1
    amplitude: float = 0.0
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def sides(self) -> tuple[float, float, float]:
        """Of the plate [m], for engines whose plate is a box."""
        return FLOOR if self.plate == "floor" else PLATE


class World(Protocol):
    """A scene in some engine."""

    def fall(self, out: NDArray[np.float64]) -> None:
        """One step per row over the plate at rest; rows are states."""
        ...

    def piston(self, height: list[float], rate: list[float], out: NDArray[np.float64]) -> None:
        """One step per entry with the plate at this height [m] and rate [m/s]; rows are states."""
        ...

    def ride(self, q: list[float], rate: list[float]) -> None:
        """One step per entry with the strip's modal coordinate [m] and its rate [m/s]."""
        ...

    def state(self) -> NDArray[np.float64]:
        """State of the part, shape (13,)."""
        ...


@runtime_checkable
class ShakenWorld(World, Protocol):
    """A scene whose plate also moves sideways."""

    def shake(self, place: list[list[float]], rate: list[list[float]], out: NDArray[np.float64]) -> None:
        """One step per entry with the plate at this x and height [m] and these rates [m/s]; rows are states."""
        ...


@dataclass(frozen=True)
class Method:
    """A way to use an engine.

    Attributes:
        name: as it stands in the table.
        build: makes a world.
        settings: text for the details column, given a setup.
        cases: those that it is for.
        us_per_step: what a step costs about, from which seeds and settings are chosen.
        arrives: whether a nut on a strip gets anywhere; if not, one seed is enough.
        shakes: whether its worlds are `ShakenWorld`.
    """

    name: str
    build: Callable[[Setup], World]
    settings: Callable[[Setup], str]
    cases: tuple[str, ...]
    us_per_step: float
    arrives: bool = True
    shakes: bool = False


@dataclass
class Outcome:
    """What a case gave at one setting."""

    values: list[float] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    wall_s: float = 0.0
    simulated_s: float = 0.0
    details: str = ""
    se: float = math.nan  # of the only value


def steel_ball() -> Body:
    part = build_part(Ball(shape="ball", diameter_mm=3.0, material="steel"))
    return Body(part.mass, part.inertia, part.corner_radius, part.corners)


def steel_nut() -> Body:
    part = build_part(HexNut(shape="hex_nut", size="M2.5", material="steel"))
    return Body(part.mass, part.inertia, 0.0, part.corners)


def steel_cube(side: float) -> Body:
    part = build_part(Box(shape="box", size_mm=(1e3 * side,) * 3, material="steel"))
    return Body(part.mass, part.inertia, 0.0, part.corners)


# --- the ball on the shaker -------------------------------------------------------------------------------------------


def bounce_height() -> float:
    """Height of the tops of period one over the resting ball [mm]: g T^2/8 + A sin(phi)."""
    period = 1.0 / SHAKER_HZ
    speed = 0.5 * GRAVITY * period * (1.0 - RESTITUTION) / (1.0 + RESTITUTION)  # of the plate at the impact
    ratio = speed / (SHAKER_AMPLITUDE * 2.0 * math.pi * SHAKER_HZ)
    return 1e3 * (GRAVITY * period**2 / 8.0 + SHAKER_AMPLITUDE * math.sqrt(1.0 - ratio**2))


def bouncing_ball(method: Method, steps: int) -> Outcome:
    """Mean height of the tops of the last periods [mm]."""
    body, dt = steel_ball(), 1.0 / (SHAKER_HZ * steps)
    position = np.array([0.0, 0.0, body.radius + BALL_DROP])
    impact = GRAVITY / SHAKER_HZ / (1.0 + RESTITUTION)
    setup = Setup(dt, body, position, UPRIGHT, np.zeros(3), "piston", None, impact, SHAKER_AMPLITUDE)
    n = SHAKER_PERIODS * steps
    height = SHAKER_AMPLITUDE * np.sin(2.0 * math.pi * SHAKER_HZ * dt * np.arange(n + 1))
    out, wall = _stepped(method, setup, n, height)
    outcome = Outcome(wall_s=wall, simulated_s=n * dt, details=method.settings(setup))
    z = out[-SHAKER_COUNTED * steps - 1 :, 2] - body.radius
    if not np.isfinite(z).all():
        outcome.failures.append("not finite")
    elif z.max() > THROWN:
        outcome.failures.append("thrown off")
    else:
        tops = [_top(z[i : i + steps + 1]) for i in range(0, len(z) - 1, steps)]
        outcome.values.append(1e3 * float(np.mean(tops)))
    return outcome


def _top(z: NDArray[np.float64]) -> float:
    """Height of the parabola through the highest sample and its neighbours."""
    i = int(np.clip(np.argmax(z), 1, len(z) - 2))
    slope, curve = 0.5 * (z[i + 1] - z[i - 1]), z[i + 1] - 2.0 * z[i] + z[i - 1]
    return float(z[i] - 0.5 * slope**2 / curve) if curve < 0.0 and abs(slope) < -curve else float(z.max())


# --- drops on a plate at rest -----------------------------------------------------------------------------------------


def flat_drop(method: Method, steps: int) -> Outcome:
    """Error of the first rebound of a flat nut, spin included [%]."""
    body = steel_nut()
    position = np.array([0.0, 0.0, DROP - body.corners[:, 2].min()])
    speed = math.sqrt(2.0 * GRAVITY * DROP)
    setup = Setup(1e-3 / steps, body, position, YAWED, np.zeros(3), "rest", None, speed)

    def error(up: NDArray[np.float64]) -> float:
        spin = math.hypot(*up[SPIN]) * float(np.hypot(*body.corners[:, :2].T).max())
        return 100.0 * math.hypot(max(up[9], 0.0) - RESTITUTION * speed, spin) / (RESTITUTION * speed)

    return _dropped(method, setup, error)


def sliding_impact(method: Method, steps: int) -> Outcome:
    """Error of the velocity after the impact of a ball that slides throughout [%]."""
    return _ball_impact(method, steps, SLIDE_SPEED, slid(SLIDE_SPEED))


def sticking_impact(method: Method, steps: int) -> Outcome:
    """Error of the velocity after the impact of a ball that sticks and leaves rolling [%]."""
    return _ball_impact(method, steps, STICK_SPEED, 5.0 / 7.0 * STICK_SPEED)


def _ball_impact(method: Method, steps: int, before: float, along: float) -> Outcome:
    """Error of the velocity, from that along the plate before it and the right one after it [m/s]."""
    body = steel_ball()
    position = np.array([0.0, 0.0, DROP + body.radius])
    speed = math.sqrt(2.0 * GRAVITY * DROP)
    setup = Setup(1e-3 / steps, body, position, UPRIGHT, np.array([before, 0.0, 0.0]), "rest", None, speed)

    def error(up: NDArray[np.float64]) -> float:
        return 100.0 * math.hypot(max(up[9], 0.0) - RESTITUTION * speed, up[7] - along) / speed

    return _dropped(method, setup, error)


def _dropped(method: Method, setup: Setup, error: Callable[[NDArray[np.float64]], float]) -> Outcome:
    n = round(DROP_S / setup.dt)
    out, wall = _stepped(method, setup, n, None)
    outcome = Outcome(wall_s=wall, simulated_s=DROP_S, details=method.settings(setup))
    if np.isfinite(out).all():
        outcome.values.append(error(out[int(np.argmax(out[:, 9]))]))
    else:
        outcome.failures.append("not finite")
    return outcome


WARM_UP = 50


def _stepped(
    method: Method, setup: Setup, n: int, height: NDArray[np.float64] | None
) -> tuple[NDArray[np.float64], float]:
    """States after n steps each, and the wall time of the stepping alone; a first world warms caches up."""
    out = np.zeros((n, STATE))
    for count in (WARM_UP, n):
        world = method.build(setup)
        if height is None:
            started = time.perf_counter()
            world.fall(out[:count])
        else:
            z, rate = height[:count].tolist(), (np.diff(height)[:count] / setup.dt).tolist()
            started = time.perf_counter()
            world.piston(z, rate, out[:count])
        wall = time.perf_counter() - started
    return out, wall


# --- the nut on the tray ----------------------------------------------------------------------------------------------


def tray(method: Method, steps: int) -> Outcome:
    """Error of the mean speed of a nut on a tray that moves in an ellipse and never throws it [%]."""
    body, dt = steel_nut(), 1.0 / (TRAY_HZ * steps)
    place = np.array([0.0, 0.0, -body.corners[:, 2].min()])
    setup = Setup(dt, body, place, YAWED, np.zeros(3), "shaken", amplitude=TRAY_HEIGHT)
    n = round(TRAY_S / dt)
    phase = 2.0 * math.pi * TRAY_HZ * dt * np.arange(n + 1)
    along, up = 1e-6 * TRAY_UM * np.sin(phase + math.radians(TRAY_PHASE_DEG)), TRAY_HEIGHT * np.sin(phase)
    motion = np.stack([along - along[0], up], axis=1)
    out, wall = np.zeros((n, STATE)), 0.0
    for count in (WARM_UP, n):
        world = method.build(setup)
        assert isinstance(world, ShakenWorld)
        places, rates = motion[:count].tolist(), (np.diff(motion, axis=0)[:count] / dt).tolist()
        started = time.perf_counter()
        world.shake(places, rates, out[:count])
        wall = time.perf_counter() - started
    outcome = Outcome(wall_s=wall, simulated_s=n * dt, details=method.settings(setup))
    if np.isfinite(out).all():
        first = round(TRAY_FROM_S / dt)
        speed = (out[-1, 0] - out[first - 1, 0]) / (TRAY_S - TRAY_FROM_S)
        outcome.values.append(100.0 * abs(float(speed) / tray_speed() - 1.0))
    else:
        outcome.failures.append("not finite")
    return outcome


# --- the nut on the strip ---------------------------------------------------------------------------------------------


def drift(method: Method, case: str, steps: int, seeds: int) -> Outcome:
    """Transport speed of each seed [mm/s], with the starts of `feeder-sim run`."""
    loaded = load_scenario(SCENARIOS / f"{case}hz.toml")
    scene = build_scene(with_run(loaded, steps_per_period=steps, seeds=max(seeds, 1)))
    cell = transport_cell(scene)
    wave = scene.driven[0].shape
    assert cell is not None and isinstance(wave, StandingWave)
    strip = Strip(wave.wavenumber, wave.rotation, 0.5 * scene.surface.thickness)
    outcome, run = Outcome(), scene.scenario.run
    for sequence in np.random.SeedSequence(run.seed).spawn(seeds):
        setup = _drift_setup(scene, strip, np.random.default_rng(sequence))
        outcome.details = method.settings(setup)
        _drift_seed(method, setup, scene, cell, LONGEST_S[case], outcome)
    return outcome


def _drift_setup(scene: Scene, strip: Strip, rng: np.random.Generator) -> Setup:
    part, pose, drive = scene.parts[0], start_poses(scene, rng)[0], scene.drives[0]
    body = Body(part.mass, part.inertia, 0.0, part.corners)
    speed = drive.amplitude * 2.0 * math.pi * drive.drive_frequency
    return Setup(
        scene.timestep, body, pose.position, pose.quaternion, np.zeros(3), "strip", strip, speed, drive.amplitude
    )


def _drift_seed(method: Method, setup: Setup, scene: Scene, cell: Cell, longest: float, outcome: Outcome) -> None:
    """Step one seed frame by frame until it arrives; add its speed or its failure."""
    n, dt = scene.steps_per_frame, setup.dt
    warm = method.build(setup)
    warm.ride([0.0] * WARM_UP, [0.0] * WARM_UP)
    world = method.build(setup)
    rows, wall, failure = [world.state()], 0.0, "did not arrive"
    for frame in range(round(longest / scene.frame_interval)):
        q = scene.surface.terms.phasor(dt * np.arange(frame * n, (frame + 1) * n + 1), 1)[:, 0].real
        here, rate = q[:-1].tolist(), (np.diff(q) / dt).tolist()
        started = time.perf_counter()
        world.ride(here, rate)
        wall += time.perf_counter() - started
        rows.append(world.state())
        if not np.isfinite(rows[-1]).all():
            failure = "not finite"
            break
        if rows[-1][2] > THROWN:
            failure = "thrown off"
            break
        if abs(rows[-1][0]) >= cell.reach * (1.0 - PASSAGE_TO) and (
            cell.distance_to_node(_frames(rows[-1:], scene)) <= PASSAGE_TO
        ):
            break
    outcome.wall_s += wall
    outcome.simulated_s += (len(rows) - 1) * scene.frame_interval
    speed = 1e3 * transport_speed(_frames(rows, scene), cell) if np.isfinite(rows[-1]).all() else math.nan
    if math.isfinite(speed):
        outcome.values.append(speed)
    else:
        outcome.failures.append(failure)


def _frames(rows: list[NDArray[np.float64]], scene: Scene) -> Frames:
    states: NDArray[np.float64] = np.array(rows, np.float64)[:, None]
    time_s = np.asarray(scene.frame_interval * np.arange(len(rows)), np.float64)
    present = np.ones((len(rows), 1), bool)
    return Frames(
        time_s, states[..., POSITION], states[..., QUATERNION], states[..., VELOCITY], states[..., SPIN], present
    )
