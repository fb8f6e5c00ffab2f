"""The cases of the conformance set in an engine of this folder: starts, the motion of the plate, stepping.

What is measured in the motion is conformance_set/motions.py, the same as for feeder_sim's own engines.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import numpy as np
from cases import (
    SPIN,
    STATE,
    THROWN,
    UPRIGHT,
    VELOCITY,
    YAW,
    Body,
    Method,
    Setup,
    ShakenWorld,
    drift,
    steel_ball,
    steel_cube,
    steel_nut,
)
from chart_cases import APPROACH, BALL_HZ, BALL_PERIODS, BALL_UM, DROP_MM, DROP_S, RESTITUTION, SLIDE_MM_S
from conformance_set.cases import (
    CREEP_S,
    CUBE_SIDE,
    CUBE_TILT_DEG,
    FAST_HZ,
    FAST_S,
    FAST_SPEED,
    FAST_UM,
    PISTON_HZ,
    PISTON_S,
    PISTON_UM,
    PLATE_DROP,
    PLATE_SPEED,
    REST_SPEED,
    STICK_SPEED,
    THROW_UM,
    TRAY_HZ,
    TRAY_PHASE_DEG,
    TRAY_S,
    TRAY_UM,
    tray_height,
)
from conformance_set.judge import Result
from conformance_set.motions import OBSERVERS, Motion
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.constants import GRAVITY
from feeder_sim.measures.statistic import Statistic

RISE_S = 0.01
BALL_START = 0.5e-3  # of the ball over the shaker [m]
TRAYS = ("two_axes", "fast_slip")
CHUNK = 4750  # steps of the piston between two looks at the nut


def once(method: Method, case: str, steps: int) -> dict[str, float]:
    """Quantities of a case without chance at so many steps per period, or per millisecond; NaN where it blew up."""
    setup, n, height = _setup(case, steps)
    world = method.build(setup)
    out = np.zeros((n, STATE))
    if height is None:
        world.fall(out)
    elif height.ndim == 2:
        cast("ShakenWorld", world).shake(height[:-1].tolist(), (np.diff(height, axis=0) / setup.dt).tolist(), out)
    else:
        world.piston(height[:-1].tolist(), (np.diff(height) / setup.dt).tolist(), out)
    begin = np.concatenate([setup.position, setup.quaternion, setup.velocity, np.zeros(3)])
    rows = np.vstack([begin, out])
    motion = Motion(_times(setup.dt, n), rows[:, :3], rows[:, VELOCITY], rows[:, SPIN], every_step=True)
    with np.errstate(invalid="ignore"):
        numbers = OBSERVERS[case](motion)
    return numbers if np.isfinite(rows).all() else dict.fromkeys(numbers, math.nan)


def _setup(case: str, steps: int) -> tuple[Setup, int, NDArray[np.float64] | None]:
    """A case at its start, the number of steps, and the heights of the plate, or x and height; None at rest."""
    if case in ("rebound", "slide", "oblique_sticking", "slide_to_rest", "mesh_cube"):
        return _at_rest(case, 1e-3 / steps)
    if case in TRAYS:
        return _on_tray(case, steps)
    ball = steel_ball()
    if case == "rising_plate":
        dt = 1e-3 / steps
        n = round(RISE_S / dt)
        setup = _ball_over_piston(ball, dt, PLATE_DROP, PLATE_SPEED, PLATE_SPEED * RISE_S)
        return replace(setup, plate="rising"), n, PLATE_SPEED * _times(dt, n)
    amplitude = 1e-6 * {"throw": THROW_UM, "bouncing_ball": BALL_UM}[case]
    dt, n = 1.0 / (BALL_HZ * steps), BALL_PERIODS * steps
    impact = GRAVITY / BALL_HZ / (1.0 + RESTITUTION)
    setup = _ball_over_piston(ball, dt, BALL_START, impact, amplitude)
    return setup, n, amplitude * np.sin(2.0 * math.pi * BALL_HZ * _times(dt, n))


def _times(dt: float, n: int) -> NDArray[np.float64]:
    return np.asarray(dt * np.arange(n + 1), np.float64)


def _ball_over_piston(ball: Body, dt: float, drop: float, impact: float, amplitude: float) -> Setup:
    position = np.array([0.0, 0.0, ball.radius + drop])
    return Setup(dt, ball, position, UPRIGHT, np.zeros(3), "piston", None, impact, amplitude)


def _at_rest(case: str, dt: float) -> tuple[Setup, int, None]:
    drop, along, duration, impact = 1e-3 * DROP_MM, 0.0, DROP_S, APPROACH
    body, turn = steel_ball(), UPRIGHT
    if case in ("rebound", "slide_to_rest"):
        body, turn = steel_nut(), np.array([math.cos(0.5 * YAW), 0.0, 0.0, math.sin(0.5 * YAW)])
    if case == "slide":
        along = 1e-3 * SLIDE_MM_S
    elif case == "oblique_sticking":
        along = STICK_SPEED
    elif case == "slide_to_rest":
        drop, along, duration, impact = 0.0, REST_SPEED, CREEP_S, REST_SPEED
    elif case == "mesh_cube":
        body, half = steel_cube(CUBE_SIDE), math.radians(0.5 * CUBE_TILT_DEG)
        turn = np.array([math.cos(half), 0.0, math.sin(half), 0.0])
    lowest = body.radius or -float(Rotation.from_quat(turn, scalar_first=True).apply(body.corners)[:, 2].min())
    velocity = np.array([along, 0.0, 0.0])
    setup = Setup(dt, body, np.array([0.0, 0.0, lowest + drop]), turn, velocity, "rest", None, impact)
    return setup, round(duration / dt), None


def _on_tray(case: str, steps: int) -> tuple[Setup, int, NDArray[np.float64]]:
    """A nut that lies on a tray, and where that is in x and z."""
    frequency, duration, speed = (TRAY_HZ, TRAY_S, 0.0) if case == "two_axes" else (FAST_HZ, FAST_S, FAST_SPEED)
    body, dt, n = steel_nut(), 1.0 / (frequency * steps), round(duration * frequency * steps)
    phase = 2.0 * math.pi * frequency * _times(dt, n)
    if case == "two_axes":
        x, z = 1e-6 * TRAY_UM * np.sin(phase + math.radians(TRAY_PHASE_DEG)), tray_height() * np.sin(phase)
    else:
        x, z = 1e-6 * FAST_UM * np.sin(phase), 0.0 * phase
    turn = np.array([math.cos(0.5 * YAW), 0.0, 0.0, math.sin(0.5 * YAW)])
    position = np.array([0.0, 0.0, -float(body.corners[:, 2].min())])
    setup = Setup(dt, body, position, turn, np.array([speed, 0.0, 0.0]), "shaken", amplitude=float(np.abs(z).max()))
    return setup, n, np.column_stack([x, z])


def piston_zero(method: Method, steps: int, seeds: int, seed_s: float = PISTON_S) -> dict[str, Statistic]:
    """Mean drift of a nut on a piston in both directions [mm/s]; seeds that blew up are left out."""
    drifts = []
    for sequence in np.random.SeedSequence(0).spawn(seeds):
        drifts.append(_piston_seed(method, steps, np.random.default_rng(sequence), seed_s))
    return {f"drift_{axis}": Statistic.of(d[i] for d in drifts) for i, axis in enumerate("xy")}


def _piston_seed(method: Method, steps: int, rng: np.random.Generator, seed_s: float) -> NDArray[np.float64]:
    body, dt, amplitude = steel_nut(), 1.0 / (PISTON_HZ * steps), 1e-6 * PISTON_UM
    yaw, about = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.0, 2.0 * math.pi)
    tilt = math.radians(rng.uniform(0.0, 3.0))
    turn = Rotation.from_rotvec([tilt * math.cos(about), tilt * math.sin(about), 0.0]) * Rotation.from_euler("z", yaw)
    lowest = float(turn.apply(body.corners)[:, 2].min())
    position = np.array([0.0, 0.0, rng.uniform(0.2e-3, 0.5e-3) - lowest])
    omega = 2.0 * math.pi * PISTON_HZ
    quaternion = turn.as_quat(scalar_first=True)
    setup = Setup(dt, body, position, quaternion, np.zeros(3), "piston", None, amplitude * omega, amplitude)
    world, out = method.build(setup), np.zeros((CHUNK, STATE))
    chunks = round(seed_s / (CHUNK * dt))
    for chunk in range(chunks):
        height = amplitude * np.sin(omega * dt * np.arange(chunk * CHUNK, (chunk + 1) * CHUNK + 1))
        world.piston(height[:-1].tolist(), (np.diff(height) / dt).tolist(), out)
        if not np.isfinite(out[-1]).all() or abs(out[-1, 2]) > THROWN:
            return np.full(2, math.nan)
    return np.asarray(1e3 * out[-1, :2] / (chunks * CHUNK * dt))


def results_of(method: Method, case: str, steps: int, seeds: int) -> list[Result]:
    """Results of one engine on one case at one setting."""
    if case in OBSERVERS:
        numbers = once(method, case, steps)
        return [
            Result(case, q, v, engine=method.name, setting=steps, failure="" if math.isfinite(v) else "blew up")
            for q, v in numbers.items()
        ]
    if case == "piston_zero":
        found = piston_zero(method, steps, seeds)
        failure = "thrown off"
    else:
        outcome = drift(method, case, steps, seeds)
        found = {"transport_speed": Statistic.of(outcome.values)}
        failure = "; ".join(sorted(set(outcome.failures)))
    return [Result(case, q, s.mean, s.se, method.name, steps, s.n, "" if s.n else failure) for q, s in found.items()]
