"""The groups /parts/NAME of a trajectory file; their layout stands there."""

from __future__ import annotations

from typing import Any

import numpy as np

from feeder_sim.hdf5_text import put_array
from feeder_sim.part.stable_poses import PoseTable, StablePose, pose_names
from feeder_sim.records.recording import PartRecord


def write_part(file: Any, part: PartRecord) -> None:
    """Write what is kept of a part."""
    group = f"parts/{part.name}"
    for name, unit in (("vertices", "m"), ("faces", "1"), ("centre", "m"), ("principal_axes", "1")):
        put_array(file, f"{group}/{name}", getattr(part, name), unit)
    poses = part.poses.poses
    pose = np.repeat(np.arange(len(poses)), [len(p.down) for p in poses])
    put_array(file, f"{group}/poses/height", np.array([p.height for p in poses], float), "m")
    put_array(file, f"{group}/poses/chance", np.array([p.chance for p in poses], float), "1")
    put_array(file, f"{group}/poses/yaws", np.array([p.yaws for p in poses], np.int64), "1")
    put_array(file, f"{group}/poses/pose", pose.astype(np.int64), "1")
    put_array(file, f"{group}/poses/down", np.concatenate([np.empty((0, 3)), *(p.down for p in poses)]), "1")
    put_array(file, f"{group}/poses/attitude", np.concatenate([np.empty((0, 4)), *(p.attitude for p in poses)]), "1")


def read_part(name: str, group: Any) -> PartRecord:
    """Read it back."""
    poses = {key: values[()] for key, values in group["poses"].items()}
    of = [poses["pose"] == n for n in range(len(poses["height"]))]
    table = PoseTable(
        tuple(
            StablePose(letter, float(height), float(chance), poses["down"][rows], poses["attitude"][rows], int(yaws))
            for letter, height, chance, yaws, rows in zip(
                pose_names(), poses["height"], poses["chance"], poses["yaws"], of, strict=False
            )
        )
    )
    vertices, faces, centre, axes = (group[key][()] for key in ("vertices", "faces", "centre", "principal_axes"))
    return PartRecord(name, vertices, faces, centre, axes, table)
