"""Counts at the end of every stage, on motion made by hand over a strip with two standing waves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import ready, resting

from feeder_sim.measures.poses import Poses
from feeder_sim.measures.separation import Separation, StageReport, stage_reports
from feeder_sim.measures.stage_lines import StageLines, stage_lines
from feeder_sim.records.seed import ARRIVALS, REMOVALS, Cause, Events, Seed, Status, events, joined, no_events, removed
from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Excitation, HexNut, Run, Scattered, Scenario, Strip
from feeder_sim.scenario.schedule import Pick, Schedule, Stage
from feeder_sim.scene.scene import Scene, build_scene

GATHER, SEPARATE, END = 0, 1, 100  # stages, and the last frame; the first stage ends at frame 50
HALF_TURN = np.array([0.0, 1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Six nuts on a strip of 110 x 60 mm; 0.1 s at 4750 Hz, 0.06 s at 8775 Hz with a pause of 0.04 s and a pick."""
    gather, separate = (Excitation(frequency_hz=f, amplitude_um=1.0) for f in (4750.0, 8775.0))
    stages = (
        Stage(name="gather", drive=(gather,), duration_s=0.1),
        Stage(name="separate", drive=(separate,), duration_s=0.06, pause_s=0.04, pick=Pick(clearance_mm=10.0)),
    )
    return build_scene(
        Scenario(
            plate=Strip(thickness_mm=3.0, length_mm=110.0),
            schedule=Schedule(stage=stages),
            part=(HexNut(size="M2.5", count=6, start=Scattered(kind="scattered")),),
            run=Run(seeds=1, frames_per_second=500.0),
        )
    )


@pytest.fixture(scope="module")
def lines(scene: Scene) -> StageLines:
    return stage_lines(scene)


def nodes(scene: Scene) -> tuple[float, float]:
    """The first node of either wave, a quarter of its wavelength from the middle [m]."""
    first, second = (0.5 * math.pi / mode.shape.wavenumber for mode in scene.driven)  # type: ignore[attr-defined]
    assert 4e-3 < first - second < 8e-3  # places within 5 mm of both lines, and of one alone
    return first, second


def still(scene: Scene, places_mm: list[tuple[float, float]]) -> Frames:
    """Parts lying in their places all the time."""
    assert scene.n_frames == END + 1
    position = np.tile(np.array([[1e-3 * x, 1e-3 * y, 1e-3] for x, y in places_mm]), (END + 1, 1, 1))
    return resting(scene.frame_interval * np.arange(END + 1, dtype=np.float64), position)


# 12 mm apart along y, so that everybody is isolated.
ROW = [(0.0, -25.0), (0.0, -13.0), (0.0, -1.0), (0.0, 11.0), (0.0, 23.0), (30.0, 11.0)]


def record(frames: Frames, removals: Events | None = None) -> Seed:
    return Seed(frames, removals=no_events(REMOVALS) if removals is None else removals, status=Status.DONE)


def reports(scene: Scene, lines: StageLines, frames: Frames, removals: Events | None = None) -> list[StageReport]:
    return stage_reports(scene, lines, record(frames, removals))


def test_one_report_per_stage_that_was_reached(scene: Scene, lines: StageLines) -> None:
    frames = still(scene, ROW)
    assert len(reports(scene, lines, frames)) == 2
    assert len(reports(scene, lines, frames[slice(0, 80)])) == 1
    assert len(reports(scene, lines, frames[slice(0, 20)])) == 0


def test_parts_on_nodal_lines_and_in_dead_positions(scene: Scene, lines: StageLines) -> None:
    first, second = (1e3 * node for node in nodes(scene))
    xs = [0.5 * (first + second), -0.5 * (first + second), first + 3.0, -(second - 3.0), 0.0, 25.0]
    frames = still(scene, [(x, y) for x, (_, y) in zip(xs, ROW, strict=True)])
    gather, separate = reports(scene, lines, frames)
    # Between the lines: on both, and dead. Beyond either: on that one alone. In the middle: on none.
    assert 1e3 * abs(25.0e-3 - nodes(scene)[0]) > 5.0
    assert (gather.on_nodal_line, separate.on_nodal_line) == (3, 3)
    assert (gather.dead, separate.dead) == (2, 2)


def test_distance_to_the_lines_is_that_of_theory(scene: Scene, lines: StageLines) -> None:
    for stage, node in enumerate(nodes(scene)):
        points = np.array([[node + 4.9e-3, 0.0], [node + 5.1e-3, 0.0]])
        assert list(lines.near(stage, points, 5e-3)) == [True, False]


def test_isolated_parts_and_nearest_neighbours(scene: Scene, lines: StageLines) -> None:
    assert [report.isolated for report in reports(scene, lines, still(scene, ROW))] == [6, 6]
    close = [(0.0, 0.0), (9.0, 0.0), (0.0, 10.5), (40.0, 0.0), (-40.0, 0.0), (-40.0, 11.0)]
    report = reports(scene, lines, still(scene, close))[GATHER]
    assert report.isolated == 4
    assert report.nearest_mm == pytest.approx(np.median([9.0, 9.0, 10.5, 31.0, 11.0, 11.0]))


