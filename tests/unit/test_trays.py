"""Rigid motions of a tray: shapes, tables of motion, what is refused. Speeds are in tests/verification/test_tray.py."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import toml_of

from feeder_sim import simulate
from feeder_sim.errors import InputError
from feeder_sim.plate.waveform import read_waveform
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Scenario
from feeder_sim.scene.scene import Scene, build_scene

Raw = dict[str, Any]
TRAY: Raw = {
    "plate": {"kind": "tray", "length_mm": 200.0, "width_mm": 100.0},
    "drive": [{"frequency_hz": 50.0, "stroke_um": 200.0, "angle_deg": 30.0, "direction_deg": 90.0, "ring_up": False}],
    "part": [{"shape": "hex_nut", "size": "M3"}],
    "run": {"duration_s": 0.2, "seeds": 1},
}
POINTS = np.array([[0.08, 0.03], [-0.05, -0.04], [0.0, 0.0]])


def scene_with(*drives: Raw, **plate: Any) -> Scene:
    raw = TRAY | {"plate": TRAY["plate"] | plate, "drive": [{"frequency_hz": 50.0} | drive for drive in drives]}
    return build_scene(Scenario.model_validate(raw))


def test_a_stroke_moves_every_point_along_its_line() -> None:
    scene, t = build_scene(Scenario.model_validate(TRAY)), 0.0123
    line = np.array([0.0, math.cos(math.pi / 6.0), math.sin(math.pi / 6.0)])
    expected = 200e-6 * math.sin(2.0 * math.pi * 50.0 * t) * line
    np.testing.assert_allclose(scene.surface.displacement(POINTS, t), np.tile(expected, (3, 1)), atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_turn_moves_points_as_a_small_rotation_does(axis: str) -> None:
    scene, t = scene_with({"turn_mrad": 4.0, "axis": axis, "ring_up": False}), 0.003
    vector = np.eye(3)["xyz".index(axis)] * 4e-3 * math.sin(2.0 * math.pi * 50.0 * t)
    expected = np.cross(vector, np.column_stack([POINTS, np.zeros(3)]))
    np.testing.assert_allclose(scene.surface.displacement(POINTS, t), expected, atol=1e-12)


def test_a_tray_swings_up_without_a_jump() -> None:
    scene = scene_with({"turn_mrad": 4.0, "axis": "y", "phase_deg": 90.0})
    assert np.abs(scene.surface.displacement(POINTS, 0.0)).max() < 1e-15
    assert np.abs(scene.surface.velocity(POINTS, 0.0)).max() < 1e-12
    t = 0.5 + 0.005 * np.arange(5)
    settled = [scene.surface.displacement(POINTS, float(time))[0, 2] for time in t]
    expected = -4e-3 * 0.08 * np.cos(2.0 * math.pi * 50.0 * t)
    np.testing.assert_allclose(settled, expected, atol=1e-9)


def table_of(path: Path, harmonics: dict[int, float], n: int = 64, period_ms: float = 20.0) -> Path:
    """A table of a motion along x [um] and a turn about y [mrad] in opposite phase."""
    way = [sum(a * math.sin(2.0 * math.pi * k * i / n) for k, a in harmonics.items()) for i in range(n)]
    rows = [f"{period_ms * i / n:.9g}, {x:.9g}, {-0.01 * x:.9g}" for i, x in enumerate(way)]
    path.write_text("# made by a test\nt_ms, x_um, ry_mrad\n" + "\n".join(rows) + "\n")
    return path


def test_a_table_moves_the_tray_as_its_harmonics_do(tmp_path: Path) -> None:
    table = table_of(tmp_path / "shove.csv", {1: 500.0, 2: 125.0, 5: 20.0})
    scene, t = scene_with({"motion_file": table, "ring_up": False}), 0.0071
    x = sum(1e-6 * a * math.sin(2.0 * math.pi * 50.0 * k * t) for k, a in {1: 500.0, 2: 125.0, 5: 20.0}.items())
    expected = np.column_stack([np.full(3, x), np.zeros(3), 0.01e3 * x * POINTS[:, 0]])
    np.testing.assert_allclose(scene.surface.displacement(POINTS, t), expected, atol=1e-9)
    assert len(scene.driven[0].drives) == 6 and scene.driven[0].doubt == ""


def test_a_table_with_corners_is_said_to_be_off(tmp_path: Path) -> None:
    rows = "\n".join(f"{0.1 * i:.6g}, {100.0 * i:.6g}" for i in range(200))
    (tmp_path / "saw.csv").write_text("t_ms, x_um\n" + rows)
    wave = read_waveform((tmp_path / "saw.csv").read_text(), tmp_path / "saw.csv", 0.1)
    assert wave.period == pytest.approx(0.02) and len(wave.coefficient) == 40 and wave.residual > 0.05
    assert "40 harmonics come within" in scene_with({"motion_file": tmp_path / "saw.csv"}).driven[0].doubt


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t_ms\n0\n1\n2\n3\n", "begins with 't_ms' ... x_um"),
        ("t_ms, x_mm\n0, 1\n", "begins with 't_ms, x_mm' ... x_um"),
        ("t_ms;x_um\n0;0,5\n", "motion.csv: has semicolons between its columns, must be commas"),
        ("# a remark, with commas\n\nt_ms\tx_um\n0\t1\n", "motion.csv: has tabs between its columns"),
        ("t_ms, x_um\n0, 1\n1, 2\n", "has 2 lines ... 4"),
        ("t_ms, x_um\n0, 1\n1, 2\n2, a\n3, 1\n", "line 4 ... 2,a ... numbers"),
        ("t_ms, x_um\n0, 1\n1, 2\n3, 3\n4, 1\n", "uneven times"),
        ("t_ms, x_um\n0, 0\n5, 1\n10, 2\n15, 1\n", "drive[0].frequency_hz ... 25 ... 50"),
        ("t_ms, x_um\n0, 1\n10, 1\n20, 1\n30, 1\n", "moves nothing"),
    ],
)
def test_tables_that_cannot_be_used_are_refused(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "motion.csv").write_text(text)
    drive = {"frequency_hz": 25.0, "motion_file": "motion.csv"}
    (tmp_path / "tray.toml").write_text(toml_of(TRAY | {"drive": [drive]}))
    check_refused(feeder_sim("check", tmp_path / "tray.toml"), expected)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"drive[0].amplitude_um": 3.0}, "drive[0].amplitude_um: unknown key ... stroke_um"),
        ({"drive[0].mode": 3}, "drive[0].mode: unknown key"),
        ({"drive[0].at_mm": [1.0, 2.0]}, "drive[0].at_mm: unknown key"),
        ({"drive[0].stroke_um": None, "drive[0].angle_deg": None, "drive[0].direction_deg": None}, "exactly one of"),
        ({"drive[0].turn_mrad": 3.0}, "exactly one of"),
        ({"drive[0].axis": "x"}, "turn_mrad and axis"),
        ({"drive[0].stroke_um": 3e4}, "drive[0] ... 30 mm ... 20 mm"),
        ({"plate.kind": "piston"}, "drive[0].stroke_um ... piston ... amplitude_um"),
        ({"plate.tilt_deg": 3.0, "run.steps_per_period": 40}, "plate.tilt_deg ... without a step"),
        ({"plate.tilt_deg": 45.0}, "plate.tilt_deg ... 45 ... 30"),
        ({"run.engine": "mujoco"}, 'run.engine ... "impulse" ... tray'),
    ],
)
def test_what_no_tray_can_do_is_refused(change: Raw, expected: str, tmp_path: Path) -> None:
    (tmp_path / "tray.toml").write_text(toml_of(TRAY, change))
    check_refused(feeder_sim("check", tmp_path / "tray.toml"), "tray.toml", expected)


def sliding(tilt: float, friction: float) -> Scenario:
    """A box on a tilted tray that hardly moves."""
    raw = TRAY | {
        "plate": {"kind": "tray", "length_mm": 1000.0, "width_mm": 100.0, "tilt_deg": tilt},
        "drive": [{"frequency_hz": 50.0, "stroke_um": 0.001}],
        "part": [{"shape": "box", "size_mm": [8, 8, 2], "start": {"kind": "point", "tilt_deg": 0.0, "yaw_deg": 0.0}}],
        "contact": {"friction": friction, "restitution": 0.0},
        "run": {"duration_s": 0.7, "seeds": 1},
    }
    return Scenario.model_validate(raw)


@pytest.mark.parametrize(("tilt", "friction"), [(10.0, 0.1), (-5.0, 0.02)])
def test_a_box_slides_down_a_tilted_tray_as_on_an_incline(tilt: float, friction: float) -> None:
    theta = math.radians(abs(tilt))
    frames = simulate(sliding(tilt, friction)).seeds[0].frames
    acceleration = 2.0 * np.polyfit(frames.time[100:], frames.position[100:, 0, 0], 2)[0]
    expected = 9.81 * (math.sin(theta) - friction * math.cos(theta)) * math.cos(theta)
    assert acceleration == pytest.approx(-math.copysign(expected, tilt), rel=2e-3)


def test_a_box_that_slides_does_not_rise() -> None:
    ensemble = simulate(sliding(10.0, 0.1))
    slid = float(np.ptp(ensemble.seeds[0].frames.position[:, 0, 2]))
    assert slid > 0.03
    assert ensemble.drift.highest_rise_mm.mean == pytest.approx(0.2, abs=0.35)  # the drop is 0.2 to 0.5 mm


def test_a_box_sticks_on_a_tilted_tray_and_lies_flat_on_it() -> None:
    frames = simulate(sliding(5.0, 0.3)).seeds[0].frames
    x, z = frames.position[-1, 0, 0], frames.position[-1, 0, 2]
    assert abs(x) < 2e-4
    theta = math.radians(5.0)
    assert z == pytest.approx((0.5 + x) * math.tan(theta) + 1e-3 / math.cos(theta), abs=2e-6)


def test_conveying_speed_is_measured_along_the_stroke() -> None:
    turned = Scenario.model_validate(TRAY | {"run": {"duration_s": 1.0, "seeds": 2}})
    across = turned.changed({"drive[0].direction_deg": 0.0})
    speeds = [simulate(scenario).conveying for scenario in (turned, across)]
    along, beside = (found.conveying_speed_mm_s.mean for found in speeds)
    assert along == pytest.approx(beside, rel=0.02) and along > 5.0
    assert abs(speeds[0].conveying_across_mm_s.mean) < 0.01 * along
    with pytest.raises(InputError):
        _ = simulate(
            turned.changed({"plate.kind": "piston", "drive": [{"frequency_hz": 50.0, "amplitude_um": 1.0}]})
        ).conveying


DISC: Raw = {"shape": "cylinder", "diameter_mm": 4.0, "height_mm": 0.2}
SHAKEN: Raw = {"frequency_hz": 30.0, "stroke_um": 1000.0, "angle_deg": 25.0}


def conveyed(**changes: Any) -> Any:
    raw = TRAY | {"drive": [SHAKEN], "part": [DISC], "run": {"duration_s": 1.5, "seeds": 1}} | changes
    return simulate(Scenario.model_validate(raw))


@pytest.mark.slow
def test_a_thin_part_on_a_strong_stroke_is_on_the_tray_where_the_tray_is() -> None:
    thin, thick = (conveyed(part=[DISC | {"height_mm": height}]) for height in (0.2, 2.0))
    speeds = [result.conveying.conveying_speed_mm_s for result in (thin, thick)]
    assert [speed.n for speed in speeds] == [1, 1] and speeds[0].mean == pytest.approx(speeds[1].mean, rel=1e-2)
    assert thin.without_value() == {} and 1.0 <= thin.scene.surface.trough / (1e-3 * math.sin(math.radians(25.0))) < 2.1


def test_a_speed_without_a_value_says_why() -> None:
    start = {"position_mm": [97.0, 0.0]}
    result = conveyed(part=[DISC | {"start": start}], run={"duration_s": 0.8, "seeds": 1})
    assert result.conveying.conveying_speed_mm_s.n == 0
    assert "no part stayed on the tray" in result.summary()["without_value"]["conveying_speed_mm_s"]
    assert any("no value: no part stayed on the tray" in line for line in result.lines())


@pytest.mark.parametrize(
    "drive",
    [
        {"stroke_um": 5000.0, "angle_deg": 90.0},
        {"turn_mrad": 40.0, "axis": "x"},
        {"stroke_um": 5000.0, "angle_deg": 60.0},
    ],
)
def test_several_parts_follow_a_tray_that_swings_below_their_centres(drive: Raw) -> None:
    boxes = {"shape": "box", "size_mm": [6.0, 6.0, 0.5], "count": 2}
    start = {"kind": "scattered", "size_mm": [150.0, 80.0], "drop_height_mm": [0.02, 0.05], "tilt_deg": [0.0, 0.0]}
    result = conveyed(
        drive=[{"frequency_hz": 5.0} | drive], part=[boxes | {"start": start}], run={"duration_s": 1.0, "seeds": 1}
    )
    assert not result.failures
    seed = result.seeds[0]
    assert result.scene.on_plate(seed.frames).all()
    last = seed.frames[slice(-200, None)]
    height = [
        result.scene.surface.heights(place[:, :2], np.full(2, t))
        for place, t in zip(last.position, last.time, strict=True)
    ]
    over = last.position[..., 2] - np.array(height)
    assert over.min() > 0.2e-3 and over.max() < 3e-3


def test_a_path_ends_where_a_part_is_taken() -> None:
    boxes = {"shape": "box", "size_mm": [8.0, 8.0, 2.0], "count": 2}
    start = {"kind": "scattered", "centre_mm": [-60.0, 0.0], "size_mm": [60.0, 90.0], "drop_height_mm": [0.02, 0.05]}
    stage = {"drive": [{"frequency_hz": 50.0, "stroke_um": 250.0, "angle_deg": 25.0}], "duration_s": 0.8}
    plain = {"part": [boxes | {"start": start | {"tilt_deg": [0.0, 0.0]}}], "run": {"seeds": 1}, "drive": []}
    picks = {"clearance_mm": 1.0}
    speeds = [
        conveyed(schedule={"cycles": 2, "stage": [stage | pick]}, **plain, **refill).conveying.conveying_speed_mm_s.mean
        for pick, refill in (({}, {}), ({"pick": picks}, {"refill": {"to": 2}}))
    ]
    assert speeds[0] == pytest.approx(speeds[1], rel=0.05) and speeds[0] > 10.0


@pytest.mark.slow
def test_parts_go_round_a_tray_that_turns_as_it_rises() -> None:
    rises = {"frequency_hz": 50.0, "stroke_um": 100.0, "angle_deg": 90.0}
    turns = {"frequency_hz": 50.0, "turn_mrad": 5.0, "axis": "z"}
    box = {"shape": "box", "size_mm": [6.0, 6.0, 2.0], "start": {"position_mm": [40.0, 0.0]}}
    rates = [
        conveyed(
            part=[box], drive=[rises, turns | {"phase_deg": phase}]
        ).circularconveying.circular_conveying_deg_s.mean
        for phase in (0.0, 180.0)
    ]
    assert rates[0] == pytest.approx(-rates[1], rel=0.02) and rates[0] > 5.0
    with pytest.raises(InputError):
        _ = conveyed().circularconveying


def table_of_z(path: Path, motions: dict[int, float], n: int = 2000, period_ms: float = 500.0) -> Path:
    z = [sum(a * math.sin(2.0 * math.pi * k * i / n) for k, a in motions.items()) for i in range(n)]
    path.write_text("t_ms, z_um\n" + "\n".join(f"{period_ms * i / n:.9g}, {value:.9g}" for i, value in enumerate(z)))
    return path


@pytest.mark.parametrize("fast", [45, 145, 600])
def test_a_small_fast_motion_on_a_large_slow_one_is_followed(fast: int, tmp_path: Path) -> None:
    """Its displacement is 0.4 % of the other, its acceleration at 90 Hz ten times as large."""
    table = table_of_z(tmp_path / "motion.csv", {1: 9000.0, fast: 40.0})
    wave = read_waveform(table.read_text(), table, 0.1)
    assert wave.harmonic.tolist() == [1, fast]
    np.testing.assert_allclose(np.abs(wave.coefficient[:, 2]), [9e-3, 40e-6], rtol=1e-6)
    assert wave.left_out < 1e-3 * wave.acceleration


def test_what_a_table_loses_is_said_before_the_run(tmp_path: Path) -> None:
    table_of_z(tmp_path / "motion.csv", {1: 500.0} | dict.fromkeys(range(50, 1000, 2), 1.0))
    raw = TRAY | {
        "drive": [{"frequency_hz": 2.0, "motion_file": "motion.csv"}],
        "run": {"duration_s": 0.02, "seeds": 1},
    }
    (tmp_path / "scene.toml").write_text(toml_of(raw))
    result = feeder_sim("run", tmp_path / "scene.toml", "--out", tmp_path / "run")
    assert (
        result.returncode == 0
        and "warning: drive[0]: " in result.stderr
        and " g of its table are left out" in result.stderr
    )
    assert "at 1996 Hz" in result.stderr and "corners" not in result.stderr


def test_a_surface_that_jumps_is_said_with_stage_and_size() -> None:
    stage = {"name": "lift", "drive": [SHAKEN | {"ring_up": False, "phase_deg": 180.0}], "duration_s": 0.505}
    raw = TRAY | {"drive": [], "schedule": {"cycles": 2, "stage": [stage]}, "run": {"seeds": 1}}
    (line,) = [line for line in prepare(Scenario.model_validate(raw)).warnings if "jumps" in line]
    size = 1000.0 * math.sin(math.radians(25.0)) * abs(math.sin(2.0 * math.pi * 30.0 * 0.505))
    assert f"jumps by up to {size:.3g} um" in line and 'stage "lift" of cycle' in line
    even = raw | {"schedule": {"cycles": 2, "stage": [stage | {"duration_s": 0.5}]}}
    assert not any("jumps" in line for line in prepare(Scenario.model_validate(even)).warnings)
