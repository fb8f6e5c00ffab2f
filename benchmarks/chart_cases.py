"""Cases that the other simulators and the tests of known failures compute, each with its closed form.

bouncing ball   free ball on a 50 Hz shaker, period one (Holmes 1982): conformance/right_values.py
flat drop       a nut landing flat leaves with e v and without spin
sliding impact  a ball that slides throughout leaves with e v_n and v_t - mu (1+e) v_n
sticking impact a ball that sticks leaves rolling, with e v_n and 5/7 v_t
drift           transport speed of a nut on a standing wave; nobody knows the right number
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "conformance"))

import numpy as np
from case_files import case

from feeder_sim.constants import GRAVITY
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.records.seed import Seed
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import Scene

Raw = dict[str, Any]  # the tables of a scenario file

RESTITUTION, FRICTION = 0.2, 0.3
CONTACT = {"restitution": RESTITUTION, "friction": FRICTION}
DROP_MM = 5.0
APPROACH = math.sqrt(2.0 * GRAVITY * 1e-3 * DROP_MM)  # [m/s]
DROP_S = 0.04  # 32 ms of fall, and most of the 13 ms of flight after the impact
SLIDE_MM_S, STICK_MM_S = 1000.0, 200.0
BALL_HZ, BALL_UM = 50.0, 245.0
BALL_PERIODS, BALL_COUNTED = 150, 50  # simulated periods of the plate, and the last ones that count
TRAY = case("two_axes")
TRAY_HZ, TRAY_UM, TRAY_PHASE_DEG = (TRAY["plate"][key] for key in ("frequency_hz", "x_um", "x_phase_deg"))
TRAY_HEIGHT = 1e-6 * TRAY["plate"]["z_um"]  # amplitude [m]
TRAY_FROM_S, TRAY_S = TRAY["looks"]["first_s"], TRAY["duration_s"]
PER_MS = 1000.0  # [Hz] of a drive without amplitude, with which steps per period are steps per millisecond


@dataclass(frozen=True)
class Drop:
    """A part that falls onto a plate at rest.

    Attributes:
        part: its table.
        start: changes the table of its start.
        error: of the velocity after the impact [%], from one seed.
    """

    part: Raw
    start: Raw
    error: Callable[[Prepared, Seed], float]

    def scenario(self) -> Raw:
        """The scenario with default settings."""
        release = {"drop_height_mm": DROP_MM, "tilt_deg": 0.0, "yaw_deg": 17.0} | self.start
        return {
            "plate": {"kind": "piston"},
            "drive": [{"frequency_hz": PER_MS, "amplitude_um": 0.0}],
            "part": [self.part | {"start": release}],
            "contact": dict(CONTACT),
            "run": {"duration_s": DROP_S, "seeds": 1, "frames_per_second": 5000.0},
        }


def strip(frequency: float, amplitude_um: float, x_mm: float) -> Raw:
    """A nut near the antinode of a standing wave of a 3 mm strip, as in scenarios/drift_4750hz.toml."""
    start = {"position_mm": [x_mm, 0.0], "drop_height_mm": [0.2, 0.5], "tilt_deg": [0.0, 3.0]}
    return {
        "plate": {"kind": "strip", "thickness_mm": 3.0},
        "drive": [{"frequency_hz": frequency, "amplitude_um": amplitude_um, "damping_ratio": 0.002}],
        "part": [{"shape": "hex_nut", "size": "M2.5", "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": 60.0, "stop": "passage"},
    }


def after_impact(scene: Scene, record: Seed) -> tuple[float, int]:
    """Speed upwards [m/s] with which a part has left the plate at rest, and its first frame after that."""
    frames = record.frames
    rising = np.flatnonzero(frames.velocity[:, 0, 2] > 0.0)
    if not len(rising):
        return 0.0, int(np.argmin(frames.position[:, 0, 2]))
    row = int(rising[0])
    kind = scene.kinds[0]
    resting_height = -kind.lowest(frames.quaternion[row, 0]) + (0.0 if kind.corner_radius else CORNER_RADIUS)
    rise = max(float(frames.position[row, 0, 2]) - resting_height, 0.0)
    return math.sqrt(float(frames.velocity[row, 0, 2]) ** 2 + 2.0 * GRAVITY * rise), row


def _flat_drop(prepared: Prepared, record: Seed) -> float:
    """Error [%] of the speed upwards and of the speed of the corners by spin, which should be 0, over e v."""
    upward, row = after_impact(prepared.scene, record)
    spin = prepared.scene.kinds[0].size * float(np.linalg.norm(record.frames.angular_velocity[row, 0]))
    return 100.0 * math.hypot(upward - RESTITUTION * APPROACH, spin) / (RESTITUTION * APPROACH)


def _ball_impact(prepared: Prepared, record: Seed, expected: float) -> float:
    """Error [%] of both components of the velocity after the impact, over the approach speed; that along in m/s."""
    upward, row = after_impact(prepared.scene, record)
    along = float(record.frames.velocity[row, 0, 0])
    return 100.0 * math.hypot(upward - RESTITUTION * APPROACH, along - expected) / APPROACH


def slid(along: float) -> float:
    """Velocity along the plate [m/s] after the impact of a ball that slides, from that before it."""
    return along - FRICTION * (1.0 + RESTITUTION) * APPROACH


def _ball(along_mm_s: float, expected: float) -> Drop:
    """A ball that flies along as it falls."""
    start = {"velocity_mm_s": [along_mm_s, 0.0, 0.0]}
    return Drop({"shape": "ball", "diameter_mm": 3.0}, start, lambda of, seed: _ball_impact(of, seed, expected))


FLAT_DROP = Drop({"shape": "hex_nut", "size": "M2.5"}, {}, _flat_drop)
SLIDING_IMPACT = _ball(SLIDE_MM_S, slid(1e-3 * SLIDE_MM_S))
STICKING_IMPACT = _ball(STICK_MM_S, 5.0 / 7.0 * 1e-3 * STICK_MM_S)
