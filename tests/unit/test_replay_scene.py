"""What a replay draws besides plate and parts: rings, shadows, text, colours, and the eye that sees them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import piston_scenario, refusal, strip_scenario

from feeder_sim.part.solids import hex_nut
from feeder_sim.part.stable_poses import PoseTable, stable_poses
from feeder_sim.plate.drive import ModalDrive
from feeder_sim.records.recording import PlateRecord, Recording
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.replay.build import scene_box
from feeder_sim.replay.colours import colours_of, default_colour, kind_names
from feeder_sim.replay.labels import bar_length, legend_places, stage_texts
from feeder_sim.replay.layout import FIELD_OF_VIEW, Eye, axes_of, framing, scene_aspect, scene_eye
from feeder_sim.replay.plate import fixture_entries
from feeder_sim.replay.replay import build_replay
from feeder_sim.replay.rerun_file import LIGHT, rerun_content
from feeder_sim.replay.scenery import SLOW, TIMELINE, Box, Mesh, Parts, Scenery
from feeder_sim.replay.seed_view import SeedView
from feeder_sim.replay.video import film_of
from feeder_sim.run.run_folder import record_run
from feeder_sim.scenario import (
    Ball,
    Excitation,
    HexNut,
    Pick,
    RigidPlate,
    Run,
    Scattered,
    Scenario,
    Schedule,
    Stage,
    parse_scenario,
)
from feeder_sim.scenario.fixture import BoxFixture
from feeder_sim.scene.timetable import timetable

SMALL_MM, LARGE_MM = 3.0, 6.0
FEW = 4  # parts of each kind


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two kinds of balls on a plate that shakes and rests; those that lie alone are picked, twice."""
    folder = tmp_path_factory.mktemp("replay") / "run"
    drives = Excitation(frequency_hz=500.0, amplitude_um=20.0), Excitation(frequency_hz=12500.0, amplitude_um=0.5)
    shake = Stage(name="shake", drive=drives, duration_s=0.1, pause_s=0.1, pick=Pick(clearance_mm=10.0))
    start = Scattered(kind="scattered")
    scenario = Scenario(
        plate=RigidPlate(kind="piston", length_mm=60.0, width_mm=40.0),
        schedule=Schedule(stage=(shake,), cycles=2),
        part=tuple(Ball(shape="ball", diameter_mm=size, count=FEW, start=start) for size in (SMALL_MM, LARGE_MM)),
        run=Run(seeds=1, frames_per_second=100.0),
    )
    record_run(scenario, folder, replay=False)
    build_replay(folder, folder / "replay.rrd")
    return folder


@pytest.fixture(scope="module")
def recording(run: Path) -> Recording:
    return read_recording(run)


def logged(replay: Path, entity: str, column: str) -> list[tuple[float | None, Any]]:
    """Time [s] on sim_time, None for static data, and value of all rows of a column of an entity."""
    from rerun.chunk import RrdReader

    found: list[tuple[float | None, Any]] = []
    for chunk in RrdReader(replay).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path).strip("/") != entity or column not in batch.schema.names:
            continue
        values = batch.column(column).to_pylist()
        timed = "sim_time" in batch.schema.names
        times = batch.column("sim_time").cast("int64").to_pylist() if timed else [None] * len(values)
        found += [(t if t is None else t / 1e9, v) for t, v in zip(times, values, strict=True) if timed or t is None]
    return found


def test_rings_lie_on_the_plate_around_the_parts_to_be_picked_as_large_as_their_kind(
    run: Path, recording: Recording
) -> None:
    frames, removals = recording.seeds[0], recording.records[0].removals
    at = float(removals.time[0])
    parts = removals.part[removals.time == at]
    assert {part < FEW for part in parts} == {True, False}, "the test needs picks of both kinds"
    rows = [strips for t, strips in logged(run / "replay.rrd", "picked", "LineStrips3D:strips") if t and t <= at + 1e-9]
    rings = [np.array(ring) for ring in next(strips for strips in reversed(rows) if strips)]
    assert len(rings) == len(parts)
    centres = frames.position[frames.row_at(at), parts, :2] * 1e3
    for ring, centre, part in zip(rings, centres, parts, strict=True):
        radius = np.linalg.norm(ring[:, :2] - centre, axis=1)
        assert radius == pytest.approx(1.35 * 0.5 * (SMALL_MM if part < FEW else LARGE_MM), rel=0.02)
        assert (ring[:, 2] > 0.0).all() and (ring[:, 2] < 0.1).all()


