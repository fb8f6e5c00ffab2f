"""Random scenes of several parts, and what must hold in each: the laws of mechanics, and rest where parts can rest.

    finding = judged("pair", 12)

pair   two parts meet in flight: momentum and angular momentum are kept, energy does not grow
heap   two to twelve parts fall on each other on a plate at rest, with or without a rim: they rest, out of each other
joint  the same without a step, to 10 nm
over   parts fall on two edges of a plate, at rest or driven: what tips over falls beside it, and does not get under it
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from conftest import hull_distances
from invariants import angular_momentum, depth_under, energy, growth, momentum, recorded
from judged_scenes import GAINED, SLOWEST, Finding, Rng, ball, corner_part

from feeder_sim.errors import InputError
from feeder_sim.records.seed import Counts
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import Scene

Raw = dict[str, Any]
KEPT = 1e-9  # of momenta, and of energy in flight
INTO_EACH_OTHER, INTO_PLATE = 2e-6, 1e-7  # [m]
HALF, THICK, UNDER = 90e-3, 3e-3, 2e-3  # [m] of the plate of `over`, and from its edge, where a part is under it
LAST = 0.02  # [s] in which what can rest does
SLIDES = ("ball", "cylinder")  # and rolls


def scene(kind: str, seed: int) -> Raw:
    """The scene of a kind, one of `KINDS`, with a number."""
    rng = np.random.default_rng(seed)
    raw = KINDS[kind](rng)
    e, mu = float(rng.choice([0.0, 0.2, 0.5, 0.9])), float(rng.choice([0.0, 0.1, 0.3, 1.0]))
    contact = {"restitution": e, "friction": mu, "part_restitution": e, "part_friction": mu}
    return {"title": f"Random scene {seed}, {kind}", "contact": contact} | raw


def judged(kind: str, seed: int) -> Finding | None:
    """Run a scene and look at what came out; None where the scene is refused."""
    raw = scene(kind, seed)
    try:
        scenario = validated(raw, Scenario, Path(f"{kind}_{seed}.toml"))
        recorded(scenario.changed({"run.duration_s": 2.0 / raw["run"]["frames_per_second"]}))  # compiled
        began = time.perf_counter()
        made, (frames,) = recorded(scenario)
    except InputError:
        return None
    wall_s = (time.perf_counter() - began) / raw["run"]["duration_s"]
    faults = LAWS[kind](raw, made, frames)
    if wall_s > SLOWEST:
        faults.append(f"takes {wall_s:.3g} s per simulated second")
    return Finding(raw, tuple(faults), wall_s, Counts(), growth(made, frames))


def _part(rng: Rng) -> Raw:
    if rng.random() < 0.2:
        sizes = {"diameter_mm": float(rng.uniform(1.0, 8.0)), "height_mm": float(rng.uniform(1.0, 8.0))}
        return {"shape": "cylinder"} | sizes
    return ball(rng) if rng.random() < 0.2 else corner_part(rng)


def _turn(rng: Rng) -> list[float]:
    turn = rng.normal(size=4)
    return [float(value) for value in turn / np.linalg.norm(turn)]


def _pair(rng: Rng) -> Raw:
    parts = []
    for side in (-1.0, 1.0):
        place = [9.0 * side, *(float(value) for value in rng.uniform(-2.0, 2.0, 2))]
        start = {
            "kind": "state",
            "position_mm": [place[0], place[1], 400.0 + place[2]],
            "quaternion": _turn(rng),
            "velocity_mm_s": [-side * float(rng.uniform(50.0, 400.0)), *rng.uniform(-20.0, 20.0, 2).tolist()],
            "angular_velocity_rad_s": (rng.normal(size=3) * float(rng.choice([0.0, 20.0, 100.0]))).tolist(),
        }
        parts.append(_part(rng) | {"start": start})
    run = {"duration_s": 0.08, "seeds": 1, "frames_per_second": 1000.0}
    return {"plate": {"kind": "still"}, "part": parts, "run": run}


def _heap(rng: Rng) -> Raw:
    parts, height = [], 16.0
    for _ in range(int(rng.integers(2, 13))):
        x, y = rng.uniform(-6.0, 6.0, 2)
        start = {"kind": "state", "position_mm": [float(x), float(y), height], "quaternion": _turn(rng)}
        parts.append(_part(rng) | {"start": start})
        height += 14.0
    rim = bool(rng.random() < 0.5)
    size = 120.0 if rim else 800.0  # over whose edge none comes
    plate = {"kind": "still", "length_mm": size, "width_mm": size, "rim": rim}
    return {"plate": plate, "part": parts, "run": {"duration_s": 1.5, "seeds": 1, "frames_per_second": 500.0}}


def _joint(rng: Rng) -> Raw:
    raw = _heap(rng)
    return raw | {"run": raw["run"] | {"tolerance_nm": 10.0}}


def _over(rng: Rng) -> Raw:
    parts = []
    for y in np.arange(-75.0, 76.0, 15.0):
        for side in (-1.0, 1.0):
            start = {
                "kind": "state",
                "position_mm": [side * float(rng.uniform(86.0, 89.9)), float(y), 12.0],
                "quaternion": _turn(rng),
                "velocity_mm_s": [30.0 * side * rng.random(), 5.0 * rng.normal(), 0.0],
                "angular_velocity_rad_s": (20.0 * rng.normal(size=3)).tolist(),
            }
            parts.append(_part(rng) | {"start": start})
    plate = {"kind": "still", "length_mm": 2e3 * HALF, "width_mm": 2e3 * HALF}
    raw: Raw = {"plate": plate, "part": parts, "run": {"duration_s": 0.5, "seeds": 1, "frames_per_second": 400.0}}
    if rng.random() < 0.5:
        plate["kind"] = "piston"
        raw["drive"] = [{"frequency_hz": 558.0, "amplitude_um": 20.0, "ring_up": False}]
    return raw


def _falls_beside(raw: Raw, made: Scene, frames: Frames) -> list[str]:
    over = (np.abs(frames.position[..., :2]) < HALF - UNDER).all(axis=2)
    height = frames.position[..., 2]
    under = (over & frames.present & (height < 0.0) & (height > -THICK)).any(axis=0)
    return [f"part {i}, {raw['part'][i]['shape']}, gets under the plate" for i in np.flatnonzero(under)]


def _flies(raw: Raw, made: Scene, frames: Frames) -> list[str]:
    push, spin, total = momentum(made, frames), angular_momentum(made, frames), energy(made, frames).sum(axis=1)
    mass = np.array([part.mass for part in made.parts])
    size = float((mass * np.linalg.norm(frames.velocity[0], axis=1)).sum())
    faults = []
    for name, values, scale in (("momentum", push, size), ("angular momentum", spin, max(_size(spin), 1e-3 * size))):
        lost = float(np.abs(values - values[0]).max()) / scale
        if lost > KEPT:
            faults.append(f"{name} changes by {lost:.2g}")
    gained = float((total - np.minimum.accumulate(total)).max() / total[0])
    if gained > KEPT:
        faults.append(f"energy grows by {gained:.2g}")
    return faults + _apart(made, frames)


def _size(values: np.ndarray) -> float:
    return float(np.linalg.norm(values[0]))


def _apart(made: Scene, frames: Frames) -> list[str]:
    deepest = -float(hull_distances(made, frames).min(initial=0.0))
    return [f"parts are {1e6 * deepest:.3g} um in each other"] if deepest > INTO_EACH_OTHER else []


def _lies(raw: Raw, made: Scene, frames: Frames) -> list[str]:
    faults = []
    half = 0.5e-3 * np.array([raw["plate"]["length_mm"], raw["plate"]["width_mm"]])
    on_plate = (np.abs(frames.position[:, :, :2]) < half).all(axis=2).all(axis=0)
    deepest = float(depth_under(made, frames)[:, on_plate].max(initial=0.0))
    if deepest > INTO_PLATE:
        faults.append(f"a part is {1e6 * deepest:.3g} um in the plate")
    gain = growth(made, frames)
    if gain > GAINED:
        faults.append(f"energy grows by {1e6 * gain:.3g} um m g")
    late = frames[slice(-round(LAST / (frames.time[1] - frames.time[0])), None)]
    rests = raw["contact"]["friction"] > 0.0 and not any(part["shape"] in SLIDES for part in raw["part"])
    speed = float(np.linalg.norm(late.velocity[:, on_plate], axis=2).max(initial=0.0))
    if rests and on_plate.all() and speed > 0.0:
        faults.append(f"a part still moves by {1e3 * speed:.3g} mm/s")
    return faults + _apart(made, frames[slice(0, None, 10)])


KINDS: dict[str, Callable[[Rng], Raw]] = {"pair": _pair, "heap": _heap, "joint": _joint, "over": _over}
LAWS: dict[str, Callable[[Raw, Scene, Frames], list[str]]] = {
    "pair": _flies,
    "heap": _lies,
    "joint": _lies,
    "over": _falls_beside,
}
