"""Refills: what a scenario may say, which parts come from the hopper, and where they are let go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import refusal, resting, toml_of
from scipy.spatial.distance import cdist, pdist

from feeder_sim.records.trajectory import Frames
from feeder_sim.scenario import Ball, Heap, HexNut, Placed, Scattered, Scenario, load_scenario, parse_scenario
from feeder_sim.scene.refill import refill, refill_count, refill_frames
from feeder_sim.scene.scene import Scene, build_scene
from feeder_sim.scene.start import generator, next_parts, start_poses

HEAP = Heap(kind="heap", diameter_mm=20.0)
POUR: dict[str, Any] = {"start": {"kind": "heap", "diameter_mm": 20.0}}
SPREAD = Scattered(kind="scattered")
DRIVE: dict[str, Any] = {"frequency_hz": 500.0, "amplitude_um": 1.0}
SCENARIO: dict[str, Any] = {
    "plate": {"kind": "piston"},
    "schedule": {"stage": [{"drive": [DRIVE], "duration_s": 0.1, "pick": {"clearance_mm": 5.0}}]},
    "part": [{"shape": "hex_nut", "size": "M2.5", "count": 4, "start": {"kind": "scattered"}}],
    "run": {"seeds": 1},
}


def read(changes: dict[str, Any]) -> Scenario:
    return parse_scenario(toml_of(SCENARIO, changes), file=Path("case.toml"))


def scene_of(*parts: Any, filled: dict[str, Any] | None, side_mm: float = 60.0) -> Scene:
    tables = [part.model_dump(exclude_none=True) for part in parts]
    changes = {"part": tables, "refill": filled, "schedule.cycles": 3, "plate.length_mm": side_mm}
    return build_scene(read(changes | {"plate.width_mm": side_mm}))


def nuts(count: int, start: Any = SPREAD, **more: Any) -> HexNut:
    return HexNut(size="M2.5", count=count, start=start, **more)


def now_on(scene: Scene, places_mm: dict[int, tuple[float, float, float]]) -> Frames:
    """One frame with some parts at places, and the others absent."""
    n = len(scene.parts)
    position, present = np.zeros((1, n, 3)), np.zeros((1, n), bool)
    for part, place in places_mm.items():
        position[0, part], present[0, part] = 1e-3 * np.array(place), True
    return replace(resting(np.zeros(1), position), present=present)


BOTH: dict[str, Any] = {"refill": {}, "robot": {}}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"refill.to": 5}, "refill.to is 5, must be up to 4"),
        ({"refill.below": 5}, "refill.below is 5, must be up to 4"),
        ({"refill": {"to": 2, "below": 3}}, "refill: below is 3, must be up to 2"),
        ({"refill.to": 0}, "refill.to: is 0, must be greater than or equal to 1"),
        ({"refill.to": 2.0}, "refill.to: is 2.0, must be"),
        ({"refill.from": 2}, "refill.from: unknown key"),
        ({"refill.start.kind": "point"}, "refill.start.kind: is point, must be 'scattered', 'heap'"),
        ({"refill": {}, "goal.x_mm": 0.0}, "goal is given, must be none with [refill]"),
        ({"robot.pick_s": -1.0}, "robot.pick_s: is -1.0, must be greater than or equal to 0"),
        (BOTH | {"part[0].count": 1, "part[0].start": None}, "refill.start is missing"),
        (BOTH | {"stage[0].pick": None}, "robot belongs to a [schedule] with a pick"),
        (BOTH | {"part[0].name": "a nut"}, "part[0].name: is 'a nut', "),
    ],
)
def test_bad_refills_are_refused_in_one_line(changes: dict[str, Any], expected: str) -> None:
    assert expected in refusal(read, changes)


def test_parts_placed_one_by_one_are_all_there_at_the_start() -> None:
    placed = nuts(2, Placed(kind="placed", places_mm_deg=((0.0, 0.0, 0.0), (9.0, 0.0, 0.0))))
    poses = start_poses(scene_of(placed, filled=POUR), np.random.default_rng(0))
    assert all(pose.present for pose in poses)
    assert "refill.to is 1, must be 2, all parts" in refusal(scene_of, placed, filled=POUR | {"to": 1})


@pytest.mark.parametrize(
    ("start", "key"),
    [
        (POUR["start"] | {"centre_mm": [25.0, 0.0]}, "refill.start.diameter_mm"),
        ({"kind": "scattered", "centre_mm": [40.0, 0.0]}, "refill.start.centre_mm"),
    ],
)
def test_a_refill_off_the_plate_or_absurdly_wide_is_refused(start: Any, key: str) -> None:
    assert f"{key}: " in refusal(scene_of, nuts(4), filled={"start": start})


def test_a_last_stage_that_may_end_at_once_needs_a_pause_before_a_refill() -> None:
    once = {"plate": {"kind": "strip", "thickness_mm": 3.0}, "stage[0].drive[0].frequency_hz": 4750.0}
    once |= {"stage[0].pick": None, "stage[0].until": {"within_mm": 1.0}}
    build_scene(read(once))
    assert "two frames" in refusal(lambda: build_scene(read(once | {"cycles": 2, "refill": {}})))


def test_kinds_are_called_by_name_or_shape() -> None:
    ball = Ball(shape="ball", diameter_mm=3.0, count=2, start=SPREAD)
    assert scene_of(nuts(2), ball, filled=None).scenario.kind_names == ("hex_nut", "ball")
    three = scene_of(nuts(2), ball, nuts(1, name="small"), filled=None).scenario
    assert three.kind_names == ("hex_nut_0", "ball", "small")
    assert 'part[2].name is "ball"' in refusal(scene_of, nuts(2), ball, nuts(1, name="ball"), filled=None)


def test_kinds_of_one_heap_are_poured_together() -> None:
    ball = Ball(shape="ball", diameter_mm=4.0, count=30, start=HEAP)
    scene = scene_of(nuts(30, HEAP), ball, filled=None)
    heights = []
    for seed in range(3):
        at = np.array([pose.position for pose in start_poses(scene, np.random.default_rng(seed))])
        assert pdist(at).min() > 2 * max(kind.size for kind in scene.kinds)
        heights.append(at[:30, 2].mean() - at[30:, 2].mean())
        assert (np.diff(np.sort(at[:30, 2])) > 1e-3).any() and at[:30, 2].max() > at[30:, 2].min()
    assert np.abs(heights).max() < 0.3 * np.ptp(at[:, 2])  # neither kind lies on the other
    two = scene_of(nuts(30, HEAP), nuts(30, HEAP.model_copy(update={"diameter_mm": 21.0})), filled=None)
    assert "part[1].start: overlaps other parts" in refusal(start_poses, two, np.random.default_rng(0))


def test_the_hopper_holds_the_kinds_in_the_ratio_of_their_counts() -> None:
    scene = scene_of(nuts(30), Ball(shape="ball", diameter_mm=3.0, count=10, start=SPREAD), filled={"to": 8})
    none = np.ones(40, bool)
    drawn = [next_parts(scene, none, 8, generator(scene, seed, 1)) for seed in range(200)]
    assert all(len(set(parts)) == 8 for parts in drawn)
    nuts_share = (np.concatenate(drawn) < 30).mean()
    assert abs(nuts_share - 0.75) < 4 * np.sqrt(0.75 * 0.25 / 1600)
    again = next_parts(scene, none, 8, generator(scene, 7, 1))
    assert (again == drawn[7]).all()
    assert any((drawn[7] != next_parts(scene, none, 8, generator(scene, *other))).any() for other in ((7, 2), (6, 1)))
    free = none.copy()
    free[:28] = free[30:] = False  # two nuts are free, and no ball
    assert sorted(next_parts(scene, free, 8, generator(scene, 0, 1))) == [28, 29]


def test_at_the_start_there_are_as_many_as_a_refill_is_to() -> None:
    scene = scene_of(nuts(30, HEAP), Ball(shape="ball", diameter_mm=3.0, count=10, start=HEAP), filled={"to": 8})
    poses = start_poses(scene, np.random.default_rng(0))
    assert sum(pose.present for pose in poses) == 8 and len(poses) == 40
    at = np.array([pose.position for pose in poses if pose.present])
    assert pdist(at).min() > 2 * scene.kinds[0].size


def test_when_and_how_many() -> None:
    scene = scene_of(nuts(10), filled={"to": 8, "below": 5})
    assert [refill_count(scene, n) for n in (0, 4, 5, 8)] == [8, 4, 0, 0]
    assert [refill_count(scene_of(nuts(10), filled={}), n) for n in (0, 9, 10)] == [10, 1, 0]
    assert refill_frames(scene) == {scene.frame_at(0.1): 1, scene.frame_at(0.2): 2}  # not after the last cycle
    assert refill_frames(scene_of(nuts(10), filled=None)) == {}


def test_a_heap_is_poured_from_above_the_highest_part_under_it() -> None:
    scene = scene_of(nuts(12), filled=POUR)
    size, drop = scene.kinds[0].size, 0.2e-3
    beside, under = (28.0, 0.0, 30.0), (11.0, 0.0, 6.0)
    for places, top in (({0: beside}, 0.0), ({0: beside, 5: under}, 6e-3 + size)):
        parts, poses = refill(scene, now_on(scene, places), generator(scene, 0, 1))
        assert sorted(parts) == sorted(set(range(12)) - set(places))
        at = np.array([pose.position for pose in poses])
        assert at[:, 2].min() == pytest.approx(top + drop + size)
        assert pdist(at).min() > 2 * size
        assert cdist(at, 1e-3 * np.array(list(places.values()))).min() > 2 * size


def test_scattered_parts_keep_away_from_those_on_the_plate_and_come_as_far_as_there_is_room() -> None:
    scene = scene_of(nuts(40), filled={"start": {"kind": "scattered"}}, side_mm=30.0)
    lying = {part: (10.0 * (part % 3) - 10.0, 10.0 * (part // 3) - 10.0, 1.0) for part in range(9)}
    parts, poses = refill(scene, now_on(scene, lying), generator(scene, 0, 1))
    assert 3 < len(poses) == len(parts) < 31
    at = np.array([pose.position for pose in poses])
    assert pdist(np.concatenate([at, 1e-3 * np.array(list(lying.values()))])).min() > 2 * scene.kinds[0].size


def test_a_part_on_its_way_down_beside_the_plate_holds_its_place() -> None:
    scene = scene_of(nuts(3), filled={"start": {"kind": "scattered"}})
    parts, _ = refill(scene, now_on(scene, {0: (0.0, 0.0, 1.0), 1: (40.0, 0.0, -10.0)}), generator(scene, 0, 1))
    assert list(parts) == [2]


def test_the_example_plans_its_refills(repository: Path) -> None:
    assert len(refill_frames(build_scene(load_scenario(repository / "scenarios/refill_nuts.toml")))) == 7
