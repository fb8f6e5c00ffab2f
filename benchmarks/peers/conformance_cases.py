"""The cases of the conformance set in an engine of this folder: starts, the motion of the plate, stepping.

What is measured in the motion is conformance/motions.py, the same as for feeder_sim's own engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from case_files import GRAVITY, Result, part
from case_files import case as tables_of
from cases import (
    SPIN,
    STATE,
    THROWN,
    VELOCITY,
    Body,
    Method,
    Setup,
    ShakenWorld,
    drift,
    steel_ball,
    steel_cube,
    steel_nut,
)
from motions import OBSERVERS, Motion, starts_of
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.measures.statistic import Statistic

BODIES: dict[str, Callable[[], Body]] = {
    "ball": steel_ball,
    "nut": steel_nut,
    "cube": lambda: steel_cube(float(np.ptp(part("cube").corners[:, 0]))),
}
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
    motion = Motion(times(setup.dt, n), rows[:, :3], rows[:, VELOCITY], rows[:, SPIN], every_step=True)
    with np.errstate(invalid="ignore"):
        numbers = OBSERVERS[case](motion)
    return numbers if np.isfinite(rows).all() else dict.fromkeys(numbers, math.nan)


def _setup(case: str, steps: int) -> tuple[Setup, int, NDArray[np.float64] | None]:
    """A case at its start, the number of steps, and the heights of the plate, or x and height; None at rest."""
    tables, ((name, position, turn, velocity, _),) = tables_of(case), starts_of(case)
    plate, duration = tables["plate"], tables["duration_s"]
    fall = math.sqrt(2.0 * GRAVITY * 1e-3 * tables["start"][0]["height_mm"])
    dt = 1.0 / (steps * plate.get("frequency_hz", 1e3))
    setup, n = Setup(dt, BODIES[name](), position, turn, velocity, "rest", None), round(duration / dt)
    if plate["motion"] == "rest":
        return replace(setup, impact_speed=fall or float(np.linalg.norm(velocity))), n, None
    if plate["motion"] == "rising":
        speed = plate["speed_m_s"]
        setup = replace(setup, plate="rising", impact_speed=speed, amplitude=speed * duration)
        return setup, n, speed * times(dt, n)
    omega = 2.0 * math.pi * plate["frequency_hz"]
    z = 1e-6 * plate.get("z_um", 0.0) * np.sin(omega * times(dt, n))
    if "x_um" in plate:
        x = 1e-6 * plate["x_um"] * np.sin(omega * times(dt, n) + math.radians(plate.get("x_phase_deg", 0.0)))
        return replace(setup, plate="shaken", amplitude=float(np.abs(z).max())), n, np.column_stack([x, z])
    period_one = GRAVITY / plate["frequency_hz"] / (1.0 + tables["contact"]["restitution"])
    return replace(setup, plate="piston", impact_speed=period_one, amplitude=1e-6 * plate["z_um"]), n, z


def times(dt: float, n: int) -> NDArray[np.float64]:
    """The beginnings of n steps, and the end of the last."""
    return np.asarray(dt * np.arange(n + 1), np.float64)


def piston_zero(method: Method, steps: int, seeds: int) -> dict[str, Statistic]:
    """Mean drift of a nut on a piston in both directions [mm/s]; seeds that blew up are left out."""
    drifts = []
    for sequence in np.random.SeedSequence(0).spawn(seeds):
        drifts.append(_piston_seed(method, steps, np.random.default_rng(sequence)))
    return {f"drift_{axis}": Statistic.of(d[i] for d in drifts) for i, axis in enumerate("xy")}


def _piston_seed(method: Method, steps: int, rng: np.random.Generator) -> NDArray[np.float64]:
    tables = tables_of("piston_zero")
    plate, start = tables["plate"], tables["start"][0]
    body, dt, amplitude = steel_nut(), 1.0 / (plate["frequency_hz"] * steps), 1e-6 * plate["z_um"]
    yaw, about = math.radians(rng.uniform(*start["yaw_deg"])), rng.uniform(0.0, 2.0 * math.pi)
    tilt = math.radians(rng.uniform(*start["tilt_deg"]))
    turn = Rotation.from_rotvec([tilt * math.cos(about), tilt * math.sin(about), 0.0]) * Rotation.from_euler("z", yaw)
    lowest = float(turn.apply(body.corners)[:, 2].min())
    position = np.array([0.0, 0.0, 1e-3 * rng.uniform(*start["height_mm"]) - lowest])
    omega = 2.0 * math.pi * plate["frequency_hz"]
    quaternion = turn.as_quat(scalar_first=True)
    setup = Setup(dt, body, position, quaternion, np.zeros(3), "piston", None, amplitude * omega, amplitude)
    world, out = method.build(setup), np.zeros((CHUNK, STATE))
    chunks = round(tables["duration_s"] / (CHUNK * dt))
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
