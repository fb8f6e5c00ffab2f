"""Parts find each other in time: fast ones, and those that an impact has made faster than any part was before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from feeder_sim import simulate
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Scenario

ENTERED = 3e-6  # [m]; twice what the engine lets parts enter each other, and the frames' rounding


def flying(frequency_hz: float, balls: list[dict[str, Any]], *, e: float = 1.0, duration_s: float = 0.02) -> Frames:
    """Balls that fly high over a plate at rest, so that they meet each other alone."""
    parts = [
        {
            "shape": "ball",
            "diameter_mm": ball["diameter_mm"],
            "material": ball.get("material", "steel"),
            "start": {
                "position_mm": [ball["x_mm"], ball.get("y_mm", 0.0)],
                "drop_height_mm": 100.0 - 0.5 * ball["diameter_mm"],
                "velocity_mm_s": [ball["speed_mm_s"], 0.0, 0.0],
            },
        }
        for ball in balls
    ]
    raw = {
        "plate": {"kind": "piston"},
        "drive": [{"frequency_hz": frequency_hz, "amplitude_um": 0.0}],
        "part": parts,
        "contact": {"part_restitution": e, "part_friction": 0.0},
        "run": {"duration_s": duration_s, "seeds": 1, "frames_per_second": min(20_000.0, 40.0 * frequency_hz)},
    }
    return simulate(Scenario.model_validate(raw)).trajectories[0]


def overlaps(frames: Frames, balls: list[dict[str, Any]]) -> float:
    """The deepest that any two balls are in each other at any frame [m]."""
    radius = [0.5e-3 * ball["diameter_mm"] for ball in balls]
    deepest = -np.inf
    for i in range(len(balls)):
        for j in range(i):
            distance = np.linalg.norm(frames.position[:, i] - frames.position[:, j], axis=1)
            deepest = max(deepest, float((radius[i] + radius[j] - distance).max()))
    return deepest


@pytest.mark.parametrize("frequency_hz", [50.0, 500.0])
def test_fast_balls_meet_in_time_however_long_a_step_is(frequency_hz: float) -> None:
    speed, gaps = 0.5, 1e-3 * np.array([7.1, 7.23, 7.37, 7.42, 7.59])
    balls: list[dict[str, Any]] = []
    for row, gap in enumerate(gaps):
        for side in (-1.0, 1.0):
            place = {"x_mm": side * (0.5e3 * gap + 1.5), "y_mm": 8.0 * row, "speed_mm_s": -side * 1e3 * speed}
            balls.append({"diameter_mm": 3.0} | place)
    frames = flying(frequency_hz, balls)
    assert overlaps(frames, balls) < ENTERED
    # Until they touch they cover half of the gap; with e = 1 they go back as fast as they came.
    after = frames.time[-1] - 0.5 * gaps / speed
    assert frames.position[-1, 1::2, 0] == pytest.approx(1.5e-3 + speed * after, abs=ENTERED)


def test_a_light_ball_struck_by_a_heavy_one_does_not_fly_through_a_third() -> None:
    # The reach of a window of 1 ms is that of the fastest ball at its begin. The light one, struck after 0.2 ms, and
    # the third are too far from each other for that, and still meet within the window.
    balls: list[dict[str, Any]] = [
        {"diameter_mm": 12.0, "x_mm": -8.2, "speed_mm_s": 1000.0},
        {"diameter_mm": 1.0, "material": "nylon", "x_mm": -1.5, "speed_mm_s": 0.0},
        {"diameter_mm": 3.0, "x_mm": 2.8, "speed_mm_s": -1000.0},
    ]
    frames = flying(500.0, balls, duration_s=0.004)
    assert frames.velocity[:, 1, 0].max() > 1.9  # nearly twice as fast as the one that struck it
    assert overlaps(frames, balls) < ENTERED
