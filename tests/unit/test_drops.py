"""Stable poses, drops on a plate at rest, the command `part`, and the picture of poses."""

from __future__ import annotations

import json
import math
import shutil
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, refusal
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from feeder_sim.part.barriers import Barriers
from feeder_sim.part.mesh_part import mesh_part
from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import ball, cylinder, hex_nut
from feeder_sim.part.stable_poses import NONE, PoseTable, stable_poses
from feeder_sim.plots.poses import ELEVATION_DEG, draw_pose
from feeder_sim.pool.work import Work
from feeder_sim.scenario import Contact
from feeder_sim.studies.drops import DropStudy, Share, Throw, drop

HOOK = REPOSITORY / "models/hook/hook.stl"


def tall_nut() -> RigidPart:
    return hex_nut(5e-3, 3e-3, 2.5e-3, 7850.0, "nut")


def box(x: float, y: float, z: float) -> RigidPart:
    mesh = trimesh.creation.box(extents=[x, y, z])
    inertia = np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 12.0
    vertices = np.array(mesh.vertices)
    return RigidPart("box", 1e-3, 1e-3 * inertia, vertices, 0.0, vertices, np.array(mesh.faces))


def test_every_drop_ends_in_a_pose_and_threads_change_nothing() -> None:
    one, two = (drop(tall_nut(), 200, seed=4, work=Work(workers)) for workers in (1, 2))
    assert (one.pose == two.pose).all() and (one.settled_s == two.settled_s).all()
    assert sum(share.hits for share in one.shares) + one.other == 200
    assert one.other == one.moving == 0
    assert np.nanmax(one.settled_s) < 1.0
    assert (drop(tall_nut(), 200, seed=5).pose != one.pose).any()


def test_parts_that_bounce_fall_flat_more_often() -> None:
    """They go on until they have too little energy to get over an edge, and that is highest to get out of lying flat.

    Without bounces a nut stays on the side that it falls on. Toppling over is a matter of 0.46 against 0.67 here.
    """
    flat = [drop(tall_nut(), 400, contact=Contact(restitution=e)).shares[0].value for e in (0.0, 0.8)]
    assert flat[1] - flat[0] > 0.1


def test_a_slab_falls_flat_and_a_cube_has_one_pose() -> None:
    slab = drop(box(6e-3, 6e-3, 0.2e-3), 60)
    assert slab.shares[0].value > 0.9
    assert drop(box(3e-3, 3e-3, 3e-3), 20).shares[0].hits == 20
    assert "ball: has no stable poses" in refusal(drop, ball(3e-3, 7850.0, "ball"))


def test_standard_error_of_shares() -> None:
    study = DropStudy(
        tall_nut(),
        "impulse",
        Contact(),
        Throw((0.0, 0.0)),
        np.empty(0),
        np.array([0] * 90 + [NONE] * 10),
        np.zeros(100),
    )
    flat, edge = study.shares
    assert flat.value == 0.9 and flat.standard_error == pytest.approx(0.03, rel=0.05)
    assert edge.value == 0.0 and edge.standard_error == pytest.approx(0.01, rel=0.05)
    assert study.other == 10


def test_the_barrier_of_a_pose_is_the_nearest_edge() -> None:
    """A box on a face rolls over the edge that is nearest to the foot of its centre: half a diagonal of a side."""
    sides = np.array([3e-3, 4e-3, 6e-3])
    part = box(*sides)
    table = stable_poses(part)
    for pose, barrier in zip(table.poses, Barriers(part.corners, table).heights, strict=True):
        across = np.sort(np.delete(sides, np.abs(pose.down[0]).argmax()))[0]
        assert barrier == pytest.approx(math.hypot(pose.height, 0.5 * across))


