"""What is recorded must not change what happens: the same motion at any number of frames per second."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from feeder_sim import simulate
from feeder_sim.records.seed import Seed
from feeder_sim.scenario import Scenario

TIMES_FEWER = 4
SAME = 1e-12  # [m]; round-off in the times of frames; a motion that has changed is off by micrometres after 20 ms
NUT = {"shape": "hex_nut", "size": "M2.5"}
STRIP = {"plate": {"kind": "strip", "thickness_mm": 3.0}, "drive": [{"frequency_hz": 4750.0, "amplitude_um": 2.0}]}
BALL = {"shape": "ball", "diameter_mm": 3.0}
CYLINDER = {"shape": "cylinder", "diameter_mm": 4.5, "height_mm": 6.0}
SHAKER = {
    "plate": {"kind": "piston"},
    "drive": [{"frequency_hz": 200.0, "amplitude_um": 60.0, "ring_up": False}],
}
SCENES: dict[str, dict[str, Any]] = {
    "one nut": STRIP | {"part": [NUT | {"start": {"position_mm": [1.95, 0.0]}}]},
    "on a slide": SHAKER | {"part": [BALL | {"guide": {"kind": "slide", "tilt_deg": 5.0, "friction": 0.1}}]},
    "in a tube": SHAKER | {"part": [CYLINDER | {"guide": {"kind": "tube", "inner_diameter_mm": 4.6}}]},
    "many nuts": STRIP
    | {"part": [NUT | {"count": 6, "start": {"kind": "scattered", "size_mm": [30.0, 30.0], "drop_height_mm": 0.1}}]},
}


def recorded(scene: dict[str, Any], steps_per_frame: int, engine: str) -> Seed:
    frequency = scene["drive"][0]["frequency_hz"]
    run = {
        "duration_s": 475.0 / frequency,
        "seeds": 1,
        "frames_per_second": frequency * 40 / steps_per_frame,
        "engine": engine,
    }
    return simulate(Scenario.model_validate(scene | {"run": run})).seeds[0]


@pytest.mark.parametrize("name", SCENES)
def test_frames_change_nothing(name: str) -> None:
    # Frames within windows of the engine, and longer than those.
    few, many = (recorded(SCENES[name], steps, "impulse").frames for steps in (160, 160 // TIMES_FEWER))
    thinned = many[slice(0, None, TIMES_FEWER)]
    assert len(few) > 100 and len(thinned) == len(few)
    assert few.time == pytest.approx(thinned.time, abs=1e-12)
    assert np.abs(few.position - thinned.position).max() < SAME
    assert np.ptp(few.position[len(few) // 2 :, :, 2], axis=0).min() > 1e-6  # it still hops


def test_frames_change_nothing_in_mujoco() -> None:
    few, many = (recorded(SCENES["one nut"], steps, "mujoco").frames for steps in (160, 40))
    assert np.abs(few.position - many.position[::TIMES_FEWER]).max() < SAME
