"""Picks of one kind, the right side up, with room for a gripper; and shares of poses, on parts placed by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from conftest import refusal, resting
from scipy.spatial.transform import Rotation

from feeder_sim.measures.picking import pickable
from feeder_sim.measures.poses import Poses
from feeder_sim.part import mesh_file
from feeder_sim.records.seed import ARRIVALS, Cause, Seed, Status, events, removed
from feeder_sim.records.trajectory import Frames
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import input_hashes
from feeder_sim.scenario import Scenario
from feeder_sim.scenario.schedule import Pick
from feeder_sim.scenario.tables import validated
from feeder_sim.scene.gripper import read_gripper
from feeder_sim.scene.scene import Scene, build_scene

FLAT, EDGE = 0.0, 90.0  # [deg]; tilt of a nut
END = 50


def scenario(picks: Any = None, **nuts: Any) -> Scenario:
    """Three nuts and two rods, driven for 0.05 s, pause 0.05 s, pick."""
    scattered = {"kind": "scattered"}
    drive = {"frequency_hz": 4750.0, "amplitude_um": 1.0}
    stage = {"drive": [drive], "duration_s": 0.05, "pause_s": 0.05, "pick": picks or {"clearance_mm": 1.0}}
    raw: dict[str, Any] = {
        "plate": {"kind": "strip", "thickness_mm": 3.0, "length_mm": 110.0},
        "schedule": {"stage": [stage]},
        "part": [
            {"shape": "hex_nut", "size": "M2.5", "count": 3, "start": scattered} | nuts,
            {"shape": "cylinder", "name": "rod", "diameter_mm": 2.0, "height_mm": 8.0, "count": 2, "start": scattered},
        ],
        "run": {"seeds": 1},
    }
    return validated(raw, Scenario, Path("scenario.toml"))


PLACES_MM = [(-40.0, 0.0), (-20.0, 0.0), (0.0, 0.0), (20.0, 0.0), (40.0, 0.0)]


def lying(scene: Scene, tilts_deg: list[float], places_mm: list[tuple[float, float]], yaw_deg: float = 0.0) -> Frames:
    """Parts that lie still, turned over by a tilt about x, at the height of that attitude."""
    tilts = np.radians(tilts_deg)[:, None] * [1.0, 0.0, 0.0]
    turn = Rotation.from_euler("z", yaw_deg, degrees=True) * Rotation.from_rotvec(tilts)
    attitude = turn.as_quat(scalar_first=True)
    height = [-part.lowest(q) for part, q in zip(scene.parts, attitude, strict=True)]
    position = np.column_stack([1e-3 * np.array(places_mm), height])
    n = scene.n_frames
    frames = resting(scene.frame_interval * np.arange(n, dtype=float), np.tile(position, (n, 1, 1)))
    return replace(frames, quaternion=np.tile(attitude, (n, 1, 1)))


@pytest.mark.parametrize(
    ("pick", "taken"),
    [
        ({"part": "hex_nut"}, [0, 1, 2]),
        ({"part": "rod"}, [3, 4]),
        ({"part": "hex_nut", "up": ["A"]}, [0, 2]),
        ({"part": "hex_nut", "up": ["B"]}, [1]),
        ({"part": "hex_nut", "up": ["A", "B"]}, [0, 1, 2]),
        ({"part": "hex_nut", "up": ["+z"]}, [0]),  # either side of a nut is A
        ({"part": "hex_nut", "up": ["-z"]}, [2]),
        ({"part": "hex_nut", "up": ["B", "-z"]}, [1, 2]),
        ({"part": "hex_nut", "up": ["+y"]}, [1]),
        ({"part": "hex_nut", "up": ["-y", "+x"]}, []),
        ({"part": "rod", "up": ["+y", "-z"]}, [3]),
        ({"part": "rod", "up": ["B"]}, [4]),  # upright; lying it is lower, A
        ({}, [0, 1, 2, 3, 4]),
    ],
)
def test_kind_and_side_up(pick: dict[str, Any], taken: list[int]) -> None:
    scene = build_scene(scenario())
    frames = lying(scene, [FLAT, EDGE, 180.0, EDGE, 0.0], PLACES_MM)
    assert pickable(scene, [Pick.model_validate({"clearance_mm": 5.0} | pick)], frames).tolist() == taken


def test_others_are_in_the_way_whatever_their_kind() -> None:
    scene = build_scene(scenario())
    frames = lying(scene, [FLAT, EDGE, FLAT, EDGE, 0.0], [(-40.0, 0.0), (-34.0, 0.0), (0.0, 0.0), (7.0, 0.0), (30, 0)])
    pick = Pick.model_validate({"clearance_mm": 8.0, "part": "hex_nut", "up": ["A"]})
    assert pickable(scene, [pick], frames).tolist() == []
    assert pickable(scene, [pick, Pick(clearance_mm=5.0, part="rod")], frames).tolist() == [3, 4]


def fingers(folder: Path, gap_mm: float = 6.0, *, along: str = "x") -> Path:
    """Two fingers of 1 x 4 mm on either side, 20 mm high."""
    bodies = []
    for side in (-1.0, 1.0):
        body = trimesh.creation.box(extents=[1.0, 4.0, 20.0] if along == "x" else [4.0, 1.0, 20.0])
        shift = 0.5 * (gap_mm + 1.0) * side
        body.apply_translation([shift, 0.0, 10.0] if along == "x" else [0.0, shift, 10.0])
        bodies.append(body)
    path = folder / f"gripper_{along}.stl"
    trimesh.util.concatenate(bodies).export(path)
    return path


def test_a_gripper_needs_room_for_its_fingers(tmp_path: Path) -> None:
    scene = build_scene(scenario())
    # The second rod, upright, stands where a finger beside the first nut would be; at other yaws there is room.
    frames = lying(scene, [FLAT, EDGE, FLAT, EDGE, 0.0], [(0.0, 0.0), (-20.0, 0.0), (20.0, 0.0), (40.0, 0), (0.0, 4.0)])
    gripper = Pick(shape=fingers(tmp_path), part="hex_nut", up=("A",))
    assert pickable(scene, [gripper], frames).tolist() == [0, 2]
    # Two rods side by side along x: one stands between the fingers' way on either side of the other at both yaws.
    rods = lying(scene, [FLAT, FLAT, FLAT, EDGE, EDGE], [(-40.0, 0), (-30.0, 0), (45.0, 0), (0.0, 0.0), (4.0, 0.0)])
    across = Pick(shape=fingers(tmp_path, 4.0), part="rod")
    assert pickable(scene, [across], rods).tolist() == []
    apart = lying(scene, [FLAT, FLAT, FLAT, EDGE, EDGE], [(-40.0, 0), (-30.0, 0), (45.0, 0), (0.0, 0.0), (8.0, 0.0)])
    assert pickable(scene, [across], apart).tolist() == [3, 4]


def test_what_lies_over_or_under_another_part_is_left(tmp_path: Path) -> None:
    scene = build_scene(scenario())
    places = [(0.0, 0.0), (-20.0, 0.0), (20.0, 0.0), (2.0, 0.0), (40.0, 0.0)]
    frames = lying(scene, [FLAT, EDGE, FLAT, EDGE, 0.0], places)
    frames.position[:, 3, 2] += 2e-3  # a rod lies on the first nut
    wide = Pick(shape=fingers(tmp_path, 30.0))
    assert pickable(scene, [wide], frames).tolist() == [1, 2, 4]


def test_fingers_turn_with_the_part(tmp_path: Path) -> None:
    """A rod on its side is gripped across: what lies at its ends is not in the way, at any yaw of both together."""
    scene = build_scene(scenario())
    way = np.array([0.0, 1.0]) * 7.0
    for yaw in (0.0, 33.0, 120.0):
        c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
        end = (float(c * way[0] - s * way[1]), float(s * way[0] + c * way[1]))  # beyond its end
        side = (-end[1] * 0.6, end[0] * 0.6)
        for beside, taken in ((end, True), (side, False)):
            places = [(-40.0, 10.0), (-40.0, -10.0), beside, (0.0, 0.0), (40.0, 0.0)]
            frames = lying(scene, [FLAT, FLAT, FLAT, EDGE, EDGE], places, yaw)
            axis = Rotation.from_quat(frames.quaternion[0, 3], scalar_first=True).apply([0.0, 0.0, 1.0])
            assert abs(axis[:2] @ np.array(end)) == pytest.approx(7.0, abs=1e-6)
            level = scene.poses[1].poses[0].attitude[0]  # which way the rod points at yaw 0
            x, y, _ = Rotation.from_quat(level, scalar_first=True).apply([0.0, 0.0, 1.0])
            across = "x" if abs(y) > abs(x) else "y"
            assert max(abs(x), abs(y)) > 0.99
            found = pickable(scene, [Pick(shape=fingers(tmp_path, 3.0, along=across), part="rod")], frames)
            assert (3 in found) == taken


ALL: dict[str, Any] = {"clearance_mm": 5.0}


@pytest.mark.parametrize(
    ("pick", "line"),
    [
        (ALL | {"part": "nut"}, 'pick.part is "nut", must be hex_nut, rod'),
        ([ALL, ALL | {"up": ["A"]}], "pick[1].up needs the kind whose poses are meant, part: hex_nut, rod"),
        ([ALL | {"part": "rod", "up": ["C"]}], 'pick[0].up: has "C", must be A, B (poses of rod'),
        ([ALL | {"part": "rod", "up": ["top"]}], 'has "top", must be A, B (poses of rod, see feeder-sim part), +x'),
        ({"up": ["A"]}, "must be clearance_mm, shape or both"),
        ([ALL, {"shape": "none.stl"}], "stage[0].pick[1].shape: no such mesh file"),
        (3, "schedule.stage[0].pick: is 3, must be a table"),
    ],
)
def test_bad_picks_are_one_line(pick: Any, line: str) -> None:
    assert line in refusal(lambda: build_scene(scenario(pick)))


def test_bad_grippers_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trimesh.creation.annulus(r_min=3.0, r_max=4.0, height=5.0).export(tmp_path / "ring.stl")  # fingers in one body
    message = refusal(lambda: build_scene(scenario({"shape": str(tmp_path / "ring.stl")})))
    assert "ring.stl: schedule.stage[0].pick.shape: holds a body whose hull has " in message
    path = fingers(tmp_path)
    for scale, shift_mm, problem in (
        (1e-3, 0.0, "is 0.02 mm long, must be at least 0.1 mm"),
        (1e3, 0.0, "mm from its origin, must be up to 1000 mm"),
        (1.0, -0.02, "reaches 0.02 mm below the plate"),
    ):
        mesh = trimesh.load_mesh(path).apply_scale(scale).apply_translation([0.0, 0.0, shift_mm])
        mesh.export(tmp_path / "other.stl")
        assert problem in refusal(read_gripper, tmp_path / "other.stl")
    back_to_back = trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [0, 9, 0]], [[0, 1, 2], [0, 2, 1]], process=False)
    back_to_back.export(tmp_path / "flat.ply")
    assert "encloses no volume" in refusal(read_gripper, tmp_path / "flat.ply")
    monkeypatch.setattr(mesh_file, "MOST_FACETS", 20)  # two boxes have 24
    assert "has 24 facets, must be up to 20" in refusal(read_gripper, path)


def test_a_gripper_that_has_changed_is_read_again(tmp_path: Path) -> None:
    narrow = read_gripper(fingers(tmp_path, 6.0))
    fingers(tmp_path, 10.25)
    wide = read_gripper(tmp_path / "gripper_x.stl")
    reach = [np.concatenate(gripper.fingers)[:, 0].max() for gripper in (narrow, wide)]
    assert reach[1] - reach[0] == pytest.approx(2.125e-3)


def test_grippers_of_one_name_have_hashes_of_their_own(tmp_path: Path) -> None:
    for name, gap in (("a", 6.0), ("b", 8.0)):
        (tmp_path / name).mkdir()
        fingers(tmp_path / name, gap)
    shapes: Any = [{"shape": tmp_path / name / "gripper_x.stl"} for name in ("a", "b")]
    found = input_hashes(scenario(shapes))
    assert list(found) == ["schedule.stage[0].pick[0].shape", "schedule.stage[0].pick[1].shape"]
    assert len(set(found.values())) == 2
    assert list(input_hashes(scenario(shapes[0]))) == ["schedule.stage[0].pick.shape"]


def test_shares_of_poses_by_hand() -> None:
    prepared = prepare(scenario())
    first = lying(prepared.scene, [FLAT, EDGE, FLAT, EDGE, 40.0], PLACES_MM)
    over = lying(prepared.scene, [FLAT, EDGE, EDGE, EDGE, 0.0], PLACES_MM)
    frames = Frames.joined([first[slice(0, 10)], over[slice(10, None)]])  # a nut and a rod change over
    picked = removed([0, 2, 3], float(frames.time[-1]), Cause.PICKED)
    seed = Seed(frames, removals=picked, status=Status.DONE)
    nuts, rods = Poses().compute(prepared, [seed]).pose_kinds
    assert [share.mean for share in nuts.stages[0].shares] == pytest.approx([1 / 3, 2 / 3])
    assert (nuts.stages[0].other.mean, nuts.stages[0].changed.mean) == (0.0, 1.0)
    assert [n.mean for n in nuts.picked] == [1.0, 1.0]
    assert [share.mean for share in rods.stages[0].shares] == [0.5, 0.5]
    assert [n.mean for n in rods.picked] == [1.0, 0.0]
    assert nuts.heights_mm == pytest.approx((1.0, 2.5))
    came = events(ARRIVALS, time=frames.time[5], part=[2], cycle=1, height=0.0)  # then it was another nut before
    (after_refill, _) = Poses().compute(prepared, [replace(seed, arrivals=came)]).pose_kinds
    assert after_refill.stages[0].changed.mean == 0.0
    lines = Poses().lines(prepared, Poses().compute(prepared, [seed]))
    assert lines == ["hex_nut lie      A 33 %, B 67 %, else 0 %", "rod lie          A 50 %, B 50 %, else 0 %"]