def test_a_drop_ends_early_in_the_pose_that_it_comes_to_lie_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Contacts only take energy: what has too little to get over the edge lies so once it is at rest."""
    bracket = mesh_part(REPOSITORY / "models/bracket/bracket.stl", 1.0, 7850.0, "bracket")
    early = [drop(part, 200, throw=Throw.of(part)) for part in (bracket, tall_nut())]
    monkeypatch.setattr(Barriers, "decided", lambda _, down, __: np.full(len(down), NONE))
    for study in early:
        rest = drop(study.part, 200, throw=study.throw)
        assert (rest.pose == study.pose).all()
        assert (study.settled_s <= rest.settled_s).all() and study.settled_s.sum() < 0.9 * rest.settled_s.sum()


def sides_up(study: DropStudy) -> NDArray[np.int64]:
    """Which axis of the part points up most at the end, shape (drops,): 0 to 2, and 3 to 5 where it points down."""
    up = Rotation.from_quat(study.attitude, scalar_first=True).inv().apply([0.0, 0.0, 1.0])
    axis = np.abs(up).argmax(axis=1)
    return axis + np.where(np.take_along_axis(up, axis[:, None], 1)[:, 0] < 0.0, 3, 0)


def test_a_throw_at_rest_is_a_drop_and_threads_change_nothing() -> None:
    part = tall_nut()
    dropped = drop(part, 100)
    assert (drop(part, 100, throw=Throw((part.longest,) * 2)).attitude == dropped.attitude).all()
    one, two = (drop(part, 100, throw=Throw.of(part), work=Work(workers)) for workers in (1, 2))
    assert (one.attitude == two.attitude).all() and (one.attitude != dropped.attitude).any()
    assert one.other == one.moving == 0


def test_a_thrown_cube_shows_all_sides_alike_and_a_nut_both() -> None:
    """Symmetry: whatever the throw, no side is more likely than its like."""
    cube = drop(box(3e-3, 3e-3, 3e-3), 1200, throw=Throw.of(box(3e-3, 3e-3, 3e-3)))
    counts = np.bincount(sides_up(cube), minlength=6)
    assert counts.sum() == 1200
    assert np.abs(counts - 200).max() <= 2.0 * math.sqrt(1200 * 5 / 36)
    thrown = drop(nut(), 400, throw=Throw.of(nut(), height=(5e-3, 30e-3)))
    flat = np.bincount(sides_up(thrown), minlength=6)
    assert flat[2] + flat[5] == thrown.shares[0].hits
    assert abs(flat[2] - flat[5]) <= 2.0 * math.sqrt(flat[2] + flat[5])


def square_tube(side: float, bore: float, height: float) -> trimesh.Trimesh:
    """A cube with a square hole along z."""
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    rings = [np.column_stack([0.5 * a * corners, np.full(4, z)]) for z in (0.0, height) for a in (side, bore)]
    faces = []
    for k in range(4):
        j = (k + 1) % 4
        for a, b, c, d in ((k, j, 8 + j, 8 + k), (4 + j, 4 + k, 12 + k, 12 + j), (4 + k, 4 + j, j, k)):
            faces += [(a, b, c), (a, c, d)]
        faces += [(8 + k, 8 + j, 12 + j), (8 + k, 12 + j, 12 + k)]
    mesh = trimesh.Trimesh(np.vstack(rings), faces)
    assert mesh.is_watertight and mesh.volume > 0.0
    return mesh


@pytest.mark.parametrize("shape", ["die", "coin"])
def test_faces_that_look_alike_come_up_alike(shape: str, tmp_path: Path) -> None:
    mesh = square_tube(10.0, 4.0, 10.0) if shape == "die" else trimesh.creation.cylinder(10.0, 2.0, sections=32)
    mesh.export(tmp_path / f"{shape}.stl")
    facts = json.loads(feeder_sim("part", tmp_path / f"{shape}.stl", "--throws", 1000, "--drops", 0, "--json").stdout)
    assert sum(p["thrown_share"] for p in facts["stable_poses"]) + facts["throws"]["other_share"] == pytest.approx(1.0)
    assert facts["throws"]["other_share"] == 0.0
    part = mesh_part(tmp_path / f"{shape}.stl", 1.0, 7850.0, shape)
    sides = np.bincount(sides_up(drop(part, 1000, throw=Throw.of(part))), minlength=6)
    for alike in [[2, 5], [0, 1, 3, 4]] if shape == "die" else [[2, 5]]:
        n, k = sides[alike].sum(), len(alike)
        assert np.abs(sides[alike] - n / k).max() <= 2.0 * math.sqrt(n * (k - 1)) / k


def test_tries_until_a_side_is_up() -> None:
    """Wilson's interval of 20 of 100 is 0.1334 to 0.2888 (statsmodels.stats.proportion.proportion_confint)."""
    tries = Share(stable_poses(tall_nut()).poses[0], 20, 100).tries
    assert tries == pytest.approx((5.0, 1 / 0.28881, 1 / 0.13337), rel=1e-3)
    never = Share(stable_poses(tall_nut()).poses[0], 0, 100).tries
    assert never[0] == never[2] == math.inf and never[1] == pytest.approx(1 / 0.03699, rel=1e-3)