def test_text_tells_stage_cycle_and_drives_and_the_pause(run: Path) -> None:
    texts = [(t, v[0]) for t, v in logged(run / "replay.rrd", "labels/stage", "Points3D:labels") if t is not None]
    drives = "500 Hz, 20 µm + 12.5 kHz, 0.5 µm"
    assert texts == [  # type: ignore[comparison-overlap]
        (pytest.approx(time), f"shake, cycle {cycle} of 2\n{text}")
        for time, cycle, text in ((0.0, 1, drives), (0.1, 1, "pause"), (0.2, 2, drives), (0.3, 2, "pause"))
    ]


def test_text_of_a_scene_without_schedule_follows_its_drives() -> None:
    scenario = piston_scenario(amplitude_um=2.0, duration_s=1.0)
    drive = scenario.drive[0].model_copy(update={"start_s": 0.2, "duration_s": 0.5})
    scenario = scenario.model_copy(update={"drive": (drive,)})
    grid, drives = np.linspace(-1.0, 1.0, 2), (ModalDrive(0, 4750.0, 4750.0, 4e-6),)
    plate = PlateRecord(0.1, 0.1, 3e-3, grid, grid, np.full((1, 2, 2), -0.5), (), grid, drives)
    assert stage_texts(plate, timetable(scenario), 1.0) == [
        (0.0, "pause"),
        (0.2, "4750 Hz, 2 µm"),  # of the largest deflection on the plate
        (pytest.approx(0.7), "pause"),
    ]
    assert len(stage_texts(plate, timetable(scenario), 0.5)) == 2  # not beyond the record


def test_kinds_have_colours_and_a_legend(run: Path, recording: Recording) -> None:
    names = [v for _, v in logged(run / "replay.rrd", "labels/legend", "Points3D:labels")]
    assert names == [["ball 3 mm", "ball 6 mm"]]
    colours = [logged(run / "replay.rrd", f"parts/{kind}/{kind}", "Mesh3D:albedo_factor")[0][1] for kind in (0, 1)]
    legend = logged(run / "replay.rrd", "labels/legend", "Points3D:colors")[0][1]
    assert [colour[0] for colour in colours] == legend and legend[0] != legend[1]
    two = colours_of(parse_scenario(recording.scenario_text, file=recording.path), "kind", recording.parts)
    assert two.index(recording.seeds[0], [FEW - 1, FEW]).tolist() == [[0, 1]] * len(recording.seeds[0])
    nuts = [HexNut(size="M2.5"), HexNut(size="M3"), HexNut(size="M3")]
    assert kind_names(nuts) == ["nut M2.5", "nut M3 (2)", "nut M3 (3)"]


def test_poses_have_colours(recording: Recording) -> None:
    """Nuts flat, on edge and leaning, beside a ball, which has no poses."""
    nut = hex_nut(5e-3, 2e-3, 2.5e-3, 7850.0, "part_0")
    poses = stable_poses(nut)
    nuts, ball = (replace(recording.parts[0], poses=table) for table in (poses, PoseTable(())))
    scenario = parse_scenario(recording.scenario_text, file=recording.path)
    by_pose = colours_of(scenario, "pose", [nuts] * FEW + [ball] * FEW)
    assert [entry.name for entry in by_pose.entries] == ["A", "B", "in no pose"]
    assert len({entry.colour for entry in by_pose.entries}) == 3
    frames = recording.seeds[0][slice(0, 1)]
    attitude = frames.quaternion.copy()
    tilts = np.radians([0.0, 90.0, 40.0])
    attitude[0, :3] = np.column_stack([np.cos(tilts / 2), np.sin(tilts / 2), 0 * tilts, 0 * tilts])
    assert by_pose.index(replace(frames, quaternion=attitude), [0, 1, 2, FEW]).tolist() == [[0, 1, 2, 2]]
    # What a run is coloured by hangs on whether its picks ask for a side.
    assert default_colour(scenario) == "kind"
    picky = scenario.schedule.stage[0].model_copy(update={"pick": Pick(clearance_mm=1.0, up=("A",))})  # type: ignore[union-attr]
    assert default_colour(scenario.model_copy(update={"schedule": Schedule(stage=(picky,))})) == "pose"