def test_counts_are_of_the_end_of_a_stage(scene: Scene, lines: StageLines) -> None:
    frames = still(scene, ROW)
    frames.position[50, 0] = frames.position[50, 1] + [2e-3, 0.0, 0.0]  # in the frame of the first stage's end alone
    assert [report.isolated for report in reports(scene, lines, frames)] == [4, 6]


def test_touching_pairs_are_those_whose_bounding_spheres_overlap(scene: Scene, lines: StageLines) -> None:
    across = 2e3 * scene.kinds[0].size
    places = [*ROW[:3], (30.0, 11.0), (30.0 + across + 0.05, 11.0), (30.0, 11.0 + across + 0.15)]
    assert reports(scene, lines, still(scene, places))[GATHER].touching_pairs == 1
    heap = [(0.1 * i, 0.0) for i in range(6)]
    assert reports(scene, lines, still(scene, heap))[GATHER].touching_pairs == 15


def test_flipped_parts_are_counted_in_the_stage_that_turned_them(scene: Scene, lines: StageLines) -> None:
    frames = still(scene, ROW)
    frames.quaternion[30:, 0] = HALF_TURN
    frames.quaternion[70:, 1] = HALF_TURN
    frames.quaternion[20:40, 2] = HALF_TURN  # and back again before anybody looked
    frames.quaternion[60:, 3] = [math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0]  # on edge
    frames.quaternion[10:, 4] = [math.cos(math.radians(20)), math.sin(math.radians(20)), 0.0, 0.0]  # by 40 degrees
    frames.quaternion[10:, 5] = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # yawed
    assert [report.flipped for report in reports(scene, lines, frames)] == [1, 2]
    came = events(ARRIVALS, time=frames.time[50], part=[1], cycle=1, height=0.0)  # as the second stage began
    refilled = replace(record(frames), arrivals=came)
    assert [report.flipped for report in stage_reports(scene, lines, refilled)] == [1, 1]


def test_picked_and_lost_parts_belong_to_the_stage_they_left_in(scene: Scene, lines: StageLines) -> None:
    frames = still(scene, ROW)
    # One falls off in the first stage; two are picked at the end of the second, after the last frame counts them.
    frames.position[20:, 5] = [0.2, 0.0, -0.06]
    frames.present[26:, 5] = False
    lost = removed([5], float(frames.time[25]), Cause.LOST)
    picked = removed([0, 1], float(frames.time[END]), Cause.PICKED)
    gather, separate = reports(scene, lines, frames, joined([lost, picked]))
    assert (gather.picked, gather.lost, gather.on_plate) == (0, 1, 5)
    assert (separate.picked, separate.lost, separate.on_plate) == (2, 0, 5)


def test_who_is_off_the_plate_or_taken_out_is_not_counted(scene: Scene, lines: StageLines) -> None:
    frames = still(scene, [(0.0, 0.0), (0.0, 12.0), (3.0, 0.0), (0.0, 14.0), (0.0, 100.0), (56.0, 0.0)])
    assert reports(scene, lines, frames)[GATHER].on_plate == 4
    assert reports(scene, lines, frames)[GATHER].isolated == 0
    frames.present[:, 2:4] = False  # the neighbours of the two that stay
    report = reports(scene, lines, frames)[GATHER]
    assert (report.on_plate, report.isolated, report.touching_pairs) == (2, 2, 0)
    frames.present[:] = False
    empty = reports(scene, lines, frames)[GATHER]
    assert (empty.on_plate, empty.isolated, empty.dead, empty.flipped) == (0, 0, 0, 0)
    assert math.isnan(empty.nearest_mm)


def test_measures_are_means_over_the_seeds(scene: Scene) -> None:
    one, other = still(scene, ROW), still(scene, [(0.1 * i, 0.0) for i in range(6)])
    end = float(one.time[END])
    seeds = [
        record(one, removed([0, 1, 2], end, Cause.PICKED)),
        record(other, removed([4], end, Cause.LOST)),
    ]
    found = Separation().compute(ready(scene), seeds)
    assert found.parts == 6
    assert (found.picked.mean, found.lost.mean, found.picked.n) == (1.5, 0.5, 2)
    assert [(stage.cycle, stage.stage) for stage in found.stages] == [(1, "gather"), (1, "separate")]
    assert [stage.end_s.mean for stage in found.stages] == pytest.approx([0.1, 0.2])
    assert [stage.isolated.mean for stage in found.stages] == [3.0, 3.0]
    assert [stage.picked.mean for stage in found.stages] == [0.0, 1.5]


def test_picked_has_no_value_where_nothing_is_picked(scene: Scene) -> None:
    pick_free = tuple(stage.model_copy(update={"pick": None}) for stage in scene.scenario.schedule.stage)  # type: ignore[union-attr]
    several = scene.scenario.model_copy(update={"schedule": Schedule(stage=pick_free)})
    prepared = ready(build_scene(several))
    measure, poses = Separation(), Poses()
    seeds = [record(still(scene, ROW))]
    found = measure.compute(prepared, seeds)
    assert found.picked.n == 0 and found.lost.n == 1
    assert [line.split()[0] for line in measure.lines(prepared, found)] == ["lost", "on"]
    (kind,) = poses.compute(prepared, seeds).pose_kinds
    assert {pose.n for pose in (*kind.picked, kind.picked_other)} == {0}
    with_pick = measure.compute(ready(scene), seeds)
    assert [line.split()[0] for line in measure.lines(ready(scene), with_pick)] == ["picked", "lost", "before"]