@pytest.mark.parametrize("throw", [Throw((1.0, 0.5)), Throw((0.1, 0.1), speed=(-1.0, 1.0)), Throw((math.nan, 1.0))])
def test_a_throw_that_cannot_be_is_refused(throw: Throw) -> None:
    assert "must be 0 to" in refusal(drop, tall_nut(), 10, throw=throw)


@pytest.mark.slow
@pytest.mark.parametrize("throw", [None, Throw.of(tall_nut())], ids=["dropped", "thrown"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_engines_agree_on_a_nut(friction: float, throw: Throw | None) -> None:
    contact = Contact(friction=friction)
    impulse, mujoco = (
        drop(tall_nut(), 400, throw=throw, contact=contact, engine=engine) for engine in ("impulse", "mujoco")
    )
    together = math.hypot(impulse.shares[0].standard_error, mujoco.shares[0].standard_error)
    assert abs(impulse.shares[0].value - mujoco.shares[0].value) < 3.0 * together
    if friction == 0.0 and throw is None:  # without it, most drops are alike one by one
        assert (impulse.pose == mujoco.pose).mean() > 0.9


def test_what_is_in_front_hides_what_is_behind() -> None:
    """The box covers as much of the plate as its three visible faces do."""
    reach, elevation = 12e-3, math.radians(ELEVATION_DEG)
    figure = Figure(figsize=(4.0, 4.0), dpi=300)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    axes.set_axis_off()
    draw_pose(axes, box(6e-3, 4e-3, 2e-3), np.array([1.0, 0.0, 0.0, 0.0]), 1e-3, reach)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[:, :, :3] / 255.0
    steel, plate = (picture[:, :, 2] - picture[:, :, 0] > 0.04).sum(), (picture < 1.0).any(axis=2).sum()
    # Turned by 28 degrees against the width of the picture, which faces the eye.
    across = math.radians(28.0)
    sides = math.cos(elevation) * (6e-3 * math.cos(across) + 4e-3 * math.sin(across)) * 2e-3
    expected = sides + math.sin(elevation) * 24e-6
    assert steel / plate == pytest.approx(expected / (math.sin(elevation) * (2.0 * reach) ** 2), rel=0.03)


def test_the_command_describes_a_part() -> None:
    done = feeder_sim("part", HOOK, "--json", "--drops", 50, "--friction", 0.1)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["size_mm"] == pytest.approx([9.0, 12.0, 1.5])
    assert found["volume_mm3"] == pytest.approx(57.375, rel=1e-6)
    assert found["mass_g"] == pytest.approx(57.375 * 7.85e-3, rel=1e-6)
    assert found["corners"] == 12 and found["facets"] == 44 and found["watertight"] is True
    assert [pose["name"] for pose in found["stable_poses"]] == ["A", "B", "C", "D"]
    assert sum(pose["share"] for pose in found["stable_poses"]) + found["drops"]["other_share"] == pytest.approx(1.0)
    assert found["drops"]["friction"] == 0.1 and found["drops"]["restitution"] == 0.2
    assert found["throws"] is None


def test_the_command_throws_a_part_and_says_which_shares_depend_on_it() -> None:
    words = ("part", HOOK, "--drops", 100, "--throws", 100, "--throw-height-mm", "20:60", "--throw-speed-m-s", "1")
    found = json.loads(feeder_sim(*words, "--json").stdout)
    throws, poses = found["throws"], found["stable_poses"]
    assert (throws["height_mm"], throws["speed_m_s"]) == (pytest.approx([20.0, 60.0]), [1.0, 1.0])
    assert throws["spin_rad_s"] == pytest.approx([1e3 / 12.0] * 2, rel=0.3)  # of a part 12 mm long
    assert sum(pose["thrown_share"] for pose in poses) + throws["other_share"] == pytest.approx(1.0)
    for pose in poses:
        mean, low, high = (tries or math.inf for tries in pose["thrown_tries"])
        assert low < mean <= high and mean == pytest.approx(1.0 / pose["thrown_share"] if mean < math.inf else mean)
    text = feeder_sim(*words).stdout
    assert "shares that depend on how it falls: " in text and "thrown (%)" in text


def test_the_command_cuts_a_part(tmp_path: Path) -> None:
    pytest.importorskip("coacd")
    shutil.copy(HOOK, tmp_path)
    line = ("part", tmp_path / "hook.stl", "--pieces", "--drops", 0)
    done = feeder_sim(*line)
    assert done.returncode == 0 and "pieces: 6" in done.stdout, done.stderr
    assert (tmp_path / "hook_pieces.obj").read_text() == (HOOK.parent / "hook_pieces.obj").read_text()
    check_refused(feeder_sim(*line), "hook_pieces.obj: --pieces: exists already, --force replaces it")
    assert feeder_sim(*line, "--force").returncode == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--unit -1", "hook.stl: --unit: is -1.0, must be greater"),
        ("--unit nan", "hook.stl: --unit: is nan, must be a finite number"),
        ("--friction -1", "hook.stl: --friction: is -1.0"),
        ("--engine magic", "--engine: is 'magic', must be impulse, mujoco"),
        ("--material wood", "hook.stl: --material: is 'wood', must be one of"),
        ("--restitution 1.5", "hook.stl: --restitution: is 1.5, must be"),
        ("--unit 1000", "hook.stl: is 1.2e+04 mm long with --unit = 1000, must be 0.1 to 300 mm"),
        ("--piece-error-mm 0.1", "--piece-error-mm: belongs to --pieces"),
        ("--picture poses.txt", "--picture: is '.txt', must be .png"),
        ("--throws 9 --throw-spin-rad-s a:b", "--throw-spin-rad-s: is 'a:b', must be a number or LOW:HIGH"),
        ("--throws 9 --throw-speed-m-s 3:1", "--throw-speed-m-s: is 3 to 1 m/s, must be 0 to 100 m/s, the least first"),
        ("--throws 9 --throw-height-mm nan", "--throw-height-mm: is nan to nan m, must be 0 to 10 m"),
    ],
)
def test_bad_options(options: str, message: str) -> None:
    check_refused(feeder_sim("part", HOOK, "--drops", 0, *options.split()), message)