def test_one_kind_has_no_legend_and_bar_has_its_length(tmp_path: Path) -> None:
    record_run(strip_scenario(duration_s=0.02), tmp_path / "run")
    replay = tmp_path / "run" / "replay.rrd"
    assert not logged(replay, "labels/legend", "Points3D:labels")
    columns = [f"LineStrips3D:{name}" for name in ("strips", "labels")]
    (_, strips), (_, text) = (logged(replay, "labels/scale_bar", column)[0] for column in columns)
    assert f"{np.ptp(np.array(strips[0])[:, 0]):g} mm" == text[0]
    assert [bar_length(largest) for largest in (45.0, 20.0, 9.9, 0.7)] == [20.0, 20.0, 5.0, 0.5]


def test_shadows_lie_flat_where_parts_are_over_the_plate(run: Path, recording: Recording) -> None:
    frames = recording.seeds[0]
    scales = logged(run / "replay.rrd", "shadows/1", "InstancePoses3D:scales")
    timed = np.array([v for t, v in scales if t is not None])[..., 0]
    assert (timed[: len(frames)] == frames.on_plate(recording.plate, 0.0)[:, FEW:]).all() and not timed.all()
    matrix = np.array(logged(run / "replay.rrd", "shadows", "Transform3D:mat3x3")[0][1][0]).reshape(3, 3).T
    assert matrix @ [0.0, 0.0, 10.0] == pytest.approx([10.0 * LIGHT[0], 10.0 * LIGHT[1], 0.0], abs=0.01)
    assert matrix @ [1.0, 2.0, 0.0] == pytest.approx([1.0, 2.0, 0.0])


def test_only_a_part_high_above_the_plate_has_a_line_down_to_it(recording: Recording, tmp_path: Path) -> None:
    part, position = recording.parts[FEW], np.full((2, 3, 3), [0.0, 0.0, 0.5 * LARGE_MM])
    position[1, 1] = [10.0, 5.0, 12.0]
    there, upright = np.full((2, 3), True), np.tile([1.0, 0.0, 0.0, 0.0], (2, 3, 1))
    mesh = Mesh(part.vertices * 1e3, part.faces)
    parts = Parts(mesh, position, upright, there, there, np.zeros((2, 3), np.int64), [(0, 0, 0)], [0])
    box = Box(np.zeros(3), np.ones(3))
    scenery = Scenery([("parts/1", parts, {"sim_time": [0.0, 1.0]})], box, (0.0, -1.0, 1.0), "", 1, [], wave=True)
    (tmp_path / "lines.rrd").write_bytes(rerun_content(scenery, "test", "picture"))
    rows = [v for t, v in logged(tmp_path / "lines.rrd", "drop_lines/1", "LineStrips3D:strips") if t is not None]
    assert [len(row) for row in rows] == [0, 1]
    assert np.array(rows[1][0]) == pytest.approx(np.array([[10.0, 5.0, 12.0], [10.0, 5.0, 0.0]]))


def projected(eye: Eye, points: np.ndarray[Any, Any], aspect: float) -> np.ndarray[Any, Any]:
    """Places (n, 2) of points (n, 3) [mm] in a pane, from -1 to 1 in each axis; aspect is width over height."""
    right, up, forward = axes_of(eye.position - eye.target)
    relative = points - eye.position
    depth = (relative @ forward) * np.tan(0.5 * FIELD_OF_VIEW)
    return np.column_stack([relative @ right / (aspect * depth), relative @ up / depth])


@pytest.mark.parametrize("sides", [(180.0, 180.0), (300.0, 40.0), (60.0, 200.0)])
def test_plate_and_text_fill_the_pane(sides: tuple[float, float]) -> None:
    half = 0.5 * np.array(sides)
    box = Box(np.array([*-half, -3.0]), np.array([*half, 0.0]))
    points = np.vstack([box.framed(2), legend_places(box, 5)])
    places = projected(scene_eye(box, 5, "picture"), points, scene_aspect(box, "picture"))
    assert np.abs(places).max() < 1.0
    assert np.abs(places[:, 0]).max() > 0.95 or np.abs(places[:, 1]).max() > 0.95


