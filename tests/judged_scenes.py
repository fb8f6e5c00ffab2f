"""Random scenes of one free part, and what must hold in each: it ends, in time, and nothing falls through the plate.

    finding = judged("edge", 770106)

A scene is a plain dictionary, as a scenario file has it, so that one that fails can be run by anyone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from conftest import REPOSITORY
from invariants import growth

from feeder_sim.constants import GRAVITY
from feeder_sim.errors import InputError
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.pool.work import Work
from feeder_sim.records.seed import Counts
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.simulation import simulate
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.scene import Scene

Rng = np.random.Generator
Raw = dict[str, Any]
MODELS = REPOSITORY / "models"
NUTS = ("M2", "M2.5", "M3", "M4", "M5")
MESHES = ("bracket", "screw")
STALL_AFTER = 20.0  # [s] of wall time for a frame
SLOWEST = 20.0  # [s] of wall time per simulated second
SLOWEST_STAGES = 5.0  # the same, of a schedule
GAINED = 1e-7  # [m] of height, of energy on a plate at rest


@dataclass(frozen=True)
class Finding:
    """How a scene went.

    Attributes:
        scene: what was run.
        faults: what must not be, a line each.
        wall_s: per simulated second [s].
        counts: of the engine.
        gain: of energy, as height [m]; 0 over plates that move.
    """

    scene: Raw
    faults: tuple[str, ...]
    wall_s: float
    counts: Counts = field(default=Counts())
    gain: float = 0.0


def scene(kind: str, seed: int) -> Raw:
    """The scene of a kind, one of `ALL`, with a number."""
    rng = np.random.default_rng(seed)
    kind, of = kind.split("/") if "/" in kind else (kind, "balls" if kind == "balls" else "")
    part = {"balls": ball, "rods": cylinder, "": _part}[of](rng)
    contact = {
        "restitution": float(rng.choice([0.0, 0.2, 0.5, 0.8, 0.95])),
        "friction": float(rng.choice([0.0, 0.05, 0.3, 1.0])),
    }
    spin = rng.uniform(-1.0, 1.0, 3) * float(rng.choice([5.0, 50.0, 300.0]))
    turn = rng.normal(size=4)
    start = {
        "kind": "state",
        "quaternion": (turn / np.linalg.norm(turn)).tolist(),
        "angular_velocity_rad_s": spin.tolist(),
    }
    plate, drive, where, run = KINDS[kind](rng)
    raw: Raw = {
        "title": f"Random scene {seed}, {kind}/{of}",
        "plate": plate,
        "part": [part | {"start": start | where}],
        "contact": contact,
        "run": {"seeds": 1, "frames_per_second": 1000.0} | run,
    }
    return raw | ({"schedule" if isinstance(drive, dict) else "drive": drive} if drive else {})


def judged(kind: str, seed: int, law: str = "newton") -> Finding | None:
    """Run a scene by a law of impact and look at what came out; None where the scene is refused."""
    raw = scene(kind, seed)
    return looked_at(raw | {"contact": raw["contact"] | {"law": law}}, f"{kind}_{seed}")


def nothing_more(scene: Scene, frames: Frames) -> list[str]:
    """Faults that one kind of scene alone can have."""
    return []


def looked_at(raw: Raw, name: str, more: Callable[[Scene, Frames], list[str]] = nothing_more) -> Finding | None:
    """Run a scene by the name of a file; more: looks for further faults."""
    try:
        scenario = validated(raw, Scenario, Path(f"{name.replace('/', '_')}.toml"))
        result = simulate(scenario, work=Work(1, stall_after=STALL_AFTER))
    except InputError:
        return None
    seed_result, faults = result.seeds[0], [failure.cause for failure in result.failures]
    wall_s = seed_result.wall_s / result.scene.times.duration
    frames = seed_result.frames
    there = frames[slice(int(np.count_nonzero(frames.present[:, 0])))]
    if not all(np.isfinite(values).all() for values in (there.position, there.velocity, there.angular_velocity)):
        faults.append("a state is not finite")
    at_rest = "schedule" not in raw and not any(drive.get("amplitude_um", 1.0) for drive in raw.get("drive", ()))
    gain = growth(result.scene, there) if at_rest else 0.0
    if gain > GAINED:
        faults.append(f"energy grows by {1e6 * gain:.3g} um m g")
    if wall_s > (SLOWEST_STAGES if "schedule" in raw else SLOWEST):
        faults.append(f"takes {wall_s:.3g} s per simulated second")
    faults += more(result.scene, there)
    return Finding(raw, tuple(faults), wall_s, seed_result.counts, gain)


def _part(rng: Rng) -> Raw:
    shape = rng.choice(["hex_nut", "ball", "box", "mesh"])
    return ball(rng) if shape == "ball" else of_corners(shape, rng)


def corner_part(rng: Rng) -> Raw:
    """A nut, a box or a mesh."""
    return of_corners(rng.choice(["hex_nut", "box", "mesh"]), rng)


def of_corners(shape: str, rng: Rng) -> Raw:
    if shape == "hex_nut":
        return {"shape": "hex_nut", "size": str(rng.choice(NUTS))}
    if shape == "box":
        return {"shape": "box", "size_mm": (10.0 ** rng.uniform(0.0, 1.0, 3)).tolist()}
    name = rng.choice(MESHES)
    return {"shape": "mesh", "file": str(MODELS / f"{name}/{name}.stl")}


def ball(rng: Rng) -> Raw:
    return {"shape": "ball", "diameter_mm": float(rng.uniform(1.0, 8.0))}


def cylinder(rng: Rng) -> Raw:
    """From a coin to a rod."""
    return {
        "shape": "cylinder",
        "diameter_mm": float(rng.uniform(1.0, 8.0)),
        "height_mm": float(10.0 ** rng.uniform(-0.3, 1.0)),
    }


Made = tuple[Raw, list[Raw] | Raw, Raw, Raw]  # plate, drives or schedule, place and velocity, run


def _still(rng: Rng) -> Made:
    where = {"position_mm": [0.0, 0.0, 12.0], "velocity_mm_s": [float(rng.uniform(0.0, 300.0)), 0.0, -100.0]}
    return {"kind": "still", "length_mm": 400.0, "width_mm": 400.0}, [], where, {"duration_s": 1.5}


def _edge(rng: Rng) -> Made:
    """A part that comes down near the edge of a plate at rest."""
    where = {
        "position_mm": [float(rng.uniform(12.0, 22.0)), 0.0, 12.0],
        "velocity_mm_s": [float(rng.uniform(0.0, 200.0)), 0.0, -100.0],
    }
    plate = {"kind": "still", "length_mm": 40.0, "width_mm": 200.0}
    return plate, [], where, {"duration_s": 0.5, "floor_mm": -30.0}


PISTON = {"kind": "piston", "length_mm": 400.0, "width_mm": 400.0}


def _over_piston(rng: Rng) -> Raw:
    return {"position_mm": [0.0, 0.0, 12.0], "velocity_mm_s": [float(rng.uniform(0.0, 100.0)), 0.0, -50.0]}


def _swing(rng: Rng, accelerations: Any, **more: Any) -> Raw:
    """A drive of 10 Hz to 10 kHz with an acceleration out of some [g]."""
    hz, acceleration = float(10.0 ** rng.uniform(1.0, 4.0)), float(rng.choice(accelerations)) * GRAVITY
    amplitude = min(acceleration / (2.0 * np.pi * hz) ** 2, 2.9e-3)
    return {"frequency_hz": hz, "amplitude_um": 1e6 * amplitude} | more


def _piston(rng: Rng) -> Made:
    drive = _swing(rng, [0.3, 0.8, 0.99, 1.01, 1.1, 1.5, 3.0, 10.0, 50.0])
    return PISTON, [drive], _over_piston(rng), {"duration_s": 0.5}


def _low(rng: Rng) -> Made:
    """Where a part rides for a share of the period, or just does not."""
    return PISTON, [_swing(rng, rng.uniform(0.9, 1.3, 1))], _over_piston(rng), {"duration_s": 0.5}


def _switch(rng: Rng) -> Made:
    """A drive that begins and ends, at once or slowly, and perhaps a second one."""
    drives = []
    for _ in range(int(rng.integers(1, 3))):
        start, duration = float(rng.uniform(0.0, 0.3)), float(rng.uniform(0.005, 0.2))
        ways = {"ring_up": bool(rng.random() < 0.5), "damping_ratio": float(10.0 ** rng.uniform(-3.0, -1.0))}
        drives.append(_swing(rng, [0.5, 1.1, 3.0, 20.0], start_s=start, duration_s=duration) | ways)
    return PISTON, drives, _over_piston(rng), {"duration_s": 0.5}


@cache
def _frequencies(model: str, low: float, high: float) -> list[float]:
    """Natural frequencies of a plate [Hz]."""
    modes = read_mode_file(MODELS / model / "modes.h5").modes
    return [float(f) for f in modes.natural_frequency if low < f < high]


def _amplitude(rng: Rng) -> float:
    """[um]."""
    return float(10.0 ** rng.uniform(-1.5, 1.3))


def _plate(rng: Rng) -> Made:
    hz, amplitude = float(rng.choice(_frequencies("plate_180", 400.0, 13e3))), _amplitude(rng)
    x, y = rng.uniform(-89.0, 89.0, 2)
    where = {"position_mm": [float(x), float(y), 10.0], "velocity_mm_s": [float(rng.uniform(-50.0, 50.0)), 0.0, -50.0]}
    plate = {"kind": "modes", "mode_file": str(MODELS / "plate_180/modes.h5")}
    return plate, [{"frequency_hz": hz, "amplitude_um": amplitude}], where, {"duration_s": 0.4}


def _stages(rng: Rng) -> Made:
    """Stages of 0.2 ms to 1 s, one after the other, of a piston or a plate, with and without pauses and ring-up."""
    one = _piston if rng.random() < 0.5 else _plate
    plate, _, where, _ = one(rng)
    stages: list[dict[str, Any]] = []
    longest = float(10.0 ** rng.uniform(-3.0, 0.0))
    for _ in range(int(rng.integers(1, 6))):
        duration = float(np.exp(rng.uniform(np.log(2e-4), np.log(longest))))
        pause = float(rng.choice([0.0, rng.uniform(0.0, 0.5) * duration]))
        drives = one(rng)[1]
        assert isinstance(drives, list)
        drive = drives[0] | {"ring_up": bool(rng.random() < 0.8)}
        stages.append({"drive": [drive], "duration_s": duration, "pause_s": pause})
    whole = sum(stage["duration_s"] + stage["pause_s"] for stage in stages)
    return plate, {"cycles": max(1, min(1000, round(0.4 / whole))), "stage": stages}, where, {}


def _strip(rng: Rng) -> Made:
    """The strip of the drift scenarios."""
    hz = float(rng.uniform(2e3, 12e3))
    where = {
        "position_mm": [float(rng.uniform(-10.0, 10.0)), float(rng.uniform(-10.0, 10.0)), 10.0],
        "velocity_mm_s": [float(rng.uniform(-50.0, 50.0)), 0.0, -50.0],
    }
    drive = {"frequency_hz": hz, "amplitude_um": _amplitude(rng), "damping_ratio": 0.002}
    return {"kind": "strip", "thickness_mm": 3.0, "material": "aluminium"}, [drive], where, {"duration_s": 0.4}


def _hole(rng: Rng) -> Made:
    """Around the hole of 24 mm in the plate of the examples, which moves."""
    hz = float(rng.choice(_frequencies("plate_hole", 400.0, 13e3)))
    x, y = np.array([35.0, 0.0]) + rng.uniform(-16.0, 16.0, 2)
    where = {
        "position_mm": [float(x), float(y), 10.0],
        "velocity_mm_s": [*rng.uniform(-100.0, 100.0, 2).tolist(), -50.0],
    }
    plate = {"kind": "modes", "mode_file": str(MODELS / "plate_hole/modes.h5")}
    return plate, [{"frequency_hz": hz, "amplitude_um": _amplitude(rng)}], where, {"duration_s": 0.4}


def _volts(rng: Rng) -> Made:
    """Patches at a voltage, on a resonance or anywhere beside it; every mode moves that counts."""
    hz = float(rng.choice(_frequencies("plate_180_piezos", 400.0, 12e3))) * float(rng.uniform(0.97, 1.03))
    names = [str(name) for name in rng.permutation(["centre", "back", "front"])[: int(rng.integers(1, 4))]]
    drive: Raw = {"frequency_hz": hz, "voltage_vpp": float(10.0 ** rng.uniform(0.0, 2.3)), "actuator": names}
    drive |= {"ring_up": bool(rng.random() < 0.8)}
    x, y = rng.uniform(-89.0, 89.0, 2)
    where = {"position_mm": [float(x), float(y), 10.0], "velocity_mm_s": [float(rng.uniform(-50.0, 50.0)), 0.0, -50.0]}
    plate = {"kind": "modes", "mode_file": str(MODELS / "plate_180_piezos/modes.h5")}
    return plate, [drive], where, {"duration_s": 0.4}


def _tray(rng: Rng) -> Made:
    """Strokes and turns of a tray that may rise, from which parts may fall."""
    length, tilt = float(rng.uniform(60.0, 200.0)), float(rng.choice([0.0, rng.uniform(-10.0, 10.0)]))
    hz = float(rng.uniform(20.0, 200.0))
    drives: list[Raw] = []
    for _ in range(int(rng.integers(1, 3))):
        if rng.random() < 0.3:
            turn = {"turn_mrad": float(rng.uniform(0.1, 5.0)), "axis": str(rng.choice(["x", "y", "z"]))}
            drives.append({"frequency_hz": hz} | turn)
            continue
        throw = float(rng.uniform(0.3, 3.0)) * GRAVITY / (2.0 * np.pi * hz) ** 2
        line = {"angle_deg": float(rng.uniform(5.0, 90.0)), "direction_deg": float(rng.uniform(-180.0, 180.0))}
        drives.append({"frequency_hz": hz, "stroke_um": min(1e6 * throw, 1e4)} | line)
    plate = {"kind": "tray", "length_mm": length, "width_mm": float(rng.uniform(40.0, 100.0)), "tilt_deg": tilt}
    x, slope = float(rng.uniform(-25.0, 25.0)), np.tan(np.radians(tilt))
    height = 12.0 + slope * (x + np.copysign(0.5 * length, slope))
    where = {
        "position_mm": [x, float(rng.uniform(-15.0, 15.0)), float(height)],
        "velocity_mm_s": [float(rng.uniform(-50.0, 50.0)), 0.0, -50.0],
    }
    return plate, drives, where, {"duration_s": 1.0}


ELL: Raw = {
    "kind": "plate",
    "outline": {"points_mm": [[0, 0], [120, 0], [120, 40], [50, 40], [50, 90], [0, 90]]},
    "hole": [{"centre_mm": [100.0, 20.0], "diameter_mm": 12.0}],
    "thickness_mm": 2.0,
    "damping_ratio": 0.003,
    "highest_frequency_hz": 8000.0,
    "actuator": [
        {"name": "a", "at_mm": [25.0, 60.0], "size_mm": [15.0, 15.0], "thickness_mm": 0.5, "d31_pm_per_v": 180.0}
    ],
    "support": [
        {"at_mm": at, "diameter_mm": 6.0, "stiffness_n_per_mm": 5.0, "loss_factor": 0.2}
        for at in ([10.0, 10.0], [110.0, 10.0], [10.0, 80.0])
    ],
}


def _ell(rng: Rng) -> Made:
    """An L on feet, by elements; parts come down near its inner corner, its hole and its edges."""
    middle = np.array([[-10.0, -5.0], [40.0, -25.0], [-35.0, 0.0]])[int(rng.integers(3))]
    x, y = middle + rng.uniform(-15.0, 15.0, 2)
    where = {
        "position_mm": [float(x), float(y), 10.0],
        "velocity_mm_s": [*rng.uniform(-100.0, 100.0, 2).tolist(), -50.0],
    }
    drive: Raw = {
        "frequency_hz": float(rng.uniform(300.0, 6000.0)),
        "voltage_vpp": float(10.0 ** rng.uniform(0.5, 2.5)),
    }
    return ELL, [drive], where, {"duration_s": 0.4}


KINDS: dict[str, Callable[[Rng], Made]] = {
    "still": _still,
    "edge": _edge,
    "piston": _piston,
    "low": _low,
    "switch": _switch,
    "stages": _stages,
    "balls": _piston,
    "plate": _plate,
    "strip": _strip,
    "hole": _hole,
    "volts": _volts,
    "tray": _tray,
    "ell": _ell,
}
ALL = (*KINDS, *(f"{kind}/rods" for kind in KINDS if kind != "balls"))
