"""Parts at fixtures against closed forms and an ODE: walls, a ramp, a fence on a tray that is inclined and vibrates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from feeder_sim import Result, simulate
from feeder_sim.scenario import Scenario

G = 9.81
BLOCK = {"shape": "box", "size_mm": [10.0, 10.0, 5.0]}
STILL = {"kind": "still", "length_mm": 400.0, "width_mm": 200.0}
Floats = NDArray[np.float64]


def computed(
    part: dict[str, Any],
    fixture: dict[str, Any],
    contact: dict[str, float],
    plate: dict[str, Any] = STILL,
    **tables: Any,
) -> Result:
    run = {"duration_s": 1.0, "seeds": 1, "frames_per_second": 100.0}
    raw = {"plate": plate, "part": [part], "fixture": [fixture], "contact": contact, "run": run} | tables
    return simulate(Scenario.model_validate(raw))


def thrown(part: dict[str, Any], height_mm: float, speed_mm_s: float) -> dict[str, Any]:
    start = {"kind": "state", "position_mm": [0.0, 0.0, height_mm], "velocity_mm_s": [speed_mm_s, 0.0, 0.0]}
    return part | {"start": start}


def test_a_ball_comes_back_from_a_wall_as_its_restitution_says() -> None:
    ball = thrown({"shape": "ball", "diameter_mm": 10.0}, 5.0, 100.0)
    wall = {"shape": "box", "size_mm": [5.0, 100.0, 20.0], "position_mm": [20.0, 0.0], "restitution": 0.5}
    frames = computed(ball, wall | {"friction": 0.0}, {"restitution": 0.3, "friction": 0.0}).seeds[0].frames
    meets = (17.5 - 5.0) / 100.0  # the face of the wall is at 17.5 mm
    after = frames.time > meets
    assert frames.velocity[after, 0, 0] == pytest.approx(-0.05, rel=1e-6)
    expected = 12.5 - 50.0 * (frames.time[after] - meets)
    assert 1e3 * frames.position[after, 0, 0] == pytest.approx(expected, abs=2e-6 * 12.5 + 1e-5)


def test_a_block_that_slides_into_a_wall_stops_where_friction_says() -> None:
    mu, e, speed = 0.1, 0.5, 0.2
    wall = {
        "shape": "box",
        "size_mm": [5.0, 100.0, 20.0],
        "position_mm": [17.5, 0.0],
        "restitution": e,
        "friction": 0.2,
    }
    frames = computed(thrown(BLOCK, 2.5, 1e3 * speed), wall, {"restitution": 0.3, "friction": mu}).seeds[0].frames
    squared = e * e * (speed**2 - 2.0 * mu * G * 0.01)
    assert frames.position[-1, 0, 0] == pytest.approx(0.01 - squared / (2.0 * mu * G), rel=1e-6)


@pytest.mark.parametrize("friction", [0.1, 0.4])
def test_a_block_slides_on_a_ramp_or_stays(friction: float) -> None:
    angle = np.radians(15.0)
    normal = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    place = np.array([60.0, 0.0, 160.0 * np.tan(angle)]) + 2.5005 * normal
    turn = [float(np.cos(0.5 * angle)), 0.0, float(-np.sin(0.5 * angle)), 0.0]
    part = BLOCK | {"start": {"kind": "state", "position_mm": place.tolist(), "quaternion": turn}}
    ramp = {"shape": "ramp", "size_mm": [200.0, 50.0, float(200.0 * np.tan(angle))], "position_mm": [-100.0, 0.0]}
    result = computed(part, ramp | {"restitution": 0.0, "friction": friction}, {"restitution": 0.0, "friction": 0.1})
    frames = result.seeds[0].frames
    way = np.linalg.norm(frames.position[:, 0] - frames.position[0, 0], axis=1)
    acceleration = max(0.0, G * (np.sin(angle) - friction * np.cos(angle)))
    assert way[30] == pytest.approx(0.5 * acceleration * frames.time[30] ** 2, rel=2e-5, abs=1e-5)


def test_a_block_slides_along_a_fence_of_a_tray() -> None:
    """In the tray's frame: gravity down the incline, the tray's own motion, friction on the tray and at the fence."""
    turn, tilt, mu, at_fence = np.radians(30.0), np.radians(2.0), 0.01, 0.1
    along, away = np.array([np.cos(turn), np.sin(turn)]), np.array([np.sin(turn), -np.cos(turn)])
    start = {"position_mm": (7.51 * away).tolist(), "drop_height_mm": 0.0, "yaw_deg": 30.0, "tilt_deg": 0.0}
    fence = {"shape": "box", "size_mm": [400.0, 5.0, 20.0], "turn_deg": 30.0, "restitution": 0.0, "friction": at_fence}
    tray = {"kind": "tray", "length_mm": 600.0, "width_mm": 400.0, "tilt_deg": 2.0}
    drive = [{"frequency_hz": 5.0, "stroke_um": 200.0, "angle_deg": 0.0}]
    result = computed(BLOCK | {"start": start}, fence, {"restitution": 0.0, "friction": mu}, tray, drive=drive)
    surface, frames = result.scene.surface, result.seeds[0].frames
    middle = np.zeros((1, 2))
    time = np.linspace(0.0, 1.0, 20_001)
    pushed = np.gradient([float(surface.velocity(middle, t)[0, 0]) for t in time], time)
    way, speed, ways = 0.0, 0.0, []
    for acceleration in pushed:
        ways.append(way)
        force = np.array([-G * np.sin(tilt) - acceleration, 0.0])
        resists = mu * G * np.cos(tilt) + at_fence * max(0.0, float(-force @ away))
        gained = float(force @ along)
        gained -= np.sign(speed or gained) * min(resists, abs(gained) if speed == 0.0 else resists)
        way, speed = way + speed * time[1] + 0.5 * gained * time[1] ** 2, speed + gained * time[1]
    moved = np.array([surface.displacement(middle, t)[0, :2] for t in frames.time])
    path = (frames.position[:, 0, :2] - moved - frames.position[0, 0, :2] + moved[0]) @ along
    assert path[-1] == pytest.approx(np.interp(frames.time[-1], time, ways), rel=0.01)
