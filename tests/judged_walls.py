"""Random scenes of a part between walls, and what must hold: it stays out of them, and of the plate.

    finding = judged("tube", 12)

tube   a part with play in a tube that leans or not, over a piston
rim    a part on a plate with a rim, at rest or a piston
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from invariants import attitudes
from judged_scenes import PISTON, Finding, Rng, ball, looked_at, of_corners
from numpy.typing import NDArray
from pydantic import TypeAdapter

from feeder_sim.constants import GRAVITY
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import PartSpec
from feeder_sim.scene.part import build_part
from feeder_sim.scene.scene import Scene

Raw = dict[str, Any]
SHAPES = ("ball", "cylinder", "hex_nut", "box", "mesh")
IN_WALL, IN_PLATE = 1e-6, 1e-7  # [m]


def judged(kind: str, seed: int, law: str = "newton") -> Finding | None:
    """Run a scene by a law of impact and look at what came out; None where the scene is refused."""
    raw = scene(kind, seed)
    raw["contact"] = raw.get("contact", {}) | {"law": law}
    return looked_at(raw, kind, _in_tube if kind == "tube" else _in_rim)


def scene(kind: str, seed: int) -> Raw:
    """The scene of a kind, one of `KINDS`, with a number."""
    return {"title": f"Random scene {seed}, {kind}"} | KINDS[kind](np.random.default_rng(seed))


def _tube(rng: Rng) -> Raw:
    """Half of the play is below 0.1 mm; half of the tubes lean, half of the plates rest."""
    part, width, height = _part(rng)
    tilt = float(rng.choice([0.0, rng.uniform(0.0, 3.0)]))
    play = float(10.0 ** rng.uniform(-2.5, 0.5))
    guide = {
        "kind": "tube",
        "inner_diameter_mm": width + 1.01 * height * float(np.sin(np.radians(tilt))) + play,
        "tilt_deg": float(rng.choice([0.0, 0.0, rng.uniform(0.0, 5.0), rng.uniform(5.0, 60.0)])),
        "restitution": float(rng.choice([0.0, 0.4, 0.9])),
        "friction": float(rng.choice([0.0, 0.1, 0.4])),
    }
    start = {"drop_height_mm": float(rng.uniform(0.01, 20.0)), "tilt_deg": [0.0, tilt]}
    swing = _swing(rng)
    return {
        "plate": PISTON,
        "drive": [swing],
        "part": [part | {"guide": guide, "start": start}],
        "contact": {"restitution": float(rng.choice([0.0, 0.2, 0.8])), "friction": float(rng.choice([0.0, 0.3]))},
        "run": {"seeds": 1, "frames_per_second": 1000.0, "duration_s": 0.5},
    }


def _part(rng: Rng) -> tuple[Raw, float, float]:
    """A part, and the width and height it takes upright [mm]."""
    shape = rng.choice(SHAPES)
    if shape == "ball":
        part = ball(rng)
        return part, part["diameter_mm"], 0.0
    if shape == "cylinder":
        sizes = {"diameter_mm": float(rng.uniform(1.0, 8.0)), "height_mm": float(rng.uniform(1.0, 12.0))}
        return {"shape": "cylinder"} | sizes, sizes["diameter_mm"], sizes["height_mm"]
    part = of_corners(shape, rng)
    corners = 1e3 * build_part(TypeAdapter(PartSpec).validate_python(part)).corners
    return part, 2.0 * float(np.hypot(*corners[:, :2].T).max()), 2.0 * float(np.abs(corners[:, 2]).max())


def _rim(rng: Rng) -> Raw:
    turn = rng.normal(size=4)
    start = {
        "kind": "state",
        "quaternion": (turn / np.linalg.norm(turn)).tolist(),
        "position_mm": [*rng.uniform(-8.0, 8.0, 2).tolist(), 12.0],
        "velocity_mm_s": [*rng.uniform(-300.0, 300.0, 2).tolist(), -50.0],
        "angular_velocity_rad_s": (rng.uniform(-1.0, 1.0, 3) * float(rng.choice([5.0, 50.0, 300.0]))).tolist(),
    }
    part = _part(rng)[0] | {"start": start}
    contact = {"restitution": float(rng.choice([0.0, 0.2, 0.5, 0.95])), "friction": float(rng.choice([0.0, 0.3, 1.0]))}
    plate = {"kind": "piston", "length_mm": 40.0, "width_mm": 50.0, "rim": True}
    run = {"seeds": 1, "frames_per_second": 1000.0, "duration_s": 0.5}
    return {"plate": plate, "drive": [_swing(rng)], "part": [part], "contact": contact, "run": run}


def _swing(rng: Rng) -> Raw:
    """A drive without amplitude in a third of scenes."""
    hz, acceleration = float(10.0 ** rng.uniform(1.0, 3.5)), float(rng.choice([0.0, 0.0, 0.5, 1.1, 3.0, 20.0]))
    amplitude = min(acceleration * GRAVITY / (2.0 * np.pi * hz) ** 2, 2.9e-3)
    return {"frequency_hz": hz, "amplitude_um": 1e6 * amplitude}


def _corners(made: Scene, frames: Frames) -> NDArray[np.float64]:
    """Of the part, at the times of frames (n, corners, 3) [m]."""
    turned = np.einsum("nij,cj->nci", attitudes(frames, 0), made.parts[0].corners)
    return np.asarray(turned + frames.position[:, :1])


def _in_rim(made: Scene, frames: Frames) -> list[str]:
    half = 0.5 * np.array([made.surface.length, made.surface.width])
    deepest = float((np.abs(_corners(made, frames)[..., :2]) - half).max()) + made.parts[0].corner_radius
    return [f"is in the rim by {1e6 * deepest:.3g} um"] if deepest > IN_WALL else []


def _in_tube(made: Scene, frames: Frames) -> list[str]:
    """Faults at wall and plate, by all corners at the times of frames."""
    part, guide, faults = made.parts[0], made.guides[0], []
    assert guide is not None
    assert guide.radius is not None
    corners = _corners(made, frames)
    off = corners - np.array([*guide.foot, 0.0])
    off -= (off @ guide.axis)[..., None] * guide.axis
    in_wall = float(np.linalg.norm(off, axis=-1).max()) + part.corner_radius - guide.radius
    if in_wall > IN_WALL:
        faults.append(f"is in the wall by {1e6 * in_wall:.3g} um")
    height = np.array([made.surface.displacement(np.zeros((1, 2)), time)[0, 2] for time in frames.time])
    in_plate = float((height - corners[..., 2].min(axis=1)).max()) + part.corner_radius
    if in_plate > IN_PLATE:
        faults.append(f"is in the plate by {1e6 * in_plate:.3g} um")
    return faults


KINDS: dict[str, Callable[[Rng], Raw]] = {"tube": _tube, "rim": _rim}
