"""Plates that are no rectangles: what is on the plate, nodal lines, starts, files, and what parts do at a hole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import check_refused, feeder_sim
from conftest import refusal
from numpy.typing import NDArray
from own_modes import circle, flat_plate, on_plate

import feeder_sim as package
from feeder_sim.engines.surface_arrays import ON_EDGE, edge_distance, off_plate, outline_arrays
from feeder_sim.machine_code import entry_point
from feeder_sim.plate.mode_file import read_mode_file
from feeder_sim.plate.nodal_lines import antinode_near, nodal_lines
from feeder_sim.plate.outline import Outline, checked_outline
from feeder_sim.plate.sequences import nodes_on_line
from feeder_sim.records.seed import Status
from feeder_sim.run.batch import measure_drift
from feeder_sim.scenario import Heap, HexNut, Scattered, Scenario, Start
from feeder_sim.scene.scene import build_scene
from feeder_sim.scene.start import start_poses

# A plate with a notch, an arm and two holes.
RING = 1e-3 * np.array([[-50, -50], [50, -50], [50, 20], [20, 20], [20, 30], [50, 30], [50, 50], [-50, 50]], float)
LYING: Any = {"drop_height_mm": (0.0, 0.0), "tilt_deg": (0.0, 0.0)}
HOLES = (circle(-0.02, 0.0, 0.012), 1e-3 * np.array([[30.0, -20.0], [40, -20], [35, -5]]))


@entry_point
def ask(outline: Any, points: Any, needed: float, off: Any, distance: Any) -> None:
    for i in range(points.shape[0]):
        off[i] = off_plate(outline, points[i, 0], points[i, 1])
        distance[i] = edge_distance(outline, points[i, 0], points[i, 1], needed)


def asked(outline: Outline | None, points: NDArray[np.float64], needed: float) -> tuple[NDArray[Any], NDArray[Any]]:
    off, distance = np.zeros(len(points), bool), np.zeros(len(points))
    ask(outline_arrays(outline), points, needed, off, distance)
    return off, distance


def test_compiled_code_knows_the_outline_exactly() -> None:
    outline = checked_outline([RING, *HOLES])
    edge = outline.edge_points(5e-4)
    near = edge + np.random.default_rng(0).normal(0.0, 3e-4, edge.shape)
    points = np.concatenate([np.random.default_rng(1).uniform(-0.06, 0.06, (4000, 2)), near])
    off, distance = asked(outline, points, 0.004)
    exact = outline.distance(points)
    np.testing.assert_array_equal(off, exact < -ON_EDGE)
    close = (np.abs(exact) < 0.004) & (np.abs(points).max(axis=1) < 0.0505)
    np.testing.assert_allclose(distance[close], exact[close], atol=1e-12)
    assert (distance[exact > 0.004] >= 0.004 - 1e-12).all() and (distance[exact < -0.004] < 0.0).all()
    assert not asked(outline, edge, 0.0)[0].any()  # on the edge is on the plate
    assert not asked(None, points, 0.0)[0].any()


def test_nodal_lines_and_antinodes_stay_on_the_plate(tmp_path: Path) -> None:
    scene = build_scene(on_plate(flat_plate(tmp_path / "p.h5", *HOLES, exterior=RING), amplitude_um=1.0))
    hole = circle(0.0, 0.01, 0.008)
    file = flat_plate(tmp_path / "q.h5", hole)
    surface = build_scene(on_plate(file, amplitude_um=1.0)).surface
    lines = nodal_lines(surface).lines  # of w = x / 50 mm: x = 0, but for the hole
    assert len(lines) == 2
    lengths = sorted(float(np.ptp(line[:, 1])) for line in lines)
    np.testing.assert_allclose(lengths, [0.032, 0.052], atol=2e-5)
    np.testing.assert_allclose(antinode_near(scene.surface, 0, (0.03, 0.0))[0], 0.05, atol=1e-9)
    low, high = (line.position for line in (nodes_on_line(read_mode_file(file).modes, y=y)[0] for y in (0.03, 0.045)))
    np.testing.assert_allclose([*low, *high], 0.0, atol=1e-9)
    assert nodes_on_line(read_mode_file(file).modes, y=0.01) == []  # the node is over the hole


def test_starts_keep_to_the_plate(tmp_path: Path) -> None:
    file = flat_plate(tmp_path / "p.h5", *HOLES, exterior=RING)
    part = HexNut(size="M2.5", count=60, start=Scattered(kind="scattered"))
    scene = build_scene(on_plate(file, part=part))
    places = np.array([pose.position[:2] for pose in start_poses(scene, np.random.default_rng(0))])
    outline = scene.surface.outline
    assert outline is not None and (outline.distance(places) >= scene.kinds[0].size).all()
    for start, key in (
        (Start(position_mm=(-20.0, 1.0)), "position_mm"),
        (Start(position_mm=(40.0, 25.0)), "position_mm"),
        (Heap(kind="heap", centre_mm=(0.0, 0.0), diameter_mm=30.0), "diameter_mm"),
        (Heap(kind="heap", centre_mm=(-20.0, 0.0), diameter_mm=10.0), "centre_mm"),
    ):
        assert key in refusal(build_scene, on_plate(file, part=HexNut(size="M2.5", start=start)))
    build_scene(on_plate(file, part=HexNut(size="M2.5", start=Start(position_mm=(-40.0, 0.0)))))


def rests(scenario: Scenario) -> tuple[Status, NDArray[np.float64]]:
    """How the only seed ends, and where the nut is then [mm]."""
    result = package.simulate(scenario)
    assert not result.failures
    return result.seeds[0].status, 1e3 * result.seeds[0].frames.position[-1, 0]


def test_a_nut_falls_through_a_hole_and_lies_over_a_smaller_one(tmp_path: Path) -> None:
    big = flat_plate(tmp_path / "big.h5", circle(0.02, 0.0, 0.01))
    small = flat_plate(tmp_path / "small.h5", circle(0.02, 0.0, 0.0015))
    thrown = Start(position_mm=(5.0, 0.4), velocity_mm_s=(250.0, 0.0, 0.0), **LYING)
    status, _ = rests(on_plate(big, start=thrown))
    assert status == Status.LEFT_PLATE
    # The same nut slides 12 mm where there is none, to the middle of what was the hole.
    status, place = rests(on_plate(small, start=thrown))
    assert status == Status.DONE and place[2] == pytest.approx(1.0, abs=0.01) and 14.0 < place[0] < 18.0
    slower = thrown.model_copy(update={"velocity_mm_s": (295.0, 0.0, 0.0)})
    status, place = rests(on_plate(small, start=slower))  # it lies over the small one
    assert status == Status.DONE and abs(place[0] - 20.0) < 2.0 and place[2] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("crowd", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_nut_tips_over_the_edge_of_a_hole_only_with_its_centre(tmp_path: Path, crowd: bool) -> None:
    hole = 1e-3 * np.array([[10.0, -20.0], [40, -20], [40, 20], [10, 20]])  # with a straight edge at x = 10 mm
    file = flat_plate(tmp_path / "p.h5", hole)
    for x, push, stays in ((9.7, 0.0, True), (10.0, 25.0, False)):
        start = Start(position_mm=(x, 0.0), velocity_mm_s=(push, 0.0, 0.0), **LYING)
        scenario = on_plate(file, start=start, duration_s=1.5)
        if crowd:
            other = HexNut(size="M2.5", start=Start(position_mm=(-30.0, 0.0)))
            scenario = scenario.model_copy(update={"part": (*scenario.part, other)})
        result = package.simulate(scenario)
        assert not result.failures
        frames = result.seeds[0].frames
        assert stays == (bool(frames.present[-1, 0]) and abs(1e3 * frames.position[-1, 0, 2] - 1.0) < 0.01)
        assert not crowd or 1e3 * frames.position[-1, 1, 2] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_drifts_without_frames_are_those_with_them(tmp_path: Path) -> None:
    file = flat_plate(tmp_path / "p.h5", circle(0.005, 0.0, 0.006))
    start = Start(position_mm=(20.0, 0.0), velocity_mm_s=(-260.0, 0.0, 0.0), drop_height_mm=(0.0, 0.3))
    scenario = on_plate(file, amplitude_um=10.0, start=start, seeds=6)
    recorded, measured = package.simulate(scenario), measure_drift([scenario])[0]
    status = tuple(seed.status for seed in recorded.seeds)
    assert status == measured.status and Status.LEFT_PLATE in status


def test_what_cannot_be_computed_is_refused(tmp_path: Path) -> None:
    file = flat_plate(tmp_path / "p.h5", HOLES[0])
    for change, expected in (
        ({"run.engine": "mujoco"}, 'run.engine is "mujoco"'),
        ({"contact": {"model": "compliant", "time_constant_us": 500.0}}, 'run.engine is "mujoco"'),
        ({"plate.rim": True}, "plate.rim"),
    ):
        assert expected in refusal(lambda changes: build_scene(on_plate(file).changed(changes)), change)


def test_damaged_outlines_are_refused(tmp_path: Path) -> None:
    file = flat_plate(tmp_path / "good.h5", HOLES[0])
    held = read_mode_file(file)
    assert held.origin is not None and held.origin.imported_from == "test" and held.modes.outline is not None
    np.testing.assert_array_equal(held.modes.outline.holes[0], HOLES[0])

    points, rings = np.concatenate(held.modes.outline.rings), np.repeat([0, 1], [4, len(HOLES[0])])
    crossed = points.copy()
    crossed[[1, 2]] = crossed[[2, 1]]
    cases: list[tuple[str, Any, str]] = [
        ("outline/point", None, "outline"),
        ("outline/ring", None, "outline"),
        ("outline/point", points[:-1], "shapes"),
        ("outline/point", np.full_like(points, np.nan), "points"),
        ("outline/point", crossed, "crosses itself"),
        ("outline/point", 0.9 * points, "length and width"),
        ("outline/ring", rings + 1, "polygons"),
        ("outline/ring", rings[::-1].copy(), "polygons"),
        ("shift", None, "imported_from"),
        ("shift", np.nan, "imported_from"),
    ]
    for i, (name, values, expected) in enumerate(cases):
        broken = tmp_path / f"{i}.h5"
        broken.write_bytes(file.read_bytes())
        with h5py.File(broken, "r+") as content:
            held_there = content if name in content else content.attrs
            del held_there[name]
            if values is not None:
                held_there[name] = values
        check_refused(feeder_sim("modes", broken), f"{i}.h5", expected)


def test_the_run_folder_and_the_replay_show_the_hole(tmp_path: Path) -> None:
    from feeder_sim.records.trajectory_file import read_recording
    from feeder_sim.replay.area import area_of, body_mesh
    from feeder_sim.run.run_folder import record_run

    outline = checked_outline([RING, *HOLES])
    file = flat_plate(tmp_path / "p.h5", *HOLES, exterior=RING)
    start = Start(position_mm=(40.0, 0.0))
    record_run(on_plate(file, amplitude_um=2.0, start=start, duration_s=0.05), tmp_path / "run")
    plate = read_recording(tmp_path / "run").plate
    assert plate.outline is not None and plate.outline.key == outline.key
    area = area_of(plate.x, plate.y, plate.outline)
    first, second, third = np.moveaxis(area.points[area.triangles], 1, 0)
    (ax, ay), (bx, by) = (second - first).T, (third - first).T
    assert 0.5 * (ax * by - ay * bx).sum() == pytest.approx(outline.polygon.area, rel=1e-3)
    np.testing.assert_allclose(area.carried(plate.mode_shape[0]), area.points[:, 0] / 0.05, atol=1e-5)
    vertices, faces = body_mesh(area, outline, 0.003, 0.0)
    assert faces.max() < len(vertices) and np.ptp(vertices[:, 2]) == pytest.approx(0.003)
    assert feeder_sim("replay", tmp_path / "run", "--rebuild", "--help").returncode == 0
