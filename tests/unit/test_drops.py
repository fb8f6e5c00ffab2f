"""Drops on a plate at rest, the command `part`, and the picture of poses."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command_line import check_refused, feeder_sim
from conftest import REPOSITORY, refusal

from feeder_sim.part.rigid_part import RigidPart
from feeder_sim.part.solids import ball, hex_nut
from feeder_sim.part.stable_poses import NONE
from feeder_sim.plots.poses import AZIMUTH_DEG, ELEVATION_DEG, PIXELS, render
from feeder_sim.scenario import Contact
from feeder_sim.studies.drops import DropStudy, drop

HOOK = REPOSITORY / "models/hook/hook.stl"


def nut() -> RigidPart:
    return hex_nut(5e-3, 3e-3, 2.5e-3, 7850.0, "nut")


def box(x: float, y: float, z: float) -> RigidPart:
    mesh = trimesh.creation.box(extents=[x, y, z])
    inertia = np.array([y * y + z * z, x * x + z * z, x * x + y * y]) / 12.0
    vertices = np.array(mesh.vertices)
    return RigidPart("box", 1e-3, 1e-3 * inertia, vertices, 0.0, vertices, np.array(mesh.faces))


def test_every_drop_ends_in_a_pose_and_threads_change_nothing() -> None:
    one, two = (drop(nut(), 200, seed=4, workers=workers) for workers in (1, 2))
    assert (one.pose == two.pose).all() and (one.rest_s == two.rest_s).all()
    assert sum(share.hits for share in one.shares) + one.other == 200
    assert one.other == one.moving == 0
    assert np.nanmax(one.rest_s) < 1.0
    assert (drop(nut(), 200, seed=5).pose != one.pose).any()


def test_parts_that_bounce_fall_flat_more_often() -> None:
    """They go on until they have too little energy to get over an edge, and that is highest to get out of lying flat.

    Without bounces a nut stays on the side that it falls on. Toppling over is a matter of 0.46 against 0.67 here.
    """
    flat = [drop(nut(), 400, contact=Contact(restitution=e)).shares[0].value for e in (0.0, 0.8)]
    assert flat[1] - flat[0] > 0.1


def test_a_slab_falls_flat_and_a_cube_has_one_pose() -> None:
    slab = drop(box(6e-3, 6e-3, 0.2e-3), 60)
    assert slab.shares[0].value > 0.9
    assert drop(box(3e-3, 3e-3, 3e-3), 20).shares[0].hits == 20
    assert "ball: has no stable poses" in refusal(drop, ball(3e-3, 7850.0, "ball"))


def test_standard_error_of_shares() -> None:
    study = DropStudy(nut(), "impulse", Contact(), np.array([0] * 90 + [NONE] * 10), np.zeros(100))
    flat, edge = study.shares
    assert flat.value == 0.9 and flat.standard_error == pytest.approx(0.03, rel=0.05)
    assert edge.value == 0.0 and edge.standard_error == pytest.approx(0.01, rel=0.05)
    assert study.other == 10


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_engines_agree_on_a_nut(friction: float) -> None:
    contact = Contact(friction=friction)
    impulse, mujoco = (drop(nut(), 400, contact=contact, engine=engine) for engine in ("impulse", "mujoco"))
    together = math.hypot(impulse.shares[0].standard_error, mujoco.shares[0].standard_error)
    assert abs(impulse.shares[0].value - mujoco.shares[0].value) < 3.0 * together
    if friction == 0.0:  # without it, most drops are alike one by one
        assert (impulse.pose == mujoco.pose).mean() > 0.9


def test_what_is_in_front_hides_what_is_behind() -> None:
    """As many pixels show the box as its three visible faces cover."""
    part = box(6e-3, 4e-3, 2e-3)
    reach = 6e-3
    picture = render(part, np.array([1.0, 0.0, 0.0, 0.0]), 1e-3, reach)
    shown = (picture[:, :, 2] - picture[:, :, 0] > 0.04).sum()
    azimuth, elevation = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
    assert picture.shape == (PIXELS, PIXELS, 3)
    per_metre = PIXELS / (2.0 * math.sqrt(2.0) * reach)
    # Turned by 28 degrees against the width of the picture, which faces the eye.
    across = math.radians(28.0)
    sides = math.cos(elevation) * (6e-3 * math.cos(across) + 4e-3 * math.sin(across)) * 2e-3
    assert azimuth < 0.0
    assert shown == pytest.approx((sides + math.sin(elevation) * 24e-6) * per_metre**2, rel=0.03)


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
        ("--unit -1", "hook.stl: --unit: is -1.0, allowed is greater"),
        ("--unit nan", "hook.stl: --unit: is nan, allowed is a finite number"),
        ("--friction -1", "hook.stl: --friction: is -1.0"),
        ("--engine magic", "--engine: is 'magic', allowed is impulse, mujoco"),
        ("--material wood", "hook.stl: --material: is 'wood', allowed is one of"),
        ("--restitution 1.5", "hook.stl: --restitution: is 1.5, allowed is"),
        ("--unit 1000", "hook.stl: is 1.2e+04 mm long with --unit = 1000, allowed is 0.1 to 300 mm"),
        ("--piece-error-mm 0.1", "--piece-error-mm: belongs to --pieces"),
        ("--picture poses.txt", "--picture: is '.txt', allowed is .png"),
    ],
)
def test_bad_options(options: str, message: str) -> None:
    check_refused(feeder_sim("part", HOOK, "--drops", 0, *options.split()), message)
