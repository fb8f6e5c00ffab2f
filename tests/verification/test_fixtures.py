"""Parts at fixtures against closed forms and ODEs: walls, a ramp, a fence on a tray that vibrates, gates, rims."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from judged_fixtures import in_fixtures
from numpy.typing import NDArray

from feeder_sim import Result, simulate
from feeder_sim.errors import InputError
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.tables import validated

G = 9.81
BLOCK = {"shape": "box", "size_mm": [10.0, 10.0, 5.0]}
STILL = {"kind": "still", "length_mm": 400.0, "width_mm": 200.0}
RUN = {"duration_s": 1.0, "seeds": 1, "frames_per_second": 100.0}
WALL = {"shape": "box", "size_mm": [5.0, 100.0, 20.0], "position_mm": [20.0, 0.0]}
ANGLE = [[-12.0, -12.0], [12.0, -12.0], [12.0, -8.0], [-8.0, -8.0], [-8.0, 12.0], [-12.0, 12.0]]
BOW = [[0.0, 0.0], [5.0, 5.0], [5.0, 0.0], [0.0, 5.0]]
Floats = NDArray[np.float64]


def computed(
    part: dict[str, Any],
    fixture: dict[str, Any] | list[dict[str, Any]],
    contact: dict[str, float],
    plate: dict[str, Any] = STILL,
    **tables: Any,
) -> Result:
    fixtures = fixture if isinstance(fixture, list) else [fixture]
    raw = {"plate": plate, "part": [part], "fixture": fixtures, "contact": contact, "run": RUN} | tables
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
    distance = np.linalg.norm(frames.position[:, 0] - frames.position[0, 0], axis=1)
    acceleration = max(0.0, G * (np.sin(angle) - friction * np.cos(angle)))
    assert distance[30] == pytest.approx(0.5 * acceleration * frames.time[30] ** 2, rel=1e-6, abs=1e-9)


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
    distance, speed, paths = 0.0, 0.0, []
    for acceleration in pushed:
        paths.append(distance)
        force = np.array([-G * np.sin(tilt) - acceleration, 0.0])
        resists = mu * G * np.cos(tilt) + at_fence * max(0.0, float(-force @ away))
        gained = float(force @ along)
        gained -= np.sign(speed or gained) * min(resists, abs(gained) if speed == 0.0 else resists)
        distance, speed = distance + speed * time[1] + 0.5 * gained * time[1] ** 2, speed + gained * time[1]
    moved = np.array([surface.displacement(middle, t)[0, :2] for t in frames.time])
    path = (frames.position[:, 0, :2] - moved - frames.position[0, 0, :2] + moved[0]) @ along
    assert path[-1] == pytest.approx(np.interp(frames.time[-1], time, paths), rel=0.01)


def test_a_ball_between_two_walls_that_close_gains_twice_their_speed_at_each() -> None:
    ball = thrown({"shape": "ball", "diameter_mm": 10.0}, 5.0, 100.0)
    closing, half = 0.02, 0.015  # [m/s], [m] from the middle to where its centre turns
    walls: list[dict[str, Any]] = [
        {
            "shape": "box",
            "size_mm": [5.0, 100.0, 20.0],
            "position_mm": [side * 22.5, 0.0],
            "restitution": 1.0,
            "friction": 0.0,
            "path": [{"at_s": 10.0, "by_mm": [-side * 1e4 * closing, 0.0, 0.0]}],
        }
        for side in (1.0, -1.0)
    ]
    contact = {"restitution": 0.0, "friction": 0.0}
    frames = computed(ball, walls, contact, run=RUN | {"duration_s": 0.7}).seeds[0].frames
    turns, t, x, speed = [(0.0, 0.0, 0.1)], 0.0, 0.0, 0.1
    while t < 0.7:
        wait = (half - closing * t - np.sign(speed) * x) / (abs(speed) + closing)
        t, x = t + wait, np.sign(speed) * (half - closing * (t + wait))
        speed = -np.sign(speed) * (abs(speed) + 2.0 * closing)
        turns.append((t, float(x), float(speed)))
    table = np.array(turns)
    since = table[np.searchsorted(table[:, 0], frames.time, side="right") - 1]
    expected = since[:, 1] + since[:, 2] * (frames.time - since[:, 0])
    path = np.abs(np.diff(table[:, 1])).sum()
    assert len(turns) > 20
    assert frames.position[:, 0, 0] == pytest.approx(expected, abs=1e-6 * path)


def test_a_part_that_leans_on_a_wall_of_a_tray_is_conveyed_less_the_friction_at_it() -> None:
    """Gravity holds it to the wall across the incline; the stroke conveys along the wall, without a flight."""
    tilt, mu, at_wall = np.radians(3.0), 0.3, 0.2
    tray = {"kind": "tray", "length_mm": 200.0, "width_mm": 400.0, "tilt_deg": 3.0}
    drive = [{"frequency_hz": 25.0, "stroke_um": 200.0, "angle_deg": 20.0, "direction_deg": 90.0}]
    wall = {"shape": "box", "size_mm": [5.0, 390.0, 20.0], "position_mm": [-7.52, 0.0], "restitution": 0.0}
    start = {"position_mm": [0.0, -100.0], "drop_height_mm": 0.0, "tilt_deg": 0.0, "yaw_deg": 0.0}
    result = computed(
        BLOCK | {"start": start}, wall | {"friction": at_wall}, {"restitution": 0.0, "friction": mu}, tray, drive=drive
    )
    frames, surface = result.seeds[0].frames, result.scene.surface
    moved = np.array([surface.displacement(np.zeros((1, 2)), t)[0, 1] for t in frames.time])
    time = np.linspace(0.0, 1.0, 20_001)
    velocity = np.array([surface.velocity(np.zeros((1, 2)), t)[0] for t in time])
    pushed, lifted = np.gradient(velocity[:, 1], time), np.gradient(velocity[:, 2], time)
    resists = (mu * np.cos(tilt) + at_wall * np.sin(tilt)) * (G + lifted)  # on the tray, and at the wall
    distance, speed, paths, step = 0.0, 0.0, [], time[1]
    for own, limit in zip(-pushed, resists, strict=True):  # in the frame of the tray
        paths.append(distance)
        gained = (own - np.sign(speed or own) * min(limit, abs(own) if speed == 0.0 else limit)) * step
        after = speed + gained
        after = 0.0 if speed != 0.0 and after * speed < 0.0 else after
        distance, speed = distance + 0.5 * (speed + after) * step, after
    path = frames.position[:, 0, 1] - moved - (frames.position[0, 0, 1] - moved[0])
    assert abs(paths[-1]) > 2e-3
    assert path[-1] == pytest.approx(np.interp(frames.time[-1], time, paths), rel=0.01)


@pytest.mark.parametrize("scene", ["rim", "mesh", "extrusion"])
def test_parts_come_to_rest_out_of_what_stands_around_them(scene: str) -> None:
    """A rim of a tray, a mesh in pieces, and an outline that is not convex."""
    fixture = {
        "rim": None,
        "mesh": {"shape": "mesh", "file": str(REPOSITORY / "models/bracket/bracket.stl")},
        "extrusion": {"shape": "extrusion", "points_mm": ANGLE, "height_mm": 8.0},
    }[scene]
    part = {"shape": "hex_nut", "size": "M2.5", "count": 5}
    start = {"kind": "heap", "diameter_mm": 12.0, "drop_height_mm": 12.0}
    tray = {"kind": "tray", "length_mm": 30.0, "width_mm": 20.0, "rim": scene == "rim"}
    raw = {
        "plate": tray if scene == "rim" else STILL,
        "part": [part | {"start": start}],
        "contact": {"restitution": 0.3, "friction": 0.3},
        "run": RUN | {"seeds": 2},
    } | (
        {"fixture": [fixture]}
        if fixture
        else {"drive": [{"frequency_hz": 50.0, "stroke_um": 150.0, "duration_s": 0.3}]}
    )
    result = simulate(Scenario.model_validate(raw))
    for seed in result.seeds:
        assert len(seed.removals) == 0
        assert np.abs(seed.frames.velocity[-1]).max() < 1e-3
        assert not in_fixtures(result.scene, seed.frames[slice(-1, None)])


def test_a_gate_lets_a_part_through_in_the_stage_that_opens_it() -> None:
    gate = {"shape": "box", "size_mm": [5.0, 100.0, 20.0], "position_mm": [30.0, 0.0], "restitution": 0.0}
    opens = {"stages": ["open"], "by_mm": [0.0, 0.0, 30.0], "within_s": 0.05}
    stages = [{"name": "wait", "duration_s": 1.0}, {"name": "open", "duration_s": 1.0}]
    for fixture in stages:
        fixture["drive"] = [{"frequency_hz": 50.0, "stroke_um": 300.0, "angle_deg": 25.0}]
    tray = {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0}
    start = {"position_mm": [15.0, 0.0], "drop_height_mm": 0.0, "tilt_deg": 0.0, "yaw_deg": 0.0}
    raw = {
        "plate": tray,
        "part": [BLOCK | {"start": start}],
        "fixture": [gate | {"friction": 0.1, "opens": opens}],
        "contact": {"restitution": 0.1, "friction": 0.4},
        "schedule": {"stage": stages},
        "run": {"seeds": 1, "frames_per_second": 100.0},
    }
    frames = simulate(Scenario.model_validate(raw)).seeds[0].frames
    shut = frames.time <= 1.0
    assert 1e3 * frames.position[shut, 0, 0].max() == pytest.approx(22.5, abs=1.0)
    assert 1e3 * frames.position[-1, 0, 0] > 30.0


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"fixture": [WALL, WALL | {"position_mm": [22.0, 10.0]}]}, "fixture[1].position_mm: is in box_0"),
        (
            {"part": [BLOCK | {"start": {"kind": "state", "position_mm": [19.0, 0.0, 2.5]}}]},
            "lies in the fixture box_0",
        ),
        ({"fixture": [WALL | {"opens": {"stages": ["go"]}}]}, "fixture[0].opens.stages"),
        ({"fixture": [WALL | {"path": [{"at_s": 1.0}, {"at_s": 0.5}]}]}, "times that do not rise"),
        ({"fixture": [{"shape": "extrusion", "height_mm": 1.0, "points_mm": BOW}]}, "crosses itself"),
        ({"fixture": [WALL, WALL | {"position_mm": [60.0, 0.0], "name": "box_0"}]}, "fixture[1].name"),
        ({"run": RUN | {"steps_per_period": 80}}, "run.steps_per_period"),
        ({"run": RUN | {"engine": "mujoco"}}, "run.engine"),
    ],
)
def test_what_cannot_stand_there_is_refused_in_one_line(change: dict[str, Any], problem: str) -> None:
    raw = {"plate": STILL, "part": [thrown(BLOCK, 2.5, 100.0)], "fixture": [WALL], "run": RUN} | change
    with pytest.raises(InputError) as error:
        simulate(validated(raw, Scenario, Path("scene.toml")))
    assert problem in str(error.value)
    assert "\n" not in str(error.value)
