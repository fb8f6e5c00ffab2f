from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import piston_scenario, strip_scenario

from feeder_sim.errors import InputError
from feeder_sim.records.trajectory_file import read_recording
from feeder_sim.replay.replay import REPLAY, build_replay
from feeder_sim.run.run_folder import record_run


def columns(path: Path) -> dict[str, list[str]]:
    """Columns logged per entity of an .rrd."""
    from rerun.chunk import RrdReader

    found: dict[str, list[str]] = {}
    for chunk in RrdReader(path).stream():
        names = chunk.to_record_batch().schema.names
        found.setdefault(str(chunk.entity_path).strip("/"), []).extend(names)
    return found


def test_replay_shows_plate_nodes_part_path_and_plots(tmp_path: Path) -> None:
    record_run(strip_scenario(seeds=3, duration_s=0.2), tmp_path / "run")
    found = columns(tmp_path / "run" / REPLAY)
    assert "Mesh3D:vertex_colors" in found["plate/surface"] and "sim_time" in found["plate/surface"]
    assert "LineStrips3D:strips" in found["plate/nodal_lines"]
    assert {"Mesh3D:vertex_positions", "Transform3D:translation", "sim_time"} <= set(found["parts/part_0"])
    assert "LineStrips3D:strips" in found["paths/part_0"]
    assert "Scalars:scalars" in found["plots/height_mm/shown"]
    distances = [name for name in found if name.startswith("plots/distance_mm")]
    assert len(distances) == 3


def test_replay_holds_the_recorded_poses_in_millimetres(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    record_run(strip_scenario(duration_s=0.1), tmp_path / "run")
    frames = read_recording(tmp_path / "run").seeds[0]
    for chunk in RrdReader(tmp_path / "run" / REPLAY).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path).strip("/") == "parts/part_0" and "Transform3D:translation" in batch.schema.names:
            shown = np.array([row[0] for row in batch.column("Transform3D:translation").to_pylist()])
            assert shown == pytest.approx(frames.position[:, 0] * 1e3, abs=1e-5)
            return
    raise AssertionError("no poses in the replay")


def test_replay_can_be_built_again_and_for_another_seed(tmp_path: Path) -> None:
    record_run(piston_scenario(seeds=2), tmp_path / "run", replay=False)
    build_replay(tmp_path / "run", tmp_path / "other.rrd", seed=1)
    assert "plots/height_mm/shown" in columns(tmp_path / "other.rrd")
    with pytest.raises(InputError, match="must be 0 to 1"):
        build_replay(tmp_path / "run", tmp_path / "third.rrd", seed=2)
