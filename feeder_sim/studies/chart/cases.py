"""Cases of the chart: each is a scenario and a number to compute, with its exact or its reference value.

bouncing ball   free ball on a 50 Hz shaker, period one (Holmes 1982): the plate moves at w = g T/2 (1-e)/(1+e) when
                it is hit, so that the ball rises to g T^2/8 + A sin(phi) with A omega cos(phi) = w
flat drop       a nut landing flat leaves with e v and without spin
sliding impact  a ball that slides throughout leaves with e v_n and v_t - mu (1+e) v_n
drift           transport speed of a nut on a standing wave; reference: the finest run
crowd           one cycle of gathering 20 nuts and throwing them apart: how many of them come to lie within 5 mm of
                a nodal line; reference: the finest run
transport       time in which a sequence of modes carries a nut along a strip; reference: the finest run
chladni plate   way of a solder ball in a note of 500 ms on the plate of silicon that steers balls (Zhou et al., Nat.
                Commun. 7 (2016) 12764); reference: the finest run
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from feeder_sim.example_files import example_file
from feeder_sim.measures.arrivals import arrival_time
from feeder_sim.measures.drift import transport_speed
from feeder_sim.measures.separation import stage_reports
from feeder_sim.measures.stage_lines import stage_lines
from feeder_sim.part.rigid_part import CORNER_RADIUS
from feeder_sim.records.seed import Seed
from feeder_sim.scenario import load_scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.scene.scene import GRAVITY, Scene

Raw = dict[str, Any]  # the tables of a scenario file, which methods change

RESTITUTION, FRICTION = 0.2, 0.3
CONTACT = {"restitution": RESTITUTION, "friction": FRICTION}
DROP_MM = 5.0
APPROACH = math.sqrt(2.0 * GRAVITY * 1e-3 * DROP_MM)  # [m/s]
DROP_S = 0.04  # 32 ms of fall, and most of the 13 ms of flight after the impact
SLIDE_MM_S = 1000.0
BALL_HZ, BALL_UM = 50.0, 245.0
BALL_PERIODS, BALL_COUNTED = 150, 50  # simulated periods of the plate, and the last ones that count
PER_MS = 1000.0  # [Hz] of a drive without amplitude, with which steps per period are steps per millisecond
CROWD = 20  # parts
NOTE_HZ, NOTE_MODE, NOTE_S, NOTE_VPP = 12996.6, 19, 0.5, 1.0  # at resonance; a voltage for a way as in the experiment
BALL_AT_MM = (5.0, 3.0)  # half way between an antinode and a nodal line


@dataclass(frozen=True)
class Case:
    """A scenario and a number to compute.

    Attributes:
        name, title: in files and in pictures.
        quantity: name and unit of the number.
        scenario: makes the scenario with default settings.
        observe: computes the number from one seed; NaN where the seed does not give it.
        exact: the exact value; 0 for a number that is itself an error in percent; None where the finest run is the
            reference.
        seeds: number for a fast method, for a slow method, and for the reference; 0 for a case without chance.
        quick_seeds: the same in the quick variant.
        seed_s: how long a seed takes by impulses, about [s]; 0 for a case without chance.
    """

    name: str
    title: str
    quantity: str
    scenario: Callable[[], Raw]
    observe: Callable[[Prepared, Seed], float]
    exact: float | None
    seeds: tuple[int, int, int] = (0, 0, 0)
    quick_seeds: tuple[int, int, int] = (0, 0, 0)
    seed_s: float = 0.0

    @property
    def by_chance(self) -> bool:
        """Whether the number depends on the seed."""
        return self.seeds[0] > 0


def ball_height(frequency: float, amplitude: float, restitution: float) -> float:
    """Largest height [m] of a ball in period one over its place on the resting plate, by the formula of the module.

    Args:
        frequency: of the plate [Hz].
        amplitude: of the plate [m].
        restitution: coefficient [1].
    """
    period = 1.0 / frequency
    plate_velocity = 0.5 * GRAVITY * period * (1.0 - restitution) / (1.0 + restitution)
    cosine = plate_velocity / (2.0 * math.pi * frequency * amplitude)
    return GRAVITY * period**2 / 8.0 + amplitude * math.sqrt(1.0 - cosine**2)


def _ball() -> Raw:
    """A free ball on a plate that vibrates up and down."""
    start = {"drop_height_mm": 0.5, "tilt_deg": 0.0}
    return {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": BALL_HZ, "amplitude_um": BALL_UM, "ring_up": False}],
        "part": [{"shape": "ball", "diameter_mm": 3.0, "start": start}],
        "contact": dict(CONTACT),
        "run": {"duration_s": BALL_PERIODS / BALL_HZ, "seeds": 1, "frames_per_second": 2000.0},
    }


def _rise(prepared: Prepared, record: Seed) -> float:
    """Mean height of the last tops of the flight [mm]; each follows from the highest frame and its velocity."""
    frames = record.frames
    height = frames.position[:, 0, 2] - prepared.scene.kinds[0].corner_radius
    top = height + frames.velocity[:, 0, 2] ** 2 / (2.0 * GRAVITY)
    period = np.floor(frames.time * BALL_HZ + 1e-9).astype(int)
    last = range(BALL_PERIODS - BALL_COUNTED, BALL_PERIODS)
    highest = [np.flatnonzero(period == k)[np.argmax(height[period == k])] for k in last]
    return 1e3 * float(np.mean(top[highest]))


def _on_resting_plate(part: Raw, **start: Any) -> Raw:
    """A part that falls flat onto a plate at rest; `start` changes its table of that name."""
    release = {"drop_height_mm": DROP_MM, "tilt_deg": 0.0, "yaw_deg": 17.0} | start
    return {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": PER_MS, "amplitude_um": 0.0}],
        "part": [part | {"start": release}],
        "contact": dict(CONTACT),
        "run": {"duration_s": DROP_S, "seeds": 1, "frames_per_second": 5000.0},
    }


def _after_impact(scene: Scene, record: Seed) -> tuple[float, int]:
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
    upward, row = _after_impact(prepared.scene, record)
    spin = prepared.scene.kinds[0].size * float(np.linalg.norm(record.frames.angular_velocity[row, 0]))
    return 100.0 * math.hypot(upward - RESTITUTION * APPROACH, spin) / (RESTITUTION * APPROACH)


def _sliding_impact(prepared: Prepared, record: Seed) -> float:
    """Error [%] of both components of the velocity after the impact, over the approach speed."""
    upward, row = _after_impact(prepared.scene, record)
    along = float(record.frames.velocity[row, 0, 0])
    expected = 1e-3 * SLIDE_MM_S - FRICTION * (1.0 + RESTITUTION) * APPROACH
    return 100.0 * math.hypot(upward - RESTITUTION * APPROACH, along - expected) / APPROACH


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


def speed(prepared: Prepared, record: Seed) -> float:
    """Transport speed [mm/s]; NaN if the part has not passed the end of the measured way."""
    assert prepared.cell is not None
    return 1e3 * transport_speed(record.frames, prepared.cell)


def _crowd() -> Raw:
    """One cycle of gathering and separation of `CROWD` nuts on the 180 mm plate."""
    gather = {"name": "gather", "drive": [{"frequency_hz": 2646.0, "amplitude_um": 20.0}], "duration_s": 0.6}
    throw = {"name": "throw", "drive": [{"frequency_hz": 2797.0, "amplitude_um": 20.0}], "duration_s": 0.1}
    return {
        "plate": {"kind": "rectangle", "length_mm": 180.0, "width_mm": 180.0, "thickness_mm": 3.0},
        "schedule": {"stage": [gather, throw | {"pause_s": 0.2, "pick": {"clearance_mm": 10.0}}]},
        "part": [
            {
                "shape": "hex_nut",
                "size": "M2.5",
                "count": CROWD,
                "start": {"kind": "scattered", "size_mm": [90.0, 90.0], "tilt_deg": [0.0, 3.0]},
            }
        ],
        "contact": CONTACT | {"part_restitution": RESTITUTION, "part_friction": FRICTION},
        "run": {"frames_per_second": 200.0},
    }


def _gathered(prepared: Prepared, record: Seed) -> float:
    """Nuts near a nodal line at the end of the gathering; the number picked would scatter twice as much."""
    return float(stage_reports(prepared.scene, stage_lines(prepared.scene), record)[0].on_nodal_line)


def _transport() -> Raw:
    """The example of this name: the modes of a strip that is free at its ends are in a file."""
    return dict(load_scenario(example_file("scenarios/transport_strip.toml")).model_dump(exclude_unset=True))


def _arrival(prepared: Prepared, record: Seed) -> float:
    """Time of arrival [s]; NaN if the part has not come to the goal."""
    return arrival_time(prepared.scene, record)


def _note() -> Raw:
    """One ball of the example of this plate, at one place, and one mode that moves all the time."""
    raw = dict(load_scenario(example_file("scenarios/chladni_plate.toml")).model_dump(exclude_unset=True))
    del raw["schedule"]
    start = {"position_mm": list(BALL_AT_MM), "drop_height_mm": [0.001, 0.003]}
    return raw | {
        "drive": [{"frequency_hz": NOTE_HZ, "mode": NOTE_MODE, "voltage_vpp": NOTE_VPP}],
        "part": [raw["part"][0] | {"count": 1, "start": start}],
        "run": {"duration_s": NOTE_S},
    }


def _way(prepared: Prepared, record: Seed) -> float:
    """Length of the way from the first to the last frame [mm]."""
    position = record.frames.position[:, 0, :2]
    return 1e3 * float(np.linalg.norm(position[-1] - position[0]))


CASES = (
    Case(
        "bouncing_ball",
        "Bouncing ball, 50 Hz",
        "height of period one (mm)",
        _ball,
        _rise,
        1e3 * ball_height(BALL_HZ, 1e-6 * BALL_UM, RESTITUTION),
    ),
    Case(
        "flat_drop",
        "Flat drop of a nut",
        "error of the velocity (%)",
        lambda: _on_resting_plate({"shape": "hex_nut", "size": "M2.5"}),
        _flat_drop,
        0.0,
    ),
    Case(
        "sliding_impact",
        "Sliding impact of a ball",
        "error of the velocity (%)",
        lambda: _on_resting_plate({"shape": "ball", "diameter_mm": 3.0}, velocity_mm_s=[SLIDE_MM_S, 0.0, 0.0]),
        _sliding_impact,
        0.0,
    ),
    Case(
        "drift_4750",
        "Drift at 4750 Hz",
        "transport speed (mm/s)",
        lambda: strip(4750.0, 1.0, 1.95),
        speed,
        None,
        (48, 4, 96),
        (8, 1, 16),
        0.05,
    ),
    Case(
        "drift_8775",
        "Drift at 8775 Hz",
        "transport speed (mm/s)",
        lambda: strip(8775.0, 1.0, 1.43),
        speed,
        None,
        (128, 12, 256),
        (16, 2, 32),
        0.02,
    ),
    Case(
        "crowd_20",
        "One cycle of 20 nuts",
        "nuts on nodal lines when gathered",
        _crowd,
        _gathered,
        None,
        (16, 4, 32),
        (2, 1, 4),
        0.3,
    ),
    Case(
        "transport_strip",
        "Transport by five modes",
        "time of arrival (s)",
        _transport,
        _arrival,
        None,
        (24, 4, 48),
        (2, 1, 2),
        0.1,
    ),
    Case(
        "chladni_plate",
        "A ball on a Chladni plate",
        "way in a note (mm)",
        _note,
        _way,
        None,
        (96, 12, 192),
        (16, 2, 32),
        0.003,
    ),
)