def test_eye_is_as_near_as_it_can_be() -> None:
    points = np.random.default_rng(1).uniform(-50.0, 50.0, (30, 3))
    eye = framing(points, 1.3)
    places = projected(eye, points, 1.3)
    assert np.abs(places).max() == pytest.approx(0.96, abs=1e-6)
    assert places.max(axis=0) == pytest.approx(-places.min(axis=0), abs=1e-6)


def test_one_small_part_is_shown_in_its_cell(tmp_path: Path) -> None:
    record_run(strip_scenario(duration_s=0.02), tmp_path / "run", replay=False)
    recording = read_recording(tmp_path / "run")
    box, half = scene_box(SeedView(recording, 0)), 0.5e3 * recording.plate.length
    assert -half < box.low[0] < -19.5 and 19.5 < box.high[0] < half  # both nodal lines beside the antinode
    assert box.high[1] == pytest.approx(0.5e3 * recording.plate.width)


def test_film_takes_the_record_in_twenty_seconds_or_what_is_asked_for(run: Path, recording: Recording) -> None:
    end = float(recording.seeds[0].time[-1])
    film = film_of(run, None, None)
    assert film.speed == 1.0 and film.times[0] == 0.0 and end - 0.04 < film.times[-1] <= end
    slow = film_of(run, 0.1, 0.2, speed=0.1, fps=20.0)
    assert len(slow.times) == 21 and slow.times[[0, -1]] == pytest.approx([0.1, 0.2])
    slow_motion = film_of(run, None, None, slow=True, fps=10.0)
    assert slow_motion.times[-1] <= 3.9 + 1e-9 and len(slow_motion.times) == 40


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"end": 9.0}, "--from, --to: are 0 and 9, must be 0 <= --from < --to <= 0.4"),
        ({"begin": 0.2, "end": 0.1}, "--from, --to"),
        ({"speed": 0.0}, "--speed: is 0"),
        ({"speed": float("nan")}, "--speed: is nan"),
        ({"fps": 1000.0}, "--fps: is 1000, must be 1 to 240"),
        ({"size": (1281, 720)}, "--size: is 1281x720, must be even numbers"),
        ({"speed": 1e-5}, "--speed, --fps: makes a film of"),
    ],
)
def test_films_that_cannot_be_are_refused(run: Path, values: dict[str, Any], message: str) -> None:
    assert message in refusal(film_of, run, **({"begin": None, "end": None} | values))


def test_a_brush_turns_in_the_replay_and_a_wall_stands(tmp_path: Path) -> None:
    """What is logged without a time would hide where the brush is later; slow motion shows it, too."""
    wall = BoxFixture(shape="box", size_mm=(2.0, 20.0, 5.0), position_mm=(25.0, 0.0), name="wall")
    brush = BoxFixture(
        shape="box", size_mm=(2.0, 20.0, 5.0), position_mm=(-20.0, 0.0), turns_per_minute=150.0, name="brush"
    )
    stage = Stage(name="shake", drive=(Excitation(frequency_hz=50.0, amplitude_um=20.0),), duration_s=0.1, pause_s=0.1)
    scenario = Scenario(
        plate=RigidPlate(kind="piston", length_mm=60.0, width_mm=40.0),
        schedule=Schedule(stage=(stage,)),
        part=(Ball(shape="ball", diameter_mm=3.0, count=2, start=Scattered(kind="scattered", size_mm=(20.0, 30.0))),),
        fixture=(wall, brush),
        run=Run(seeds=1, frames_per_second=100.0),
    )
    record_run(scenario, tmp_path / "run", replay=False)
    logged: dict[str, list[tuple[Any, Any]]] = {"fixtures/wall": [], "fixtures/brush": []}
    for entity, mesh, moment in fixture_entries(SeedView(read_recording(tmp_path / "run"), 0)):
        logged[entity].append((mesh, moment))
    assert [moment for _, moment in logged["fixtures/wall"]] == [{}]
    by_moment = {tuple(moment): mesh for mesh, moment in logged["fixtures/brush"] if moment.get(TIMELINE, 0.1) == 0.1}
    assert set(by_moment) == {(TIMELINE,), (SLOW,)}
    for mesh in by_moment.values():  # a quarter of a turn later it lies along x
        assert np.ptp(mesh.vertices, axis=0) == pytest.approx([20.0, 2.0, 5.0], abs=0.7)
    assert all(moment for _, moment in logged["fixtures/brush"])
