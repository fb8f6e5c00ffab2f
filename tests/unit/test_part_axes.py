"""Poses are those of the axes that a part was drawn in; principal axes stay inside the engines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from feeder_sim import simulate
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import Drive, MeshPart, Run, Scenario, Start, Strip
from feeder_sim.scene.start import start_poses

# Base down with a corner at the origin; the principal axes are turned by 29 degrees about y.
OUTLINE = np.array([[0.0, 0.0], [12.0, 0.0], [12.0, 1.5], [1.5, 1.5], [1.5, 9.0], [0.0, 9.0]])  # x, z
WIDTH = 8.0


def bracket(folder: Path, *, yaw_deg: float = 0.0) -> Path:
    """An L bracket [mm], turned about z."""
    points = np.array([[x, y, z] for y in (0.0, WIDTH) for x, z in OUTLINE])
    sides = [[i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i] for i in range(6)]
    ends = [[0, 1, 2, 3], [0, 3, 4, 5], [6, 9, 8, 7], [6, 11, 10, 9]]
    faces = [[a, c, b] for a, b, c, d in (*sides, *ends)] + [[a, d, c] for a, b, c, d in (*sides, *ends)]
    mesh = trimesh.Trimesh(points, faces)
    mesh.fix_normals()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(yaw_deg), [0, 0, 1]))
    path = folder / f"bracket_{yaw_deg:g}.stl"
    mesh.export(path)
    return path


def scenario(file: Path, *, engine: str = "impulse", **start: object) -> Scenario:
    return Scenario(
        plate=Strip(thickness_mm=3.0),
        drive=(Drive(frequency_hz=4750.0, amplitude_um=3.0),),
        part=(MeshPart(shape="mesh", file=file, start=Start.model_validate({"tilt_deg": (0.0, 0.0), **start})),),
        run=Run.model_validate({"duration_s": 0.03, "seeds": 1, "engine": engine}),
    )


def test_a_part_lies_as_drawn(tmp_path: Path) -> None:
    file = bracket(tmp_path)
    scene = prepare(scenario(file, yaw_deg=(0.0, 0.0), drop_height_mm=(0.5, 0.5))).scene
    pose = start_poses(scene, np.random.default_rng(0))[0]
    kind = scene.kinds[0]
    at = Rotation.from_quat(pose.quaternion, scalar_first=True).apply(kind.vertices) + pose.position
    drawn = 1e-3 * trimesh.load_mesh(file).vertices + pose.position - kind.centre
    assert at == pytest.approx(np.array(drawn), abs=1e-12)
    assert at[:, 2].min() == pytest.approx(0.5e-3, abs=1e-12)
    assert not np.allclose(kind.principal_axes, [1.0, 0.0, 0.0, 0.0])
    assert kind.centre[0] < 6e-3 < 1e-3 * OUTLINE[1, 0]


@pytest.mark.parametrize("engine", ["impulse", "mujoco"])
def test_it_moves_the_same_whichever_way_it_was_drawn(tmp_path: Path, engine: str) -> None:
    """A bracket drawn turned, and one that is turned at its start: the same points are at the same places."""
    places = []
    for drawn, yaw in ((35.0, 0.0), (0.0, 35.0)):
        part = bracket(tmp_path, yaw_deg=drawn)
        result = simulate(scenario(part, engine=engine, yaw_deg=(yaw, yaw), drop_height_mm=(0.1, 0.1)))
        frames = result.seeds[0].frames
        attitude = Rotation.from_quat(frames.quaternion[:, 0], scalar_first=True)
        corner = Rotation.from_euler("z", drawn, degrees=True).apply([5e-3, 2e-3, 3e-3])
        places.append(frames.position[:, 0] + attitude.apply(corner))
        assert np.ptp(frames.position[:8, 0, 2]) > 5e-5  # it has fallen and met the plate
    # Single precision of the file grows in every impact; a wrong axis would show in the first.
    assert places[0][:8] == pytest.approx(places[1][:8], abs=2e-6)