def nut() -> RigidPart:
    return hex_nut(5e-3, 2e-3, 2.5e-3, 7850.0, "nut")


def turned(table: PoseTable, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random poses, members of theirs and yaws: number, yaw, attitude."""
    number, yaw, attitude = [], [], []
    for n, pose in enumerate(table.poses):
        for level in pose.attitude:
            number.append(n)
            yaw.append(rng.uniform(0.0, 2.0 * np.pi / pose.yaws))
            turn = Rotation.from_rotvec([0.0, 0.0, yaw[-1]]) * Rotation.from_quat(level, scalar_first=True)
            attitude.append(turn.as_quat(scalar_first=True))
    return np.array(number), np.array(yaw), np.array(attitude)


@pytest.mark.parametrize(
    ("part", "heights", "faces", "yaws"),
    [
        (nut(), [1.0e-3, 2.5e-3], [2, 6], [6, 2]),
        (box(6e-3, 4e-3, 2e-3), [1e-3, 2e-3, 3e-3], [2, 2, 2], [2, 2, 2]),
        (box(2e-3, 2e-3, 2e-3), [1e-3], [6], [4]),
        (cylinder(4e-3, 3e-3, 7850.0, "rod"), [1.5e-3, 2e-3], [2, 32], [32, 2]),
        (ball(4e-3, 7850.0, "ball"), [], [], []),
    ],
    ids=["nut", "box", "cube", "cylinder", "ball"],
)
def test_symmetric_poses_are_one(part: RigidPart, heights: list[float], faces: list[int], yaws: list[int]) -> None:
    poses = stable_poses(part).poses
    assert [pose.height for pose in poses] == pytest.approx(heights, rel=6e-3)
    assert [len(pose.down) for pose in poses] == faces
    assert [pose.yaws for pose in poses] == yaws
    assert sum(pose.chance for pose in poses) == pytest.approx(1.0 if poses else 0.0)


def test_a_prism_of_no_symmetry_and_its_mirror_images() -> None:
    """A right-angled prism lies on its two triangles in two ways: they are mirror images."""
    triangle = np.array([[0.0, 0.0], [4e-3, 0.0], [0.0, 3e-3]]) - np.array([4e-3, 3e-3]) / 3.0
    corners = np.array([[x, y, z] for z in (-2.5e-3, 2.5e-3) for x, y in triangle])
    part = RigidPart("prism", 1.0, np.ones(3), corners, 0.0, corners, np.empty((0, 3), np.int64))
    poses = stable_poses(part).poses
    assert sorted(len(pose.down) for pose in poses) == [1, 1, 1, 1, 1]
    ends = [pose for pose in poses if abs(pose.down[0][2]) > 0.9]
    assert ends[0].height == pytest.approx(2.5e-3) == ends[1].height


@pytest.mark.parametrize("part", [nut(), cylinder(4e-3, 3e-3, 7850.0, "rod"), box(6e-3, 4e-3, 2e-3)])
def test_number_and_yaw_of_attitudes(part: RigidPart) -> None:
    table = stable_poses(part)
    number, yaw, attitude = turned(table, np.random.default_rng(1))
    assert (table.number(attitude) == number).all()
    round_ones = np.array([table.poses[n].yaws >= 24 for n in number])
    found = table.yaw(attitude)
    assert found[~round_ones] == pytest.approx(yaw[~round_ones], abs=1e-6)
    assert (found[round_ones] == 0.0).all()
    leaning = Rotation.from_rotvec([np.radians(25.0), 0.0, 0.0]).as_quat(scalar_first=True)
    assert table.number(leaning) == NONE


def test_the_yaw_of_a_rod_on_its_side_is_that_of_its_axis() -> None:
    """However it has rolled."""
    table = stable_poses(cylinder(2e-3, 8e-3, 7850.0, "rod"))
    rng, axes, yaws = np.random.default_rng(2), [], []
    for _ in range(50):
        roll = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
        attitude = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, np.pi)]) * Rotation.from_rotvec([np.pi / 2, 0, 0])
        x, y, _ = attitude.apply([0.0, 0.0, 1.0])
        axes.append(np.arctan2(y, x))
        yaws.append(table.yaw((attitude * roll).as_quat(scalar_first=True)[None])[0])
    difference = (np.array(yaws) - axes) % np.pi
    spread = np.abs((difference - difference[0] + np.pi / 2) % np.pi - np.pi / 2)
    assert spread.max() < np.radians(6.0)  # half of what is between two of its corners


def of_mesh(mesh: Any, folder: Path) -> RigidPart:
    """As read from a file, with the contact corners of the usual error."""
    mesh.export(folder / "part.stl")
    return mesh_part(folder / "part.stl", 1.0, 7850.0, "part", corner_error=50e-6)


def chamfered_cube(side: float, chamfer: float) -> Any:
    """A cube [mm] whose corners are cut."""
    full, less = 0.5 * side, 0.5 * side - chamfer
    points = [np.roll([full, less, less], n) * signs for n in range(3) for signs in product((-1.0, 1.0), repeat=3)]
    return trimesh.Trimesh(np.array(points)).convex_hull


@pytest.mark.parametrize(
    ("mesh", "faces", "yaws"),
    [
        (trimesh.creation.cylinder(radius=1.5, height=2.0, sections=100), 2, 100),
        (trimesh.creation.annulus(1.0, 3.0, 1.0, sections=128), 2, 128),
        (chamfered_cube(3.0, 0.01), 6, 4),
        (trimesh.creation.box(extents=[10.0, 10.0, 0.03]), 2, 4),
    ],
    ids=["disc", "washer", "cube", "shim"],
)
def test_symmetry_is_that_of_the_mesh_whatever_its_contact_corners(
    mesh: Any, faces: int, yaws: int, tmp_path: Path
) -> None:
    lowest = stable_poses(of_mesh(mesh, tmp_path)).poses[0]
    assert (len(lowest.down), lowest.yaws) == (faces, yaws)


def test_a_capsule_has_one_pose_that_it_rolls_in_and_a_ball_of_facets_one_as_well(tmp_path: Path) -> None:
    for mesh in (trimesh.creation.capsule(height=4.0, radius=1.5), trimesh.creation.icosphere(subdivisions=3)):
        assert len(stable_poses(of_mesh(mesh, tmp_path)).poses) == 1


def test_a_part_without_its_file_is_refused(tmp_path: Path) -> None:
    check_refused(feeder_sim("part", tmp_path / "none.stl"), "none.stl: no such mesh file\n")
