"""Random scenes of several parts, and what must hold in each: the laws of mechanics, and rest where parts can rest.

    finding = judged("pair", 12)

pair     two parts meet in flight: momentum and angular momentum are kept, energy does not grow
heap     two to twelve parts fall on each other on a plate at rest, with or without a rim: they rest, out of each other
concave  brackets and screws that other parts meet by their convex pieces
heavy    a block of 30 mm on balls and cubes of 0.3 to 1.2 mm
mixed    parts of 0.3 to 30 mm
thin     needles of 0.1 mm and foils of 0.05 mm
over     parts fall on two edges of a plate, at rest or driven: what tips over falls beside it, not under it
shaken   parts on a piston or a tray that may be tilted, with or without a rim; none falls through it
refill   a tray that throws parts for a moment and then stands: what lies apart is picked, others are poured in
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from conftest import hull_distances
from invariants import angular_momentum, counted, depth_under, energy, growth, momentum, recorded
from judged_scenes import (
    GAINED,
    MESHES,
    MODELS,
    SLOWEST,
    SLOWEST_STAGES,
    STALL_AFTER,
    Finding,
    Rng,
    ball,
    corner_part,
    looked_at,
)
from numpy.typing import ArrayLike

from feeder_sim.constants import GRAVITY
from feeder_sim.engines.impulse.window import CALM
from feeder_sim.errors import InputError
from feeder_sim.pool.work import Work
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import Scene, build_scene

Raw = dict[str, Any]
KEPT = 1e-9  # of momenta, and of energy in flight
INTO_EACH_OTHER, INTO_PLATE = 2e-6, 1e-7  # [m]
HALF, THICK, UNDER = 90e-3, 3e-3, 2e-3  # [m] of the plate of `over`, and from its edge, where a part is under it
CYCLES, SHAKEN, STANDING, STOPPING = 3, 0.1, 1.2, 0.6  # of `refill`; times [s]
LAST = 0.02  # [s] in which what can rest does
MOST_BOUNCING = 0.8  # restitution, from which on a heap does not rest in time
SLIDES = ("ball", "cylinder")  # and rolls


def scene(kind: str, seed: int) -> Raw:
    """The scene of a kind, one of `KINDS`, with a number."""
    rng = np.random.default_rng(seed)
    raw = KINDS[kind](rng)
    e, mu = float(rng.choice([0.0, 0.2, 0.5, 0.9])), float(rng.choice([0.0, 0.1, 0.3, 1.0]))
    contact = {"restitution": e, "friction": mu, "part_restitution": e, "part_friction": mu}
    return {"title": f"Random scene {seed}, {kind}", "contact": contact} | raw


def judged(kind: str, seed: int, law: str = "newton") -> Finding | None:
    """Run a scene by a law of impact and look at what came out; None where the scene is refused."""
    raw = scene(kind, seed)
    raw["contact"]["law"] = law
    if kind == "shaken":
        return looked_at(raw, f"{kind}_{seed}", _shaken_apart)
    if kind == "refill":
        return _refilled(raw, f"{kind}_{seed}.toml")
    try:
        scenario = validated(raw, Scenario, Path(f"{kind}_{seed}.toml"))
        recorded(scenario.changed({"run.duration_s": 2.0 / raw["run"]["frames_per_second"]}))  # compiled
        began = time.perf_counter()
        made = build_scene(scenario)
        ((frames, counts),) = counted(scenario, made)
    except InputError:
        return None
    wall_s = (time.perf_counter() - began) / raw["run"]["duration_s"]
    if hull_distances(made, frames[slice(1)]).min(initial=0.0) < 0.0:
        return None  # laid into each other
    faults = broken(kind, raw, made, frames)
    if wall_s > SLOWEST:
        faults.append(f"takes {wall_s:.3g} s per simulated second")
    return Finding(raw, tuple(faults), wall_s, counts, growth(made, frames))


def _part(rng: Rng) -> Raw:
    if rng.random() < 0.2:
        sizes = {"diameter_mm": float(rng.uniform(1.0, 8.0)), "height_mm": float(rng.uniform(1.0, 8.0))}
        return {"shape": "cylinder"} | sizes
    return ball(rng) if rng.random() < 0.2 else corner_part(rng)


def _turn(rng: Rng) -> list[float]:
    return _unit(rng.normal(size=4))


def _unit(turn: ArrayLike) -> list[float]:
    return [float(value) for value in np.asarray(turn) / np.linalg.norm(turn)]


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


def _poured(parts: list[Raw], rng: Rng, height: float = 16.0, apart: float = 14.0, beside: float = 6.0) -> list[Raw]:
    """Parts above each other [mm], from where they fall."""
    poured = []
    for i, part in enumerate(parts):
        x, y = rng.uniform(-beside, beside, 2)
        start = {"kind": "state", "position_mm": [float(x), float(y), height + i * apart], "quaternion": _turn(rng)}
        poured.append(part | {"start": start})
    return poured


def _at_rest(parts: list[Raw], rim: bool = False, duration: float = 1.5) -> Raw:
    """Without a step; duration [s]."""
    size = 120.0 if rim else 4000.0  # over whose edge none comes
    plate = {"kind": "still", "length_mm": size, "width_mm": size, "rim": rim}
    run = {"duration_s": duration, "seeds": 1, "frames_per_second": 500.0, "tolerance_nm": 10.0}
    return {"plate": plate, "part": parts, "run": run}


def _heap(rng: Rng) -> Raw:
    parts, height = [], 16.0
    for _ in range(int(rng.integers(2, 13))):
        x, y = rng.uniform(-6.0, 6.0, 2)
        start = {"kind": "state", "position_mm": [float(x), float(y), height], "quaternion": _turn(rng)}
        parts.append(_part(rng) | {"start": start})
        height += 14.0
    return _at_rest(parts, rim=bool(rng.random() < 0.5))


def _concave(rng: Rng) -> Raw:
    parts = []
    for _ in range(int(rng.integers(2, 9))):
        name = rng.choice(MESHES)
        parts.append({"shape": "mesh", "file": str(MODELS / f"{name}/{name}.stl"), "contact": "parts"})
    return _at_rest(_poured(parts, rng), rim=bool(rng.random() < 0.3), duration=2.5)  # screws roll for up to 1.9 s


def _small(rng: Rng) -> Raw:
    size = float(rng.uniform(0.3, 1.2))
    return {"shape": "ball", "diameter_mm": size} if rng.random() < 0.5 else {"shape": "box", "size_mm": [size] * 3}


def _heavy(rng: Rng) -> Raw:
    count = int(rng.integers(2, 9))
    parts = []
    for i in range(count):
        angle = 2.0 * np.pi * i / count
        place = [float(6.0 * np.cos(angle)), float(6.0 * np.sin(angle)), 1.5]
        parts.append(_small(rng) | {"start": {"kind": "state", "position_mm": place, "quaternion": _turn(rng)}})
    start = {
        "kind": "state",
        "position_mm": [0.0, 0.0, 20.0],
        "quaternion": _unit([1.0, *(0.02 * rng.normal(size=2)), 0.0]),
    }
    parts.append({"shape": "box", "size_mm": [30.0, 30.0, 15.0], "start": start})
    return _at_rest(parts)


def _any_size(rng: Rng) -> Raw:
    sizes = [float(size) for size in 10.0 ** rng.uniform(np.log10(0.3), np.log10(30.0), 3)]
    shape = rng.choice(["box", "ball", "cylinder"])
    if shape == "box":
        return {"shape": "box", "size_mm": sizes}
    diameter = {"diameter_mm": sizes[0]}
    return {"shape": str(shape)} | diameter | ({"height_mm": sizes[1]} if shape == "cylinder" else {})


def _mixed(rng: Rng) -> Raw:
    parts = [_any_size(rng) for _ in range(int(rng.integers(2, 9)))]
    return _at_rest(_poured(parts, rng, 40.0, 60.0))


def _thin(rng: Rng) -> Raw:
    parts: list[Raw] = []
    for _ in range(int(rng.integers(2, 9))):
        long, wide = float(rng.uniform(8.0, 10.0)), float(rng.uniform(2.0, 6.0))
        shapes: list[Raw] = [
            {"shape": "box", "size_mm": [long, 0.1, 0.1]},
            {"shape": "cylinder", "diameter_mm": 0.15, "height_mm": long},
            {"shape": "box", "size_mm": [long, wide, 0.05]},
            {"shape": "cylinder", "diameter_mm": long, "height_mm": 0.05},
        ]
        parts.append(shapes[int(rng.integers(4))])
    return _at_rest(_poured(parts, rng))


def _shaken(rng: Rng) -> Raw:
    parts = [_part(rng) for _ in range(int(rng.integers(2, 9)))]
    rim, hz = bool(rng.random() < 0.3), float(rng.uniform(20.0, 200.0))
    acceleration = float(rng.uniform(0.3, 3.0)) * GRAVITY / (2.0 * np.pi * hz) ** 2
    size = float(rng.uniform(60.0, 160.0))
    plate: Raw = {"length_mm": size, "width_mm": size, "rim": rim}
    drive: Raw = {"frequency_hz": hz}
    run = {"duration_s": 1.0, "seeds": 1, "frames_per_second": 500.0, "tolerance_nm": 0.1}
    if rng.random() < 0.3:
        plate |= {"kind": "piston"}
        drive |= {"amplitude_um": min(1e6 * acceleration, 2.9e3)}
        return {"plate": plate, "part": _poured(parts, rng), "drive": [drive], "run": run}
    tilt = float(rng.choice([0.0, rng.uniform(-10.0, 10.0)]))
    plate |= {"kind": "tray", "tilt_deg": tilt}
    drive |= {"stroke_um": min(1e6 * acceleration, 1e4), "angle_deg": float(rng.uniform(5.0, 90.0))}
    height = 16.0 + 0.5 * size * abs(np.tan(np.radians(tilt)))
    return {"plate": plate, "part": _poured(parts, rng, height), "drive": [drive], "run": run}


def _refill(rng: Rng) -> Raw:
    count, hz = int(rng.integers(2, 9)), float(rng.uniform(30.0, 100.0))
    drive = {
        "frequency_hz": hz,
        "stroke_um": 1e6 * float(rng.uniform(0.3, 2.0)) * GRAVITY / (2.0 * np.pi * hz) ** 2,
        "angle_deg": float(rng.uniform(20.0, 90.0)),
    }
    stage = {"drive": [drive], "duration_s": SHAKEN, "pause_s": STANDING, "pick": {"clearance_mm": 2.0}}
    poured = {"kind": "heap", "diameter_mm": 20.0, "drop_height_mm": 2.0}
    kinds = [_part(rng) for _ in range(1 if rng.random() < 0.5 else 2)]
    return {
        "plate": {"kind": "tray", "length_mm": 160.0, "width_mm": 160.0, "rim": True},
        "part": [part | {"count": count, "start": poured} for part in kinds],
        "refill": {"to": count * len(kinds), "below": count * len(kinds), "start": poured},
        "schedule": {"cycles": CYCLES, "stage": [stage]},
        "run": {"seeds": 1, "frames_per_second": 500.0},
    }


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


def _shaken_apart(made: Scene, frames: Frames) -> list[str]:
    return _apart(made, frames[slice(0, None, 10)])


def _refilled(raw: Raw, name: str) -> Finding | None:
    """While the tray stands, parts that are there are neither in it nor in each other, and gain no energy.

    But for what it swung by, at most, when they were laid to rest: they are taken up to that when it is driven again.
    """
    try:
        result = simulate(validated(raw, Scenario, Path(name)), work=Work(1, stall_after=STALL_AFTER))
    except InputError:
        return None
    made, seed, gains = result.scene, result.seeds[0], [0.0]
    faults = [failure.cause for failure in result.failures]
    for cycle in range(CYCLES):
        end, time = (cycle + 1) * (SHAKEN + STANDING), seed.frames.time
        standing = seed.frames[np.flatnonzero((time > end - STANDING + STOPPING) & (time < end - 0.5e-3))]
        if len(standing) > 0:
            there = np.asarray(standing.present.all(axis=0))
            gains.append(growth(made, standing, there))
            faults += _into_plate(made, standing, there, CALM[1]) + _gained(gains[-1], CALM[1])
            faults += _apart(made, standing[slice(0, None, 10)])
    wall_s = seed.wall_s / made.times.duration
    if wall_s > SLOWEST_STAGES:
        faults.append(f"takes {wall_s:.3g} s per simulated second")
    return Finding(raw, tuple(faults), wall_s, seed.counts, max(gains))


def _into_plate(made: Scene, frames: Frames, there: np.ndarray, most: float = INTO_PLATE) -> list[str]:
    deepest = float(depth_under(made, frames)[:, there].max(initial=0.0))
    return [f"a part is {1e6 * deepest:.3g} um in the plate"] if deepest > most else []


def _gained(gain: float, most: float = GAINED) -> list[str]:
    return [f"energy grows by {1e6 * gain:.3g} um m g"] if gain > most else []


def _lies(raw: Raw, made: Scene, frames: Frames) -> list[str]:
    half = 0.5e-3 * np.array([raw["plate"]["length_mm"], raw["plate"]["width_mm"]])
    on_plate = np.asarray((np.abs(frames.position[:, :, :2]) < half).all(axis=2).all(axis=0))
    faults = _into_plate(made, frames, on_plate) + _gained(growth(made, frames))
    late = frames[slice(-round(LAST / (frames.time[1] - frames.time[0])), None)]
    lossy = raw["contact"]["friction"] > 0.0 and raw["contact"]["restitution"] <= MOST_BOUNCING
    rests = lossy and not any(part["shape"] in SLIDES for part in raw["part"])
    speed = float(np.linalg.norm(late.velocity[:, on_plate], axis=2).max(initial=0.0))
    if rests and on_plate.all() and speed > 0.0:
        faults.append(f"a part still moves by {1e3 * speed:.3g} mm/s")
    return faults + _apart(made, frames[slice(0, None, 10)])


KINDS: dict[str, Callable[[Rng], Raw]] = {
    "pair": _pair,
    "heap": _heap,
    "concave": _concave,
    "heavy": _heavy,
    "mixed": _mixed,
    "thin": _thin,
    "over": _over,
    "shaken": _shaken,
    "refill": _refill,
}
LAWS: dict[str, Callable[[Raw, Scene, Frames], list[str]]] = {"pair": _flies, "over": _falls_beside}


def broken(kind: str, raw: Raw, made: Scene, frames: Frames) -> list[str]:
    """What is not as it must be in a scene of a kind."""
    return LAWS.get(kind, _lies)(raw, made, frames)
